// Terrane's 3D Tiles in the programs that others use. One line a check; exit code 1 if any failed.
//
//     node run.mjs TERRANE WORLDS [--all] [--world NAME]...
//         the program, the folder of the shipped worlds, and which of them
//
// Quick: every kind of tile of one world through gltf-validator, three + 3d-tiles-renderer and
// loaders.gl (its loaders, and its Tileset3D). `--all`: more worlds, and CesiumJS too. Screenshots are left in ./screenshots.
import { mkdir } from 'node:fs/promises';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { startPages, startTerrane } from './server.mjs';
import { validateTiles } from './glb_valid.mjs';
import { walkExplicit } from './loaders_gl.mjs';
import { traverse } from './tileset3d.mjs';
import { makePages, openBrowser, see } from './pages.mjs';

const [program, worlds, ...flags] = process.argv.slice(2);
const all = flags.includes('--all');
const named = flags.flatMap((flag, i) => (flags[i - 1] === '--world' ? [flag] : []));
if (!program || !worlds || flags.some((flag, i) =>
    flag !== '--all' && flag !== '--world' && flags[i - 1] !== '--world')) {
    console.error('usage: node run.mjs TERRANE WORLDS [--all] [--world NAME]...');
    process.exit(2);
}
const here = dirname(fileURLToPath(import.meta.url));
const shots = join(here, 'screenshots');
const out = join(here, 'pages');
let passed = 0;
let failed = 0;

async function check(name, work) {
    const begin = Date.now();
    try {
        const said = await work();
        ++passed;
        console.log(`ok   ${name} (${((Date.now() - begin) / 1000).toFixed(1)} s): ${said}`);
    } catch (error) {
        ++failed;
        console.log(`FAIL ${name}: ${error?.stack ?? error}`);
    }
}

function expect(condition, what) {
    if (!condition) {
        throw new Error(what);
    }
}

/** The quadtree's tile that is stack (x, z) at a level of detail. */
function tilePath(levels, lod, x, z) {
    const level = levels - 1 - lod;
    const half = 2 ** (level - 1);
    return `/3dtiles/content/${level}/${x + half}/${half - 1 - z}.glb`;
}

/** Every kind of tile and chunk: the root, height fields, volumes, empty and uniform ones. */
function kindsOf(world) {
    const levels = world.levels;
    const top = Math.ceil(world.bounds.height_voxels / world.chunk_height_voxels);
    const kinds = [['the root', '/3dtiles/content/0/0/0.glb']];
    for (const lod of [16, 9, 3, 2, 1]) {
        kinds.push([`a height field at level ${lod}`, tilePath(levels, lod, -1, 0)]);
    }
    for (const [x, z] of [[0, 0], [-1, -1], [7, -12], [2000, -3000]]) {
        kinds.push([`the volume at ${x}, ${z}`, tilePath(levels, 0, x, z)]);
    }
    for (let y = -1; y <= top; ++y) {
        kinds.push([`the chunk at height ${y}`, `/chunks/0/3/${y}/-2.glb`]);
    }
    kinds.push(['a chunk at level 2', '/chunks/2/3/0/-2.glb']);
    return kinds;
}

/** Looks from above (0, 0) to the north, so steeply that only ground can be seen. z is up. */
async function viewOf(terrane, pitchDegrees, aboveM) {
    const column = await (await fetch(`${terrane.content}/columns/0/0.json`)).json();
    const top = column.limits.at(-1).y256 / 256 * terrane.world.voxel_size_m;
    const eye = [0, 0, top + aboveM];
    const pitch = pitchDegrees * Math.PI / 180;
    return { eye, look: [eye[0] + 40, eye[1] + 1000 * Math.cos(pitch), eye[2] - 1000 * Math.sin(pitch)] };
}

function query(values) {
    return new URLSearchParams(values).toString();
}

/** What every client must have seen. */
function expectGround(state) {
    expect(state.errors.length === 0, JSON.stringify(state.errors.slice(0, 8), null, 1));
    expect(state.done, 'the page never came to rest');
    expect(state.visible >= 10, `only ${state.visible} tiles are visible`);
    expect(state.levels.length >= 3, `only levels ${state.levels}`);
    expect(state.holes === 0, `${state.holes} pixels show no ground`);
    expect(state.holesWithoutTiles === 800 * 600,
        `holes would not be seen: ${state.holesWithoutTiles} pixels without tiles`);
    return `${state.visible} tiles of levels ${state.levels.join(',')}, 0 errors, 0 hole pixels`;
}

