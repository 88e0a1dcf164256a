// The ground to walk on: solid spans of the columns around the viewer.
import { squareName, type Square } from 'terrane-client';

import type { Ground } from '../stream/messages';

const KEPT_MAX = 64;

export class GroundMap {
    private readonly grounds = new Map<string, Ground>();

    constructor(private readonly side: number) {}

    add(ground: Ground): void {
        const name = squareName(ground.square);
        this.grounds.delete(name);
        this.grounds.set(name, ground);
        if (this.grounds.size > KEPT_MAX) {
            this.grounds.delete(this.grounds.keys().next().value!);
        }
    }

    /** The stacks around a point, its own first. */
    squaresAround(x: number, z: number): Square[] {
        const cx = Math.floor(x / this.side);
        const cz = Math.floor(z / this.side);
        const offsets = [0, -1, 1];
        return offsets.flatMap((dz) => offsets.map((dx) => ({ lod: 0, x: cx + dx, z: cz + dz })));
    }

    /** The solid spans of a column, bottom and top by turns; undefined if it is not here. */
    spans(x: number, z: number): Float32Array | undefined {
        const ix = Math.floor(x);
        const iz = Math.floor(z);
        const cx = Math.floor(ix / this.side);
        const cz = Math.floor(iz / this.side);
        const ground = this.grounds.get(squareName({ lod: 0, x: cx, z: cz }));
        if (ground === undefined) {
            return undefined;
        }
        const column = (iz - cz * this.side) * this.side + (ix - cx * this.side);
        return ground.spans.subarray(ground.offsets[column]!, ground.offsets[column + 1]!);
    }

    /** The floor under a foot that can step up by `step`: mixed between columns, as the mesh is. */
    floorUnder(x: number, y: number, z: number, step: number): number | undefined {
        const x0 = Math.floor(x);
        const z0 = Math.floor(z);
        let sum = 0;
        for (let i = 0; i < 4; ++i) {
            const spans = this.spans(x0 + (i & 1), z0 + (i >> 1));
            if (spans === undefined) {
                return undefined;
            }
            let floor = -1;
            for (let at = 0; at < spans.length; at += 2) {
                if (spans[at]! > y + step) {
                    break;
                }
                floor = Math.min(spans[at + 1]!, y + 64);
            }
            const share = ((i & 1) !== 0 ? x - x0 : 1 - (x - x0)) * ((i >> 1) !== 0 ? z - z0 : 1 - (z - z0));
            sum += share * floor;
        }
        return sum;
    }

    /** The first bottom above a head; Infinity under the open sky. */
    ceilingOver(x: number, y: number, z: number): number {
        const spans = this.spans(Math.round(x), Math.round(z));
        for (let at = 0; spans !== undefined && at < spans.length; at += 2) {
            if (spans[at]! > y) {
                return spans[at]!;
            }
        }
        return Infinity;
    }
}
