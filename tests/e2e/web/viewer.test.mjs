// The viewer in headless Chromium against a real server.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { after, before, test } from 'node:test';

import { basin, isWholeNearView, look, openViewer, startBrowser, startServer, terrane, until } from './harness.mjs';

let server;
let browser;
before(async () => {
    server = await startServer();
    browser = await startBrowser();
});
after(async () => {
    await browser?.close();
    await server?.stop();
});

const NEAR_GROUND = '#16.0,215.0,-40.0,0.6,-0.35';

function columnOf(x, z) {
    return JSON.parse(execFileSync(terrane, ['column', '--world', basin, `--at=${x},${z}`, '--json']).toString());
}

/** The shares at a height, by name: everything between two limits is interpolated. */
function sharesAt(limits, y256) {
    let above = limits.findIndex((limit) => limit.y256 > y256);
    above = above === -1 ? limits.length - 1 : Math.max(above, 1);
    const [low, high] = [limits[above - 1], limits[above]];
    const t = Math.min((y256 - low.y256) / (high.y256 - low.y256), 1);
    const shares = {};
    for (const [limit, amount] of [[low, 1 - t], [high, t]]) {
        for (const [name, concentration] of Object.entries(limit.composition)) {
            shares[name] = (shares[name] ?? 0) + amount * concentration;
        }
    }
    return shares;
}

test('the ground is there, lit and coloured, and nothing goes wrong', async () => {
    const { page, faults } = await openViewer(browser, server.port, { place: NEAR_GROUND });
    await until(page, isWholeNearView);
    await page.waitForTimeout(1500);
    const picture = await look(page, 'ground');
    const colors = new Set();
    let green = 0;
    for (let y = 330; y < 430; y += 4) {
        for (let x = 20; x < 480; x += 4) {
            const [r, g, b] = picture.at(x, y);
            colors.add((r >> 3) * 1024 + (g >> 3) * 32 + (b >> 3));
            green += b < Math.max(r, g) ? 1 : 0;
        }
    }
    assert.ok(colors.size > 60, `${colors.size} colours on the ground`);
    assert.ok(green > 1500, `${green} of 2875 pixels are of the warm or green colours of turf and sand`);
    const [, , sky] = picture.at(400, 20);
    assert.ok(sky > 60, 'the sky is not black');
    const state = await page.evaluate(() => ({ ...window.terrane.times, ...window.terrane.figures, ...window.terrane.sceneFigures() }));
    assert.equal(state.usesViews, true);
    assert.equal(state.isUnderfootThere, true);
    assert.ok(state.triangles > 20_000);
    console.log(`first tile ${Math.round(state.firstTile)} ms, near view ${Math.round(state.nearView)} ms after the page began`);
    assert.deepEqual(faults, []);
    await page.close();
});

test('the cut shows the materials of known columns', async () => {
    const { page, faults } = await openViewer(browser, server.port, { place: NEAR_GROUND });
    await until(page, isWholeNearView);
    // A cut along x at z = 0, through five columns.
    await page.evaluate(() => {
        const { world, controls } = window.terrane;
        controls.lookAlong(0, -0.2, 1);
        window.terrane.toggleCut();
        Object.assign(world.cut.point, { x: 40, z: 0 });
        world.cut.heading = 0;
        world.cut.moved();
    });
    await until(page, () => {
        const { cut } = window.terrane.world;
        return cut.missing === 0 && cut.contentAt(40, 20, 0)?.isSolid && cut.near.image.line.width > 1000;
    });
    for (const x of [-60, 0, 40, 77, 130]) {
        const { limits } = columnOf(x, 0);
        const top = limits.at(-1).y256 / 256;
        for (let y = 2.5; y < top - 2; y += 3) {
            const shown = await page.evaluate(
                ([atX, atY]) => {
                    const { world } = window.terrane;
                    const content = world.cut.contentAt(atX, atY, 0);
                    return { ...content, name: world.hello.materials[content.material].name };
                },
                [x, y],
            );
            // A pixel is a third of a voxel: what is within half a voxel may show.
            const near = [-0.5, 0, 0.5].flatMap((by) => {
                const shares = sharesAt(limits, (y + by) * 256);
                const most = Math.max(...Object.values(shares));
                return Object.keys(shares).filter((name) => shares[name] > most - 0.06);
            });
            assert.ok(near.includes(shown.name), `column ${x},0 at ${y}: shows ${shown.name}, is ${near}`);
        }
    }
    await page.waitForTimeout(1500);
    const picture = await look(page, 'cut');
    const colors = new Set();
    for (let y = 200; y < 400; y += 3) {
        const [r, g, b] = picture.at(300, y);
        colors.add((r >> 4) * 256 + (g >> 4) * 16 + (b >> 4));
    }
    assert.ok(colors.size > 5, `${colors.size} colours down the face: layers`);
    assert.deepEqual(faults, []);
    await page.close();
});

