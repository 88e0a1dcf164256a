// What is read out of columns on request: ground to walk on, cuts, caves and veins, and a comparison
// of both formats on stacks that nobody has asked for before.
import {
    ChunkStatus,
    ColumnRoom,
    Format,
    PaletteKind,
    chunksOf,
    squareName,
    type Chunk,
    type SectionLine,
    type Square,
    type TerraneClient,
} from 'terrane-client';

import type { Surface } from '../scene/surfaces';
import type { DracoPool } from './draco_pool';
import type { Comparison, Ground } from './messages';

export function groundOf(room: ColumnRoom, square: Square): Ground {
    const { side, offsets, y256, paletteIds } = room.columns(square);
    const solid = room.palette().map(({ kind }) => kind === PaletteKind.Layer || kind === PaletteKind.Vein);
    const starts = new Uint32Array(side * side + 1);
    const spans: number[] = [];
    for (let column = 0; column < side * side; ++column) {
        let bottom: number | undefined = -1;
        for (let i = offsets[column]!; i < offsets[column + 1]!; ++i) {
            const isSolid = solid[paletteIds[i]!]!;
            const y = y256[i]! / 256;
            if (isSolid && bottom === undefined) {
                bottom = y;
            } else if (!isSolid && bottom !== undefined) {
                spans.push(bottom, y);
                bottom = undefined;
            }
        }
        if (bottom !== undefined) {
            spans.push(bottom, Infinity);
        }
        starts[column + 1] = spans.length;
    }
    return { square, offsets: starts, spans: Float32Array.from(spans) };
}

/** The triangles that are no turf, loose soil or snow: worlds lay those over the ground as veins. */
export function withoutCover(mesh: { materials: Uint8Array; indices: Uint32Array }, surfaces: Surface[]): Uint32Array {
    const isCover = surfaces.map(([grass, soil, , snow]) => grass === 255 || soil === 255 || snow === 255);
    const kept = new Uint32Array(mesh.indices.length);
    let count = 0;
    for (let i = 0; i < mesh.indices.length; i += 3) {
        const corners = mesh.indices.subarray(i, i + 3);
        if (corners.every((vertex) => !isCover[mesh.materials[vertex]!])) {
            kept.set(corners, count);
            count += 3;
        }
    }
    return kept.slice(0, count);
}

/** The stacks of a level that a line runs over, those next to its middle first. */
export function squaresAlong(line: SectionLine, lod: number, chunkSide: number): Square[] {
    const side = chunkSide * 2 ** lod;
    const length = Math.hypot(line.x1 - line.x0, line.z1 - line.z0);
    const steps = Math.max(1, Math.ceil((length / side) * 4));
    const found = new Map<string, { square: Square; distance: number }>();
    for (let i = 0; i <= steps; ++i) {
        const t = i / steps;
        const x = line.x0 + t * (line.x1 - line.x0);
        const z = line.z0 + t * (line.z1 - line.z0);
        // One column further on all sides: heights are mixed with those next to the line.
        for (const [dx, dz] of [[0, 0], [1, 0], [0, 1], [1, 1], [-1, -1]] as const) {
            const square = { lod, x: Math.floor((x + dx) / side), z: Math.floor((z + dz) / side) };
            const name = squareName(square);
            if (!found.has(name)) {
                found.set(name, { square, distance: Math.abs(t - 0.5) });
            }
        }
    }
    return [...found.values()].sort((a, b) => a.distance - b.distance).map(({ square }) => square);
}

/** Bytes, client time and server time of both formats over the same stacks. */
export async function compareFormats(
    client: TerraneClient,
    module: WebAssembly.Module,
    pool: DracoPool,
    squares: Square[],
): Promise<Comparison> {
    const keys = squares.flatMap((square) => chunksOf(square, client.hello));
    const ask = (format: Format) => client.requestChunks(keys, { format, withoutFlow: true });
    const sums = (chunks: Chunk[]) => ({
        bytes: chunks.reduce((sum, chunk) => sum + chunk.payload.byteLength, 0),
        mesh: chunks.reduce((sum, chunk) => sum + chunk.timings.meshUs, 0) / 1000,
        encode: chunks.reduce((sum, chunk) => sum + chunk.timings.encodeUs, 0) / 1000,
    });
    const draco = await ask(Format.Draco);
    const columns = await ask(Format.Columns);
    let dracoMs = 0;
    let dracoTriangles = 0;
    for (const chunk of draco.filter(({ status }) => status === ChunkStatus.Full)) {
        const { mesh, ms } = await pool.decode(chunk.payload);
        dracoMs += ms;
        dracoTriangles += mesh.indices.length / 3;
    }
    const room = await ColumnRoom.open(module, client.hello);
    const begin = performance.now();
    columns.forEach((chunk) => room.put(chunk));
    let columnTriangles = 0;
    for (const square of squares) {
        columnTriangles += room.mesh(square).indices.length / 3;
    }
    const columnsMs = performance.now() - begin;
    const d = sums(draco);
    const c = sums(columns);
    return {
        tiles: squares.length,
        triangles: { draco: dracoTriangles, columns: columnTriangles },
        bytes: { draco: d.bytes, columns: c.bytes },
        clientMs: { draco: dracoMs, columns: columnsMs },
        serverMs: { draco: { mesh: d.mesh, encode: d.encode }, columns: { mesh: c.mesh, encode: c.encode } },
    };
}
