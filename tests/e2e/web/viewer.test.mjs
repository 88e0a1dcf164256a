// The viewer in headless Chromium against a real server. One page sees it all, in the order of a visit:
// starting the page is what costs most where the processor draws.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';

import { demo, go, look, openViewer, settle, startBrowser, startServer, terrane, until } from './harness.mjs';

/** `--all` flies for a minute. */
const FLIGHT_SECONDS = Number(process.env.TERRANE_FLIGHT_SECONDS ?? 8);
const FLIGHT_SPEED = 40;

const OVER_CANYON = '#-60.0,150.0,60.0,-1.6,-0.25';
const OVER_RIVER = '#-40.0,140.0,-270.0,0.2,-0.7';
const NEAR_GROUND = '#16.0,130.0,-90.0,0.6,-0.35';
/** Blends can be thinner than a voxel: heights are tried this finely. */
const HEIGHT_STEP = 1 / 64;

let server;
let browser;
let page;
let faults;
before(async () => {
    [server, browser] = await Promise.all([startServer(), startBrowser()]);
    ({ page, faults } = await openViewer(browser, server.port, { place: OVER_CANYON }));
});
after(async () => {
    await browser?.close();
    await server?.stop();
});

function noFaults() {
    assert.deepEqual(faults.splice(0), []);
}

function columnOf(x, z) {
    return JSON.parse(execFileSync(terrane, ['column', '--world', demo, `--at=${x},${z}`, '--json']).toString());
}

/** Content of a height of a column as the page must show it: everything between two limits is mixed. */
function expectedAt(limits, y256, materials) {
    let above = limits.findIndex((limit) => limit.y256 > y256);
    above = above === -1 ? limits.length - 1 : Math.max(above, 1);
    const [low, high] = [limits[above - 1], limits[above]];
    const t = Math.min((y256 - low.y256) / (high.y256 - low.y256), 1);
    const linear = [0, 0, 0];
    for (const [limit, amount] of [[low, 1 - t], [high, t]]) {
        for (const [name, share] of Object.entries(limit.composition)) {
            const { color } = materials.get(name);
            [color >> 16, (color >> 8) & 255, color & 255].forEach((value, i) => (linear[i] += amount * share * linearOf(value / 255)));
        }
    }
    const [main] = Object.entries((t < 0.5 ? low : high).composition).sort((a, b) => b[1] - a[1])[0];
    return { isSolid: materials.get(main).solid, color: linear.map((value) => srgbOf(value) * 255), main };
}

