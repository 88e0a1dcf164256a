// The client against a real server: what it says of chunks, columns and meshes is what the server's own
// programs say.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';

import {
    ChunkStatus,
    ColumnRoom,
    FailureCode,
    Format,
    MaterialKind,
    MeshPart,
    PaletteKind,
    TerraneClient,
    TerraneError,
    chunksOf,
    chunksPerStack,
    compileColumns,
    keyName,
    mixAt,
    partOf,
    wantSet,
} from '../dist/index.js';
import { connectTcp } from '../dist/tcp.js';
import { basin, canyon, startServer, terrane, terraneClient } from './server.mjs';

let server;
let client;
let module;
before(async () => {
    server = await startServer();
    client = await TerraneClient.connect(await connectTcp({ port: server.port }), { name: 'test' });
    module = await compileColumns();
});
after(async () => {
    client?.close();
    await server?.stop();
});

/** A room with the stacks around (x, z). */
async function roomAround(x, z, lod = 0, own = client) {
    const room = await ColumnRoom.open(module, own.hello);
    for (let dz = -1; dz <= 1; ++dz) {
        for (let dx = -1; dx <= 1; ++dx) {
            const square = { lod, x: x + dx, z: z + dz };
            const chunks = await own.requestChunks(chunksOf(square, own.hello), {
                format: Format.Columns,
            });
            const complete = chunks.map((chunk) => room.put(chunk));
            assert.equal(complete.filter(Boolean).length, 1, 'complete with the last chunk only');
        }
    }
    return room;
}

function columnOfProgram(x, z) {
    const output = execFileSync(terrane, ['column', '--world', basin, `--at=${x},${z}`, '--json']);
    return JSON.parse(output.toString()).limits;
}

test('the greeting names the world', () => {
    assert.equal(client.hello.worldName, 'basin');
    assert.equal(client.hello.chunkSide, 32);
    assert.match(client.hello.fingerprint, /^[0-9a-f]{32}$/);
    assert.ok(client.hello.materials.some(({ name, color }) => name === 'gold' && color === 0xf6c62c));
    assert.equal(client.hello.materials[0].solid, false);
    assert.equal(client.hello.materials[0].kind, MaterialKind.Void);
    assert.equal(client.hello.meshParts, false);
});

test('a request is answered once a key, in chunks that say what they are', async () => {
    const keys = [];
    for (let y = 0; y < 10; ++y) {
        for (let x = -4; x < 4; ++x) {
            keys.push({ lod: 0, x, y, z: 3 });
        }
    }
    const seen = [];
    const chunks = await client.requestChunks(keys, {
        format: Format.Draco,
        onChunk: (chunk) => seen.push(chunk),
    });
    assert.deepEqual(seen, chunks);
    assert.deepEqual(chunks.map(({ key }) => keyName(key)).sort(), keys.map(keyName).sort());
    const full = chunks.filter(({ status }) => status === ChunkStatus.Full);
    assert.ok(full.length >= 8);
    for (const { payload, etag } of full) {
        assert.equal(new TextDecoder().decode(payload.subarray(0, 5)), 'DRACO');
        assert.match(etag, /^[0-9a-f]{32}$/);
    }
    const again = await client.requestChunks(full.map(({ key }) => key), {
        format: Format.Draco,
        knownEtags: full.map(({ etag }) => etag),
    });
    assert.ok(again.every(({ status }) => status === ChunkStatus.NotModified));
});

test('a chunk that cannot be is refused with the code and the session goes on', async () => {
    await assert.rejects(
        client.requestChunks([{ lod: 99, x: 0, y: 0, z: 0 }], { format: Format.Draco }),
        (error) => error instanceof TerraneError && error.code !== FailureCode.None,
    );
    assert.ok((await client.ping()) >= 0);
});

test('a request that is cancelled says so', async () => {
    const stop = new AbortController();
    const keys = Array.from({ length: 3000 }, (_, x) => ({ lod: 0, x: x + 5000, y: 5, z: 7 }));
    const asked = client.requestChunks(keys, { format: Format.Draco, signal: stop.signal });
    stop.abort();
    await assert.rejects(asked, (error) => error.code === FailureCode.Cancelled);
    assert.equal((await client.requestChunk({ lod: 0, x: 0, y: 0, z: 0 }, Format.Columns)).key.x, 0);
});

