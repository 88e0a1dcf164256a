// The npm package as its users have it: packed, installed in a fresh folder, used under Node.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';

import { demo, root, startServer, terrane } from './harness.mjs';

const PROGRAM = `
import { ColumnRoom, Format, TerraneClient, chunksOf, compileColumns } from 'terrane-client';
import { connectTcp } from 'terrane-client/tcp';

const client = await TerraneClient.connect(await connectTcp({ port: Number(process.argv[2]) }));
const { hello } = client;
const column = await client.queryColumn(12, -7);
const square = { lod: 0, x: 0, z: 0 };
const room = await ColumnRoom.open(await compileColumns(), hello);
await client.requestChunks(chunksOf(square, hello), { format: Format.Columns, onChunk: (chunk) => room.put(chunk) });
const { positions, indices } = room.mesh(square);
console.log(JSON.stringify({
    world: hello.worldName, heights: column.limits.map(({ y256 }) => y256),
    vertices: positions.length / 3, triangles: indices.length / 3,
}));
client.close();
`;

test('the packed package streams, queries and meshes under Node', async () => {
    const folder = mkdtempSync(join(tmpdir(), 'terrane-package-'));
    const server = await startServer();
    try {
        const source = join(root, 'client-sample/typescript');
        const run = (command, parts, cwd) => execFileSync(command, parts, { cwd, encoding: 'utf8' });
        run('npm', ['pack', '--silent', '--pack-destination', folder], source);
        const [tarball] = readdirSync(folder).filter((name) => name.endsWith('.tgz'));
        writeFileSync(join(folder, 'package.json'), '{ "name": "fresh", "private": true, "type": "module" }');
        run('npm', ['install', '--silent', '--no-audit', '--no-fund', join(folder, tarball)], folder);
        writeFileSync(join(folder, 'game.mjs'), PROGRAM);
        const seen = JSON.parse(run('node', ['game.mjs', String(server.tcpPort)], folder));
        assert.equal(seen.world, 'canyon');
        const expected = JSON.parse(run(terrane, ['column', '--world', demo, '--at=12,-7', '--json']));
        assert.deepEqual(seen.heights, expected.limits.map(({ y256 }) => y256));
        assert.ok(seen.triangles > 1000 && seen.vertices > 500, JSON.stringify(seen));
    } finally {
        await server.stop();
        rmSync(folder, { recursive: true });
    }
});