const linearOf = (value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
const srgbOf = (value) => (value <= 0.0031308 ? value * 12.92 : 1.055 * value ** (1 / 2.4) - 0.055);

function correlation(a, b) {
    const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
    const [ma, mb] = [mean(a), mean(b)];
    const sum = (f) => a.reduce((total, _, i) => total + f(a[i] - ma, b[i] - mb), 0);
    return sum((x, y) => x * y) / Math.sqrt(sum((x) => x * x) * sum((_, y) => y * y));
}

test('the ground is there, lit and coloured', async () => {
    await until(page, () => window.terrane?.times.nearView > 0);
    await settle(page);
    const picture = await look(page, 'ground');
    const colors = new Set();
    let warm = 0;
    let samples = 0;
    for (let y = 260; y < 440; y += 4) {
        for (let x = 20; x < 480; x += 4) {
            const [r, g, b] = picture.at(x, y);
            colors.add((r >> 3) * 1024 + (g >> 3) * 32 + (b >> 3));
            warm += b < Math.max(r, g) ? 1 : 0;
            ++samples;
        }
    }
    assert.ok(colors.size > 60, `${colors.size} colours on the ground`);
    assert.ok(warm > samples / 2, `${warm} of ${samples} pixels are of the warm or green colours of turf, rock and sand`);
    const [, , sky] = picture.at(400, 20);
    assert.ok(sky > 60, 'the sky is not black');
    const state = await page.evaluate(() => ({ ...window.terrane.times, ...window.terrane.figures, ...window.terrane.sceneFigures() }));
    assert.equal(state.usesViews, true);
    assert.equal(state.isUnderfootThere, true);
    assert.ok(state.triangles > 20_000);
    console.log(`first tile ${Math.round(state.firstTile)} ms, near view ${Math.round(state.nearView)} ms after the page began`);
    noFaults();
});

test('a flight has ground under it all the way', async () => {
    const flight = await page.evaluate(
        ({ seconds, speed }) => new Promise((resolve) => {
            const { controls } = window.terrane;
            const begin = performance.now();
            let last = begin;
            const seen = { frames: 0, missing: 0, distance: 0, stacks: 0 };
            let stack = '';
            const step = (now) => {
                const seconds_passed = Math.max(now - last, 0) / 1000;
                last = now;
                // A frame that came late is no leap: a viewer's eye does not leap either.
                const by = speed * Math.min(seconds_passed, 0.25);
                controls.position.x -= by;
                controls.position.z += by / 3;
                seen.distance += Math.hypot(by, by / 3);
                ++seen.frames;
                const here = `${Math.floor(controls.position.x / 32)} ${Math.floor(controls.position.z / 32)}`;
                seen.stacks += here === stack ? 0 : 1;
                stack = here;
                seen.missing += window.terrane.sceneFigures().isUnderfootThere ? 0 : 1;
                if (now - begin < seconds * 1000) {
                    requestAnimationFrame(step);
                } else {
                    resolve(seen);
                }
            };
            requestAnimationFrame(step);
        }),
        { seconds: FLIGHT_SECONDS, speed: FLIGHT_SPEED },
    );
    console.log(`${Math.round(flight.distance)} voxels over ${flight.stacks} stacks in ${flight.frames} frames`);
    assert.ok(flight.frames > 5 && flight.stacks > 2);
    assert.equal(flight.missing, 0, `${flight.missing} of ${flight.frames} frames had no ground underfoot`);
    noFaults();
});

test('the cut has the colours of known columns', async () => {
    await go(page, NEAR_GROUND);
    // A cut along x at z = 0, through five columns.
    await page.evaluate(() => {
        const { world, controls } = window.terrane;
        controls.lookAlong(0, -0.5, 1);
        window.terrane.toggleCut();
        Object.assign(world.cut.point, { x: 40, z: 0 });
        world.cut.heading = 0;
        world.cut.moved();
    });
    await until(page, () => {
        const { cut } = window.terrane.world;
        return cut.missing === 0 && cut.contentAt(40, 20, 0)?.isSolid && cut.near.image.line.width > 1000;
    });
    await settle(page);
    const picture = await look(page, 'cut');
    const hello = await page.evaluate(() => window.terrane.world.hello.materials);
    const materials = new Map(hello.map((material) => [material.name, material]));
    const names = new Set();
    const onScreen = [];
    let points = 0;
    let wouldFail = 0;
    for (const x of [-60, 0, 40, 77, 130]) {
        const { limits } = columnOf(x, 0);
        const heights = [];
        for (let y = 2.5; y < limits.at(-1).y256 / 256 - 2; y += 3) {
            heights.push(y);
        }
        const shown = await page.evaluate(
            ({ atX, ys }) => {
                const { world, stage } = window.terrane;
                const { origin } = world.tiles;
                return ys.map((y) => {
                    const at = stage.camera.position.clone().set(atX - origin.x, y, -origin.z).project(stage.camera);
                    const pixel = { x: ((at.x + 1) / 2) * window.innerWidth, y: ((1 - at.y) / 2) * window.innerHeight };
                    return { ...world.cut.contentAt(atX, y, 0), pixel };
                });
            },
            { atX: x, ys: heights },
        );
        heights.forEach((y, i) => {
            const matches = (by) => {
                const expected = expectedAt(limits, (y + by) * 256, materials);
                return expected.isSolid === shown[i].isSolid &&
                    (!expected.isSolid || expected.color.every((value, c) => Math.abs(value - shown[i].color[c]) <= 3));
            };
            // A pixel is a third of a voxel, and heights are mixed with the next column's.
            let isRight = false;
            for (let by = -0.5; by <= 0.5 && !isRight; by += HEIGHT_STEP) {
                isRight = matches(by);
            }
            const expected = expectedAt(limits, y * 256, materials);
            assert.ok(isRight, `column ${x},0 at ${y}: shows ${shown[i].color}, is ${expected.main} ${expected.color.map(Math.round)}`);
            ++points;
            wouldFail += matches(12) ? 0 : 1;
            names.add(expected.main);
            const { pixel } = shown[i];
            if (expected.isSolid && pixel.x > 20 && pixel.x < 480 && pixel.y > 80 && pixel.y < 350) {
                onScreen.push({ expected: expected.color, seen: picture.at(Math.round(pixel.x), Math.round(pixel.y)) });
            }
        });
    }
    assert.ok(points > 100 && names.size >= 5, `${points} points of ${[...names]}`);
    assert.ok(wouldFail > points / 3, 'columns 12 voxels off would be noticed');
    // What is on the screen is lit and grained: light stays light and red stays red.
    assert.ok(onScreen.length > 15, `${onScreen.length} of the points are on the screen`);
    const luma = ([r, g, b]) => 0.3 * r + 0.6 * g + 0.1 * b;
    const likeness = correlation(onScreen.map(({ expected }) => luma(expected)), onScreen.map(({ seen }) => luma(seen)));
    console.log(`${points} points of ${names.size} materials; ${onScreen.length} on the screen, correlation ${likeness.toFixed(2)}`);
    assert.ok(likeness > 0.6, `the screen's light and dark correlate with the columns' by ${likeness}`);
    await page.evaluate(() => window.terrane.toggleCut());
    noFaults();
});

test('the probe tells the column that is under the cursor', async () => {
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
    assert.match(await page.locator('.probe').innerText(), /basement/);
    await look(page, 'probe');
    await page.keyboard.press('p');
    noFaults();
});

test('X-ray finds the veins and caves that are there', async () => {
    await page.keyboard.press('r');
    await until(page, () => {
        const { caves, veins } = window.terrane.sceneFigures().xray;
        return caves + veins > 500;
    });
    await look(page, 'xray');
    // What lies on the ground is kept as veins too, and would hide the real ones.
    const cover = await page.evaluate(() => {
        const { xray, hello } = window.terrane.world;
        const meadow = hello.materials.findIndex(({ name }) => name === 'meadow');
        let triangles = 0;
        for (const mesh of [...xray.shown.values()].flatMap(({ meshes }) => meshes)) {
            const { index, attributes } = mesh.geometry;
            for (let i = 0; mesh.material === xray.veins && i < index.count; i += 3) {
                const isMeadow = (corner) => attributes.tint.array[4 * index.array[i + corner] + 3] === meadow;
                triangles += isMeadow(0) && isMeadow(1) && isMeadow(2) ? 1 : 0;
            }
        }
        return triangles;
    });
    assert.equal(cover, 0, 'turf hides the veins');
    await page.keyboard.press('r');
    noFaults();
});

test('columns in place of Draco give the same ground', async () => {
    const draco = await page.evaluate(() => window.terrane.sceneFigures().triangles);
    await page.evaluate(() => {
        window.terrane.setFormat('columns');
        window.terrane.figures = undefined;
    });
    await until(page, () => window.terrane.figures?.formats.columns.chunks > 20);
    await settle(page);
    await look(page, 'columns');
    const { columns, triangles } = await page.evaluate(() => ({
        columns: window.terrane.figures.formats.columns,
        triangles: window.terrane.sceneFigures().triangles,
    }));
    assert.ok(columns.triangles > 100, 'triangles were made of columns');
    assert.ok(Math.abs(triangles - draco) < 0.1 * draco, `${triangles} triangles of columns, ${draco} of Draco`);
    await page.evaluate(() => window.terrane.setFormat('draco'));
    noFaults();
});

/** Triangles of caves and of water in the tiles around the viewer, by name; those at a rim may differ. */
function partsAround() {
    const { world, controls } = window.terrane;
    const side = world.hello.chunkSide;
    const [cx, cz] = [controls.position.x, controls.position.z].map((value) => Math.floor(value / side));
    const found = {};
    for (const { square, name, mesh, isShown } of world.tiles.tiles.values()) {
        if (isShown && square.lod === 0 && Math.max(Math.abs(square.x - cx), Math.abs(square.z - cz)) <= 1) {
            const water = mesh.children.reduce((sum, { geometry }) => sum + geometry.index.count / 3, 0);
            found[name] = { caves: (mesh.geometry.index.count - mesh.userData.cavesFirst) / 3, water };
        }
    }
    return found;
}

test('both formats have the same water and the same caves', async () => {
    await go(page, OVER_RIVER);
    const draco = await page.evaluate(partsAround);
    const ofDraco = await look(page, 'river-draco');
    await page.evaluate(() => {
        window.terrane.setFormat('columns');
        window.terrane.figures = undefined;
    });
    await until(page, () => window.terrane.figures?.formats.columns.chunks > 20);
    await settle(page);
    // Tiles may be made anew for neighbours that came late.
    await until(page, () => window.terrane.figures?.decodeQueue === 0);
    await settle(page);
    const columns = await page.evaluate(partsAround);
    const ofColumns = await look(page, 'river-columns');
    assert.deepEqual(columns, draco);
    assert.equal(Object.keys(draco).length, 9);
    const sum = (part) => Object.values(draco).reduce((total, counts) => total + counts[part], 0);
    assert.ok(sum('water') > 100 && sum('caves') > 100, JSON.stringify(draco));
    let differing = 0;
    for (let y = 100; y < 400; y += 4) {
        for (let x = 300; x < 540; x += 4) {
            const other = ofColumns.at(x, y);
            differing += ofDraco.at(x, y).some((value, i) => Math.abs(value - other[i]) > 24) ? 1 : 0;
        }
    }
    assert.ok(differing < 75 * 60 * 0.05, `${differing} of ${75 * 60} pixels differ`);
    await page.evaluate(() => window.terrane.setFormat('draco'));
    noFaults();
});

test('caves can be left out', async () => {
    const drawn = () => page.evaluate(() => [...window.terrane.world.tiles.tiles.values()]
        .filter(({ mesh }) => mesh !== null)
        .reduce((sum, { mesh }) => sum + Math.min(mesh.geometry.drawRange.count, mesh.geometry.index.count), 0));
    await settle(page);
    const all = await drawn();
    const button = page.getByRole('button', { name: 'Caves' });
    await page.keyboard.press('v');
    assert.ok((await drawn()) < all);
    assert.equal(await button.getAttribute('aria-pressed'), 'false');
    await button.click();
    assert.equal(await drawn(), all);
    assert.equal(await button.getAttribute('aria-pressed'), 'true');
    await go(page, NEAR_GROUND);
    noFaults();
});

test('walking stands on the ground', async () => {
    // Where the processor draws a fall from the sky takes minutes.
    await until(page, () => {
        const { controls } = window.terrane;
        const { x, y, z } = controls.position;
        const floor = controls.ground.floorUnder(x, y, z, 1);
        controls.position.y = floor === undefined ? y : floor + 3;
        return floor !== undefined;
    });
    await page.keyboard.press('f');
    await until(page, () => {
        const { controls } = window.terrane;
        const { x, y, z } = controls.position;
        return Math.abs(y - 1.75 - controls.ground.floorUnder(x, y, z, 1)) < 0.1;
    });
    const from = await page.evaluate(() => ({ ...window.terrane.controls.position }));
    await page.keyboard.down('w');
    await until(page, ({ x, z }) => {
        const { position } = window.terrane.controls;
        return Math.hypot(position.x - x, position.z - z) > 2;
    }, from);
    await page.keyboard.up('w');
    await until(page, () => {
        const { controls } = window.terrane;
        const { x, y, z } = controls.position;
        return Math.abs(y - 1.75 - controls.ground.floorUnder(x, y, z, 1)) < 0.1;
    });
    await page.keyboard.press('f');
    noFaults();
});

test('the place is in the URL', async () => {
    await page.getByLabel('go to').fill('1200 -300');
    await page.getByLabel('go to').press('Enter');
    await until(page, () => /^#1200\.0,[0-9.]+,-300\.0,-?[0-9.]+,-[0-9.]+$/.test(location.hash));
    noFaults();
});

test('a token goes into its field, and without a place the view has water and relief', async () => {
    const folder = mkdtempSync(join(tmpdir(), 'terrane-tokens-'));
    const file = join(folder, 'tokens.toml');
    const token = execFileSync(terrane, ['token', 'new', 'visitor', '--file', file]).toString().trim().split(/\s+/).at(-1);
    const guarded = await startServer({ options: ['--store', 'memory', '--tokens', file] });
    const { page: other } = await openViewer(browser, guarded.port);
    try {
        await until(other, () => document.activeElement?.getAttribute('aria-label') === 'token');
        assert.equal(await other.evaluate(() => location.hash), '');
        await other.getByLabel('token').fill(token);
        await other.getByLabel('token').press('Enter');
        await until(other, () => document.querySelector('.dot').classList.contains('on') && location.hash !== '');
        assert.ok(!(await other.evaluate(() => location.href)).includes(token), 'the address keeps no token');
        const place = await other.evaluate(() => ({ ...window.terrane.controls.position }));
        assert.ok(Math.hypot(place.x, place.z) < 1024, JSON.stringify(place));
        await until(other, () => window.terrane.figures?.tilesWanted > 0 && window.terrane.figures.nearMissing === 0);
        const wet = await other.evaluate(() => [...window.terrane.world.tiles.tiles.values()]
            .filter(({ mesh, square }) => square.lod <= 2 && mesh?.children.length > 0).length);
        assert.ok(wet > 3, `${wet} tiles near have water`);
    } finally {
        await other.close();
        await guarded.stop();
        rmSync(folder, { recursive: true });
    }
});

test('a server that restarts is found again, and the world goes on', async () => {
    await server.stop();
    await until(page, () => document.querySelector('.dot').classList.contains('off'));
    server = await startServer({ port: server.port });
    await until(page, () => document.querySelector('.dot').classList.contains('on'));
    await page.evaluate(() => {
        window.terrane.controls.position.x += 3000;
        window.terrane.figures = undefined;
    });
    await until(page, () => window.terrane.sceneFigures().isUnderfootThere && window.terrane.figures?.underfootMissing === 0);
    // A refused connection is an error that the browser itself writes; nothing else may be.
    const others = faults.splice(0).filter((fault) => !/WebSocket connection to|ERR_CONNECTION_REFUSED|ERR_CONNECTION_RESET/.test(fault));
    assert.deepEqual(others, []);
});