test('column queries give what `terrane column` gives', async () => {
    for (const [x, z] of [[12, -7], [-1, -1], [1000000, -2000000]]) {
        const { limits } = await client.queryColumn(x, z);
        const expected = columnOfProgram(x, z);
        assert.equal(limits.length, expected.length);
        limits.forEach(({ y256, flow, composition }, i) => {
            assert.equal(y256, expected[i].y256);
            assert.deepEqual(flow, expected[i].flow);
            const named = composition.map(({ material, concentration }) => [
                client.hello.materials[material].name,
                concentration,
            ]);
            assert.deepEqual(Object.fromEntries(named), expected[i].composition);
        });
    }
});

test('columns put together from chunks give the materials of `terrane column`', async () => {
    const room = await roomAround(0, -1);
    for (const [x, z] of [[12, -7], [0, -1], [31, -32], [-5, -40], [63, 31]]) {
        const limits = room.columnLimits(x, z);
        const expected = columnOfProgram(x, z);
        const top = expected.at(-1).y256;
        for (let y256 = 64; y256 < top + 512; y256 += 96) {
            const names = (shares) =>
                shares
                    .map(({ material, concentration }) => [
                        client.hello.materials[material].name,
                        Math.round(concentration * 1e6),
                    ])
                    .sort();
            const plain = expected.map(({ y256: height, flow, composition }) => ({
                y256: height,
                flow,
                composition: Object.entries(composition).map(([name, concentration]) => ({
                    material: client.hello.materials.findIndex((material) => material.name === name),
                    concentration,
                })),
            }));
            assert.deepEqual(
                names(mixAt(limits, y256).shares),
                names(mixAt(plain, y256).shares),
                `column ${x},${z} at ${y256 / 256}`,
            );
        }
    }
});

function objOf(key, port) {
    const folder = mkdtempSync(join(tmpdir(), 'terrane-'));
    try {
        execFileSync(terraneClient, [
            'get', `--server=127.0.0.1:${port}`, `--at=${key.x},${key.y},${key.z}`,
            `--lod=${key.lod}`, '--obj', '-o', folder,
        ]);
        const text = readFileSync(join(folder, `${key.lod}_${key.x}_${key.y}_${key.z}.obj`), 'utf8');
        return text.split('\n');
    } finally {
        rmSync(folder, { recursive: true });
    }
}

/** Triangles as sorted strings of their corners, in 1/32 voxel. */
function trianglesOf(corner, indices) {
    const triangles = [];
    for (let i = 0; i < indices.length; i += 3) {
        const corners = [0, 1, 2].map((at) => corner(indices[i + at]));
        const turns = [0, 1, 2].map((first) => [0, 1, 2].map((at) => corners[(first + at) % 3]).join(' '));
        triangles.push(turns.sort()[0]);
    }
    return triangles.sort();
}

/** Compares the meshes of stack (x, z) of two levels; gives the triangles by part. */
async function compareMeshes(own, port, x, z) {
    const parts = [0, 0, 0];
    for (const lod of [0, 2]) {
        const room = await roomAround(x, z, lod, own);
        const square = { lod, x, z };
        let compared = 0;
        for (let y = 0; y < chunksPerStack(own.hello, lod); ++y) {
            const key = { ...square, y };
            const chunk = await own.requestChunk(key, Format.Draco);
            const heights = lod === 0 ? { first: y * 32, last: (y + 1) * 32 } : undefined;
            const mesh = room.mesh(square, 'surface', heights);
            if (chunk.status !== ChunkStatus.Full) {
                assert.equal(mesh.indices.length, 0);
                continue;
            }
            const lines = objOf(key, port);
            const obj = lines.filter((line) => line.startsWith('v ')).map((line) => line.split(' ').slice(1, 4).map(Number));
            const faces = lines
                .filter((line) => line.startsWith('f '))
                .flatMap((line) => line.trim().split(' ').slice(1).map((part) => parseInt(part, 10) - 1));
            const scale = 2 ** lod;
            const base = [x * 32, y * 32, z * 32].map((value, axis) => (axis === 1 ? value : value * scale));
            const shared = (...place) => place.map((value) => Math.round(value * 32)).join(',');
            const sent = trianglesOf((i) => {
                const [vx, vy, vz] = obj[i];
                return shared((vx - base[0]) / scale, vy - base[1], (vz - base[2]) / scale);
            }, faces);
            const p = mesh.positions;
            const made = trianglesOf((i) => shared(p[3 * i], p[3 * i + 1], p[3 * i + 2]), mesh.indices);
            assert.equal(made.length, sent.length);
            assert.deepEqual(made, sent, `chunk ${keyName(key)}`);
            compared += made.length;
            made.forEach((_, i) => ++parts[partOf(mesh, i)]);
        }
        assert.ok(compared > 1000, `${compared} triangles`);
    }
    return parts;
}