test('the probe tells the column that is under the cursor', async () => {
    const { page, faults } = await openViewer(browser, server.port, { place: NEAR_GROUND });
    await until(page, isWholeNearView);
    await page.keyboard.press('p');
    await page.mouse.click(380, 300);
    await until(page, () => window.terrane.world.probe.column !== null);
    const column = await page.evaluate(() => window.terrane.world.probe.column);
    const names = await page.evaluate(() => window.terrane.world.hello.materials.map(({ name }) => name));
    const expected = columnOf(column.x, column.z);
    assert.deepEqual(column.limits.map(({ y256 }) => y256), expected.limits.map(({ y256 }) => y256));
    assert.deepEqual(
        column.limits.map(({ composition }) => Object.fromEntries(composition.map((share) => [names[share.material], share.concentration]))),
        expected.limits.map(({ composition }) => composition),
    );
    assert.match(await page.locator('.probe').innerText(), /granite/);
    await look(page, 'probe');
    assert.deepEqual(faults, []);
    await page.close();
});

test('X-ray finds the veins and caves that are there', async () => {
    const { page, faults } = await openViewer(browser, server.port, { place: NEAR_GROUND });
    await until(page, isWholeNearView);
    await page.keyboard.press('r');
    await until(page, () => {
        const { caves, veins } = window.terrane.sceneFigures().xray;
        return caves + veins > 500;
    });
    await page.waitForTimeout(1500);
    await look(page, 'xray');
    assert.deepEqual(faults, []);
    await page.close();
});

test('columns in place of Draco give the same ground', async () => {
    const { page, faults } = await openViewer(browser, server.port, { query: '?format=columns', place: NEAR_GROUND });
    await until(page, isWholeNearView);
    await page.waitForTimeout(1000);
    await look(page, 'columns');
    const columns = await page.evaluate(() => window.terrane.figures.formats.columns);
    assert.ok(columns.chunks > 20 && columns.triangles > 20_000);
    await page.evaluate(() => window.terrane.setFormat('draco'));
    await until(page, () => window.terrane.figures.formats.draco.chunks > 20 && window.terrane.figures.nearMissing === 0);
    assert.deepEqual(faults, []);
    await page.close();
});

test('walking stands on the ground', async () => {
    const { page, faults } = await openViewer(browser, server.port, { place: NEAR_GROUND });
    await until(page, isWholeNearView);
    await page.keyboard.press('f');
    await until(page, () => {
        const { controls } = window.terrane;
        const { x, y, z } = controls.position;
        const floor = controls.ground.floorUnder(x, y, z, 1);
        return floor !== undefined && Math.abs(y - 1.75 - floor) < 0.1;
    });
    await page.keyboard.down('w');
    await page.waitForTimeout(4000);
    await page.keyboard.up('w');
    const { moved, over } = await page.evaluate(() => {
        const { controls } = window.terrane;
        const { x, y, z } = controls.position;
        return { moved: Math.hypot(x - 16, z + 40), over: y - 1.75 - controls.ground.floorUnder(x, y, z, 1) };
    });
    assert.ok(moved > 1, `${moved} voxels walked`);
    assert.ok(Math.abs(over) < 1.2, `${over} voxels over the ground`);
    assert.deepEqual(faults, []);
    await page.close();
});

test('the place is in the URL', async () => {
    const { page } = await openViewer(browser, server.port, { place: '#500.0,240.0,-700.0,1.000,-0.300' });
    await until(page, () => window.terrane.world !== undefined);
    await page.getByLabel('go to').fill('1200 -300');
    await page.getByLabel('go to').press('Enter');
    await until(page, () => /^#1200\.0,[0-9.]+,-300\.0,1\.000,-0\.300$/.test(location.hash));
    await page.close();
});

test('a server that restarts is found again, and the world goes on', async () => {
    const own = await startServer();
    const { page, faults } = await openViewer(browser, own.port, { place: NEAR_GROUND });
    await until(page, isWholeNearView);
    await own.stop();
    await until(page, () => document.querySelector('.dot').classList.contains('off'));
    const again = await startServer({ port: own.port });
    try {
        await until(page, () => document.querySelector('.dot').classList.contains('on'));
        await page.evaluate(() => void (window.terrane.controls.position.x += 3000));
        await until(page, () => window.terrane.sceneFigures().isUnderfootThere && window.terrane.figures.underfootMissing === 0);
        // A refused connection is an error that the browser itself writes; nothing else may be.
        assert.deepEqual(faults.filter((fault) => !/WebSocket connection to|ERR_CONNECTION_REFUSED/.test(fault)), []);
    } finally {
        await page.close();
        await again.stop();
    }
});
