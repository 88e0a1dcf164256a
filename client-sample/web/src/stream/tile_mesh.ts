// Decoded meshes to what the GPU takes: one mesh a tile, small attributes, short indices where they do;
// ground, caves and water behind one another.
import { MeshPart, partOf, type Material, type TerrainMesh } from 'terrane-client';

import { surfaceOf, type Surface } from '../scene/surfaces';
import type { TileMesh } from './messages';

/** A piece of a tile: `y` is its floor in voxels. */
export type Piece = TerrainMesh & { y: number };

const DEPTH_UNITS_PER_VOXEL = 8;
/** Ground that stands so much higher than water is over it, not its shore. */
const OVER_WATER = 3;
const ON_SIDE = 1 / 256;

export function surfacesOf(materials: Material[]): Surface[] {
    return materials.map(surfaceOf);
}

/** Null if there is no triangle. */
export function joinPieces(pieces: Piece[], surfaces: Surface[]): TileMesh | null {
    const vertices = pieces.reduce((sum, piece) => sum + piece.materials.length, 0);
    const corners = pieces.reduce((sum, piece) => sum + piece.indices.length, 0);
    if (corners === 0) {
        return null;
    }
    const positions = new Float32Array(vertices * 3);
    const normals = new Int8Array(vertices * 4);
    const colors = new Uint8Array(vertices * 4);
    const shown = new Uint8Array(vertices * 4);
    const water: number[] = [];
    let lowest = Infinity;
    let highest = -Infinity;
    let vertex = 0;
    for (const piece of pieces) {
        for (let i = 0; i < piece.materials.length; ++i, ++vertex) {
            const y = piece.positions[3 * i + 1]! + piece.y;
            positions[3 * vertex] = piece.positions[3 * i]!;
            positions[3 * vertex + 1] = y;
            positions[3 * vertex + 2] = piece.positions[3 * i + 2]!;
            lowest = Math.min(lowest, y);
            highest = Math.max(highest, y);
            for (let axis = 0; axis < 3; ++axis) {
                normals[4 * vertex + axis] = Math.round(piece.normals[3 * i + axis]! * 127);
                colors[4 * vertex + axis] = piece.colors[3 * i + axis]!;
            }
            const material = piece.materials[i]!;
            colors[4 * vertex + 3] = material;
            shown.set(surfaces[material] ?? [0, 0, 0, 0], 4 * vertex);
            if (piece.parts?.[i] === MeshPart.Water) {
                water.push(vertex);
            }
        }
    }
    if (water.length > 0) {
        setDepths(shown, positions, water);
    }
    const { indices, firsts } = indicesByPart(pieces, vertices, corners);
    return {
        positions, normals, colors, surfaces: shown, indices, lowest, highest,
        cavesFirst: firsts[MeshPart.Cave]!, waterFirst: firsts[MeshPart.Water]!,
    };
}

function indicesByPart(pieces: Piece[], vertices: number, corners: number) {
    const counts = [0, 0, 0];
    const partsOfPieces = pieces.map((piece) => {
        const parts = new Uint8Array(piece.indices.length / 3);
        for (let i = 0; i < parts.length; ++i) {
            parts[i] = partOf(piece, i);
            counts[parts[i]!]! += 3;
        }
        return parts;
    });
    const firsts = [0, counts[0]!, counts[0]! + counts[1]!];
    const next = [...firsts];
    const indices = vertices <= 0xffff ? new Uint16Array(corners) : new Uint32Array(corners);
    let first = 0;
    pieces.forEach((piece, at) => {
        const parts = partsOfPieces[at]!;
        for (let i = 0; i < piece.indices.length; ++i) {
            const part = parts[Math.floor(i / 3)]!;
            indices[next[part]!++] = piece.indices[i]! + first;
        }
        first += piece.materials.length;
    });
    return { indices, firsts };
}

/** How deep the water is under each of its vertices: its level less the bed around, column by column. On
 * a tile's sides only what lies on the side counts, which the next tile has too: they agree there. */
function setDepths(shown: Uint8Array, positions: Float32Array, water: number[]): void {
    let side = 0;
    for (let at = 0; at < positions.length; at += 3) {
        side = Math.max(side, positions[at]!, positions[at + 2]!);
    }
    const last = Math.round(side);
    const width = last + 1;
    const columnOf = (place: number) =>
        place <= ON_SIDE ? 0 : place >= last - ON_SIDE ? last : Math.min(Math.max(Math.round(place), 1), last - 1);
    const cellOf = (vertex: number) => columnOf(positions[3 * vertex]!) + width * columnOf(positions[3 * vertex + 2]!);
    const level = new Float32Array(width * width).fill(-Infinity);
    const isWater = new Uint8Array(positions.length / 3);
    for (const vertex of water) {
        const cell = cellOf(vertex);
        level[cell] = Math.max(level[cell]!, positions[3 * vertex + 1]!);
        isWater[vertex] = 1;
    }
    const bed = new Float32Array(width * width).fill(-Infinity);
    for (let vertex = 0; vertex < isWater.length; ++vertex) {
        const cell = cellOf(vertex);
        const y = positions[3 * vertex + 1]!;
        if (isWater[vertex] === 0 && y < level[cell]! + OVER_WATER) {
            bed[cell] = Math.max(bed[cell]!, Math.min(y, level[cell]!));
        }
    }
    for (const vertex of water) {
        const cell = cellOf(vertex);
        const x = cell % width;
        const z = Math.floor(cell / width);
        let sum = 0;
        let count = 0;
        for (let i = 0; i < 9; ++i) {
            const isOnSide = (column: number) => column === 0 || column === last;
            const cx = x + (isOnSide(x) ? 0 : (i % 3) - 1);
            const cz = z + (isOnSide(z) ? 0 : Math.floor(i / 3) - 1);
            const under = bed[cx + width * cz]!;
            if (under > -Infinity) {
                sum += under;
                ++count;
            }
        }
        const depth = count > 0 ? positions[3 * vertex + 1]! - sum / count : Infinity;
        shown[4 * vertex] = Math.min(Math.max(depth * DEPTH_UNITS_PER_VOXEL, 0), 255);
    }
}

export function buffersOf(mesh: TileMesh | null): Transferable[] {
    return mesh === null
        ? []
        : [mesh.positions, mesh.normals, mesh.colors, mesh.surfaces, mesh.indices].map((part) => part.buffer as ArrayBuffer);
}