test('meshes made of columns are the meshes that the server sends', async () => {
    const parts = await compareMeshes(client, server.port, 0, -1);
    assert.deepEqual(parts.slice(1), [0, 0], 'this world has neither water nor connected caves');
});

test('those of a landscape too, with its water and its caves', async () => {
    const other = await startServer(canyon);
    const own = await TerraneClient.connect(await connectTcp({ port: other.port }), { name: 'canyon test' });
    try {
        assert.equal(own.hello.meshParts, true);
        assert.ok(own.hello.materials.some(({ kind, solid }) => kind === MaterialKind.Water && !solid));
        const parts = await compareMeshes(own, other.port, -2, -8);
        assert.ok(parts[MeshPart.Cave] > 0 && parts[MeshPart.Water] > 0, `triangles by part: ${parts}`);
    } finally {
        own.close();
        await other.stop();
    }
});

test('a cut shows the materials of its columns', async () => {
    const room = await roomAround(0, -1);
    // One column a pixel: the line runs through x + 1/2 - 1/2 at z = -7.
    const pixels = room.section({ x0: -0.5, z0: -7, x1: 31.5, z1: -7, y0: 0, y1: 256, width: 32, height: 256 });
    for (const x of [0, 12, 31]) {
        const limits = room.columnLimits(x, -7);
        for (let y = 0; y < 256; ++y) {
            const { shares } = mixAt(limits, y * 256 + 128);
            const at = 4 * (y * 32 + x);
            const most = Math.max(...shares.map(({ concentration }) => concentration));
            const shown = shares.find(({ material }) => material === pixels.contents[at]);
            assert.ok(shown && shown.concentration > most - 0.02, `column ${x},-7 at ${y}`);
            const isHollow = pixels.contents[at + 1] === PaletteKind.Void + 1;
            assert.equal(pixels.colors[at + 3], isHollow || pixels.contents[at + 1] === PaletteKind.Cave + 1 ? 0 : 255);
        }
    }
});

test('a view sends its whole want-set, credited as it is consumed, and forgets what it leaves', async () => {
    const own = await TerraneClient.connect(await connectTcp({ port: server.port }), { name: 'view test' });
    assert.equal(own.hasViews, true);
    const came = new Set();
    const forgotten = new Set();
    let bytes = 0;
    let full;
    own.onViewChunk = async (chunk) => {
        await new Promise((resolve) => setTimeout(resolve, 1));
        came.add(keyName(chunk.key));
        bytes += chunk.payload.byteLength;
        full?.();
    };
    own.onForget = (keys) => keys.forEach((key) => forgotten.add(keyName(key)));
    const radiusChunks = [3, 2, 2];
    const look = async (position) => {
        const wanted = wantSet(position, radiusChunks, own.hello.chunkSide)
            .flatMap((square) => chunksOf(square, own.hello))
            .map(keyName);
        own.updateView({
            position,
            direction: { x: 1, y: 0, z: 0 },
            velocity: { x: 0, y: 0, z: 0 },
            radiusChunks,
            format: Format.Draco,
        });
        while (!wanted.every((name) => came.has(name))) {
            await new Promise((resolve) => (full = resolve));
        }
        return wanted;
    };
    const first = await look({ x: 100, y: 200, z: -300 });
    assert.deepEqual([...came].sort(), first.sort());
    assert.ok(bytes > own.hello.limits.creditWindowBytes, `${bytes} bytes are more than one window`);
    await look({ x: 100_000, y: 200, z: -300 });
    assert.ok(first.every((name) => forgotten.has(name)));
    own.close();
});

test('broken columns are refused with a reason', async () => {
    const room = await ColumnRoom.open(module, client.hello);
    const chunk = await client.requestChunk({ lod: 0, x: 0, y: 3, z: 0 }, Format.Columns);
    assert.equal(chunk.status, ChunkStatus.Full);
    const cut = { ...chunk, payload: chunk.payload.slice(0, chunk.payload.length - 7) };
    assert.throws(() => room.put(cut), Error);
    assert.throws(() => room.put({ ...chunk, payload: Uint8Array.of(9, 1, 2) }), /unknown tag 9/);
    assert.throws(() => room.put({ ...chunk, payload: Uint8Array.of(0, 1, 1, 1, 255) }), Error);
    assert.equal(room.put(chunk), false);
});
