// Frames against the examples of WIRE_FORMAT.md and against everything that is none.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { test } from 'node:test';

import { FrameSplitter, decode, parseFrame } from '../dist/index.js';
import { wantSet, distanceTo } from '../dist/want_set.js';
import { root } from './server.mjs';

/** The bytes of an example: hex at the line's begin, up to two spaces and words. */
function example(name) {
    const text = readFileSync(join(root, 'protocol/wire/WIRE_FORMAT.md'), 'utf8');
    const block = text.split('```frame ' + name + '\n')[1].split('```')[0];
    const bytes = block
        .split('\n')
        .flatMap((line) => /^((?:[0-9a-f]{2} ?)*)/.exec(line)[1].trim().split(' '))
        .filter((part) => part !== '')
        .map((part) => parseInt(part, 16));
    return Uint8Array.from(bytes);
}

test('the documented answer decodes to what the document says', () => {
    const { kind, chunk } = decode(example('Chunk'));
    assert.equal(kind, 'chunk');
    assert.deepEqual(chunk.key, { lod: 0, x: -1, y: 2, z: 3 });
    assert.equal(chunk.requestId, 7);
    assert.equal(chunk.etag, '01020304050607080910'.slice(0, 16) + '090a0b0c0d0e0f10');
    assert.deepEqual(chunk.timings, { queueUs: 0, generateUs: 1, meshUs: 2, encodeUs: 3 });
    assert.deepEqual([...chunk.payload], [0, 0x61, 0x62, 0x63]);
});

test('a stream cut anywhere gives the same frames', () => {
    const frames = [example('Chunk'), example('ChunkRequest'), example('Chunk')];
    const stream = Uint8Array.from(frames.flatMap((frame) => [...frame]));
    for (let at = 0; at <= stream.length; ++at) {
        const splitter = new FrameSplitter();
        const got = [...splitter.push(stream.slice(0, at)), ...splitter.push(stream.slice(at))];
        assert.deepEqual(got, frames);
    }
});

test('every truncation and every impossible length is refused', () => {
    const frame = example('Chunk');
    for (let bytes = 0; bytes < frame.length; ++bytes) {
        assert.throws(() => decode(frame.slice(0, bytes)));
    }
    const huge = frame.slice();
    new DataView(huge.buffer).setUint32(0, 0xffffffff, true);
    assert.throws(() => new FrameSplitter().push(huge), /length/);
    const head = frame.slice();
    new DataView(head.buffer).setUint32(4, 0x7fffffff, true);
    assert.throws(() => parseFrame(head), /head/);
});

test('the want-set tiles the plane: every column near the viewer in exactly one square', () => {
    const radius = [3, 2, 2, 2];
    for (const position of [{ x: 0, z: 0 }, { x: -517.25, z: 1234.5 }]) {
        const inner = [];
        const squares = wantSet(position, radius, 32, (square) => inner.push(square));
        for (let dz = -500; dz <= 500; dz += 97) {
            for (let dx = -500; dx <= 500; dx += 97) {
                const holders = squares.filter(
                    (square) => distanceTo(square, position.x + dx, position.z + dz, 32) === 0 &&
                        Math.floor((position.x + dx) / (32 * 2 ** square.lod)) === square.x &&
                        Math.floor((position.z + dz) / (32 * 2 ** square.lod)) === square.z,
                );
                assert.equal(holders.length, 1);
            }
        }
        const near = squares.find((square) => distanceTo(square, position.x, position.z, 32) === 0);
        assert.equal(near.lod, 0);
        assert.ok(inner.every((square) => square.lod > 0));
        assert.ok(squares.some((square) => square.lod === 3));
    }
});
