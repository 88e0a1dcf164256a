// Decoded meshes to what the GPU takes: one mesh a tile, small attributes, short indices where they do.
import type { Material } from 'terrane-client';

import { surfaceOf, type Surface } from '../scene/surfaces';
import type { TileMesh } from './messages';

/** A part of a tile: `y` is its floor in voxels. */
export interface MeshPart {
    y: number;
    positions: Float32Array;
    normals: Float32Array;
    colors: Uint8Array;
    materials: Uint8Array;
    indices: Uint32Array;
}

export function surfacesOf(materials: Material[]): Surface[] {
    return materials.map(surfaceOf);
}

/** Null if there is no triangle. */
export function joinParts(parts: MeshPart[], surfaces: Surface[]): TileMesh | null {
    const vertices = parts.reduce((sum, part) => sum + part.materials.length, 0);
    const corners = parts.reduce((sum, part) => sum + part.indices.length, 0);
    if (corners === 0) {
        return null;
    }
    const positions = new Float32Array(vertices * 3);
    const normals = new Int8Array(vertices * 4);
    const colors = new Uint8Array(vertices * 4);
    const shown = new Uint8Array(vertices * 4);
    const indices = vertices <= 0xffff ? new Uint16Array(corners) : new Uint32Array(corners);
    let lowest = Infinity;
    let highest = -Infinity;
    let vertex = 0;
    let corner = 0;
    for (const part of parts) {
        const first = vertex;
        for (let i = 0; i < part.materials.length; ++i, ++vertex) {
            const y = part.positions[3 * i + 1]! + part.y;
            positions[3 * vertex] = part.positions[3 * i]!;
            positions[3 * vertex + 1] = y;
            positions[3 * vertex + 2] = part.positions[3 * i + 2]!;
            lowest = Math.min(lowest, y);
            highest = Math.max(highest, y);
            for (let axis = 0; axis < 3; ++axis) {
                normals[4 * vertex + axis] = Math.round(part.normals[3 * i + axis]! * 127);
                colors[4 * vertex + axis] = part.colors[3 * i + axis]!;
            }
            const material = part.materials[i]!;
            colors[4 * vertex + 3] = material;
            shown.set(surfaces[material] ?? [0, 0, 0, 0], 4 * vertex);
        }
        for (let i = 0; i < part.indices.length; ++i) {
            indices[corner++] = part.indices[i]! + first;
        }
    }
    return { positions, normals, colors, surfaces: shown, indices, lowest, highest };
}

export function buffersOf(mesh: TileMesh | null): Transferable[] {
    return mesh === null
        ? []
        : [mesh.positions, mesh.normals, mesh.colors, mesh.surfaces, mesh.indices].map((part) => part.buffer as ArrayBuffer);
}
