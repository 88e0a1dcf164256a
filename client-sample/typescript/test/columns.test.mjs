// Columns and their meshes out of tests/data/column_meshes.json, which the C++ client's test reads too:
// what the WebAssembly makes of the columns is what the server's mesher made of the whole stacks.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { test } from 'node:test';

import { ChunkStatus, ColumnRoom, Format, MaterialKind, MeshPart, compileColumns, partOf } from '../dist/index.js';
import { root } from './server.mjs';

const vectors = JSON.parse(readFileSync(join(root, 'tests/data/column_meshes.json'), 'utf8'));
const keyOf = ([lod, x, y, z]) => ({ lod, x, y, z });

const hello = {
    chunkSide: vectors.world.chunk_side,
    chunkHeight: vectors.world.chunk_height,
    heightBoundVoxels: vectors.world.height_bound_voxels,
    meshParts: vectors.world.mesh_parts,
    materials: vectors.world.materials.map(({ color, kind }) => ({
        name: '',
        color,
        texture: '',
        solid: ![MaterialKind.Void, MaterialKind.Cave, MaterialKind.Water].includes(kind),
        kind,
    })),
};

async function filledRoom(world) {
    const room = await ColumnRoom.open(await compileColumns(), world);
    for (const { key, uniform, chunk } of vectors.chunks) {
        room.put({
            key: keyOf(key),
            format: Format.Columns,
            status: uniform === undefined ? ChunkStatus.Full : ChunkStatus.Uniform,
            uniform: (uniform ?? []).map(([material, concentration]) => ({ material, concentration })),
            // The tag in front says that it is plain.
            payload: Buffer.from(`00${chunk ?? ''}`, 'hex'),
        });
    }
    return room;
}

/** FNV-1a over the bytes of arrays, one behind the other. */
function hashOf(arrays) {
    let hash = 2166136261;
    for (const array of arrays) {
        for (const byte of new Uint8Array(array.buffer, array.byteOffset, array.byteLength)) {
            hash = Math.imul(hash ^ byte, 16777619);
        }
    }
    return hash >>> 0;
}

function meshOf(room, { lod, x, y, z }) {
    const { chunkHeight } = hello;
    const heights = lod === 0 ? { first: y * chunkHeight, last: (y + 1) * chunkHeight } : undefined;
    return room.mesh({ lod, x, z }, 'surface', heights);
}

test('meshes made of columns are those of the file, bit for bit', async () => {
    const room = await filledRoom(hello);
    const seen = [0, 0, 0];
    for (const { key, vertices, triangles, hash } of vectors.meshes) {
        const mesh = meshOf(room, keyOf(key));
        const parts = mesh.parts ?? new Uint8Array(vertices);
        const made = [0, 0, 0];
        for (let i = 0; i < mesh.indices.length / 3; ++i) {
            ++made[partOf(mesh, i)];
        }
        assert.equal(mesh.materials.length, vertices, `chunk ${key}`);
        assert.deepEqual(made, triangles, `chunk ${key}`);
        const positions256 = Int32Array.from(mesh.positions, (value) => value * 256);
        assert.equal(
            hashOf([positions256, mesh.normals, mesh.colors, mesh.materials, parts, mesh.indices]),
            hash,
            `chunk ${key}`,
        );
        triangles.forEach((count, part) => (seen[part] += count));
    }
    assert.ok(Math.min(...seen) > 10, `triangles by part: ${seen}`);
});

test('a world without parts has meshes of ground alone, but for its water', async () => {
    const room = await filledRoom({ ...hello, meshParts: false });
    for (const { key, triangles } of vectors.meshes) {
        const mesh = meshOf(room, keyOf(key));
        assert.equal(mesh.indices.length / 3, triangles.reduce((sum, count) => sum + count));
        assert.ok(mesh.parts === undefined || !mesh.parts.includes(MeshPart.Cave));
    }
});

test('caves by themselves have no parts', async () => {
    const room = await filledRoom(hello);
    const [, x, , z] = vectors.meshes[0].key;
    const caves = room.mesh({ lod: 0, x, z }, 'caves', { first: 1, last: 4000 });
    assert.equal(caves.parts, undefined);
    assert.ok(caves.indices.length > 0);
});
