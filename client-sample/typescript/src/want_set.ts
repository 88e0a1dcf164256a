// What a view wants: the quadtree of terrane.fbs, ViewUpdate. The same on both sides of the wire.
import type { ChunkKey, ServerHello } from './messages.js';

/** A square of the plane at a level: one chunk stack. */
export interface Square {
    lod: number;
    x: number;
    z: number;
}

export function squareName(square: Square): string {
    return `${square.lod}/${square.x}/${square.z}`;
}

/** The larger of |dx| and |dz| from the viewer to the square, in voxels; 0 inside. */
export function distanceTo(square: Square, x: number, z: number, chunkSide: number): number {
    const side = chunkSide * 2 ** square.lod;
    const dx = Math.max(square.x * side - x, x - (square.x + 1) * side, 0);
    const dz = Math.max(square.z * side - z, z - (square.z + 1) * side, 0);
    return Math.max(dx, dz);
}

/** The leaves of the view's quadtree, nearest first. Where squares are split, `inner` is told. */
export function wantSet(
    position: { x: number; z: number },
    radiusChunks: number[],
    chunkSide: number,
    inner?: (square: Square) => void,
): Square[] {
    const leaves: { square: Square; distance: number }[] = [];
    const top = radiusChunks.length - 1;
    if (top < 0) {
        return [];
    }
    const { x, z } = position;
    const visit = (square: Square) => {
        const distance = distanceTo(square, x, z, chunkSide);
        const finer = square.lod - 1;
        if (finer < 0 || distance >= radiusChunks[finer]! * chunkSide * 2 ** finer) {
            leaves.push({ square, distance });
            return;
        }
        inner?.(square);
        for (let i = 0; i < 4; ++i) {
            visit({ lod: finer, x: square.x * 2 + (i & 1), z: square.z * 2 + (i >> 1) });
        }
    };
    const side = chunkSide * 2 ** top;
    const reach = radiusChunks[top]! * side;
    for (let rootZ = Math.floor((z - reach) / side); rootZ <= Math.floor((z + reach) / side); ++rootZ) {
        for (let rootX = Math.floor((x - reach) / side); rootX <= Math.floor((x + reach) / side); ++rootX) {
            const root = { lod: top, x: rootX, z: rootZ };
            if (distanceTo(root, x, z, chunkSide) <= reach) {
                visit(root);
            }
        }
    }
    leaves.sort((a, b) => a.distance - b.distance || a.square.lod - b.square.lod);
    return leaves.map((leaf) => leaf.square);
}

/** Chunks that a stack of level 0 has above the ground; one at other levels. */
export function chunksPerStack(hello: ServerHello, lod: number): number {
    return lod > 0 ? 1 : Math.floor(hello.heightBoundVoxels / hello.chunkHeight) + 1;
}

/** The chunks that a leaf stands for, lowest first. */
export function chunksOf(square: Square, hello: ServerHello): ChunkKey[] {
    const keys = [];
    for (let y = 0; y < chunksPerStack(hello, square.lod); ++y) {
        keys.push({ lod: square.lod, x: square.x, y, z: square.z });
    }
    return keys;
}