async function checkWorld(name, browser, pages) {
    const terrane = await startTerrane(program, join(worlds, `${name}.toml`));
    try {
        await check(`${name}: gltf-validator`, async () => {
            const seen = await validateTiles(terrane, kindsOf(terrane.world));
            expect(seen.some((line) => line.includes('uniform')), 'no chunk was uniform');
            return `${seen.length} kinds, 0 errors, 0 warnings`;
        });
        const view = await viewOf(terrane, 30, 150);
        const eye = view.eye.join();
        const look = view.look.join();
        const voxel = terrane.world.voxel_size_m;
        await check(`${name}: three + 3d-tiles-renderer`, async () => {
            const tileset = `${terrane.content}/3dtiles/tileset.json`;
            const state = await see(browser, `${pages}/three.html?${query({ tileset, eye, look, voxel })}`,
                join(shots, `${name}-three.png`));
            return expectGround(state);
        });
        await check(`${name}: loaders.gl, explicit tilesets`, async () => {
            const seen = await walkExplicit(`${terrane.content}/3dtiles/explicit/tileset.json`,
                view.eye, { errorTarget: 12, tilesMax: 60 });
            expect(seen.documents >= 6, `only ${seen.documents} documents`);
            expect(seen.levels.size >= 4, `only levels ${[...seen.levels]}`);
            expect(seen.tiles >= 20 && seen.triangles > 10000, JSON.stringify(seen));
            return `${seen.tiles} of ${seen.wanted} tiles of levels `
                + `${[...seen.levels].sort((a, b) => a - b)}, ${seen.triangles} triangles`;
        });
        await check(`${name}: loaders.gl, Tileset3D`, async () => {
            const state = await traverse(`${terrane.content}/3dtiles/explicit/tileset-geo.json`, view,
                { errorTarget: 12, roundsMax: 4000 });
            expect(state.errors.length === 0, JSON.stringify(state.errors.slice(0, 8), null, 1));
            expect(state.done, `no rest after ${state.rounds} traversals`);
            expect(state.visible >= 10, `only ${state.visible} tiles are visible`);
            expect(state.levels.length >= 4, `only levels ${state.levels}`);
            expect(state.levels.includes(terrane.world.levels - 1), 'no volume is underfoot');
            expect(state.overlaps === 0, `${state.overlaps} tiles are shown beside their parents`);
            expect(state.uncovered === 0, `${state.uncovered} points of the ground have no tile`);
            expect(state.draco && state.vertices > 10000, `${state.vertices} vertices`);
            // Lazy: of 4^17 tiles it has heard of those on the way only.
            expect(state.headers < 50000, `${state.headers} tiles are known`);
            return `${state.visible} tiles visible of levels ${state.levels.join(',')}, `
                + `${state.documents} documents, ${state.headers} tiles known, 0 errors`;
        });
        if (all) {
            await check(`${name}: Cesium`, async () => {
                const tileset = `${terrane.content}/3dtiles/tileset-geo.json`;
                const state = await see(browser,
                    `${pages}/cesium.html?${query({ tileset, eye, look, voxel })}`,
                    join(shots, `${name}-cesium.png`), 240000);
                return expectGround(state);
            });
        }
    } finally {
        await terrane.stop();
    }
}

await mkdir(shots, { recursive: true });
await makePages(here, out);
const pages = await startPages({
    '/cesium/': join(here, 'node_modules/cesium/Build/Cesium'), '/': out,
});
const browser = await openBrowser();
try {
    const names = all ? ['basin', 'alpine', 'paper-B3'] : ['basin'];
    for (const name of named.length > 0 ? named : names) {
        await checkWorld(name, browser, pages.origin);
    }
} finally {
    await browser.close();
    await pages.stop();
}
console.log(`${passed} passed, ${failed} failed`);
process.exit(failed === 0 ? 0 : 1);
