// Columns in the browser and in Node: the server's own chunk reader and mesher, compiled to
// WebAssembly. A ColumnRoom holds stacks of columns and gives meshes, cuts and single columns of them.
import { decompress } from 'fzstd';

import type { ChunkKey, ColumnLimit, ServerHello, Share } from './messages.js';
import { ChunkStatus, Format, type Chunk } from './messages.js';
import { chunksPerStack, type Square } from './want_set.js';

/** A decompressed chunk is at most this large. */
export const CHUNK_BYTES_MAX = 64 * 1024 * 1024;

/** The tag byte in front of a COLUMNS payload. */
const PLAIN = 0;
const ZSTD = 1;
const ZSTD_MAGIC = 0xfd2fb528;

export enum PaletteKind {
    Layer = 0,
    Void = 1,
    Vein = 2,
    Cave = 3,
}

export interface PaletteEntry {
    kind: PaletteKind;
    /** Never mixed with others: frontiers against it are sharp. */
    alone: boolean;
    shares: Share[];
}

/** A mesh, in columns of its level along x and z and voxels along y. */
export interface TerrainMesh {
    positions: Float32Array;
    normals: Float32Array;
    /** Linear light, three a vertex. */
    colors: Uint8Array;
    /** The main material of each vertex. */
    materials: Uint8Array;
    /** What each vertex is of; undefined: all ground. partOf() tells it of a triangle. */
    parts: Uint8Array | undefined;
    indices: Uint32Array;
}

/** As in Draco meshes: what a surface is of. */
export enum MeshPart {
    Ground = 0,
    /** Under 24 voxels of rock or more: not seen from above the ground. */
    Cave = 1,
    /** The water's own surface: to be seen, not to be walked on. */
    Water = 2,
}

/** Of triangle i: the least of its corners', so that what joins a cave to the ground is ground. */
export function partOf({ parts, indices }: Pick<TerrainMesh, 'parts' | 'indices'>, i: number): MeshPart {
    return parts === undefined
        ? MeshPart.Ground
        : Math.min(parts[indices[3 * i]!]!, parts[indices[3 * i + 1]!]!, parts[indices[3 * i + 2]!]!);
}

export type MeshOf = 'surface' | 'caves' | 'veins';

/** The limits of a column, in the room's palette. */
export interface RoomLimit {
    y256: number;
    paletteId: number;
    flow: [number, number, number];
}

/** side x side columns one behind the other: column i has limits offsets[i] .. offsets[i + 1]. */
export interface StackColumns {
    side: number;
    offsets: Uint32Array;
    y256: Int32Array;
    paletteIds: Uint16Array;
}

/** A vertical cut, in voxels; the first row of pixels is the lowest. */
export interface SectionLine {
    x0: number;
    z0: number;
    x1: number;
    z1: number;
    y0: number;
    y1: number;
    width: number;
    height: number;
}

export interface SectionPixels {
    /** sRGB and 255, or all 0 where it is hollow or unknown. */
    colors: Uint8Array;
    /** Main material, PaletteKind + 1 (0: unknown), flow along the line and flow up, each + 128. */
    contents: Uint8Array;
}

interface Exports {
    memory: WebAssembly.Memory;
    _initialize(): void;
    room_buffer(bytes: number): number;
    room_error(): number;
    room_open(side: number, height: number, heights: number, materials: number, meshParts: number): number;
    room_put(bytes: number): number;
    room_put_uniform(lod: number, x: number, y: number, z: number, kind: number, shares: number): number;
    room_drop(lod: number, x: number, z: number): void;
    room_has(lod: number, x: number, z: number): number;
    room_stacks(): number;
    room_bytes(): number;
    room_mesh(lod: number, x: number, z: number, what: number, first: number, last: number): number;
    mesh_indices_count(): number;
    mesh_positions(): number;
    mesh_normals(): number;
    mesh_colors(): number;
    mesh_materials(): number;
    mesh_parts(): number;
    mesh_indices(): number;
    room_section(x0: number, z0: number, x1: number, z1: number, y0: number, y1: number, width: number, height: number): void;
    section_colors(): number;
    section_contents(): number;
    room_column(x: number, z: number): number;
    column_limits(): number;
    stack_offsets(lod: number, x: number, z: number): number;
    stack_limits(lod: number, x: number, z: number): number;
    palette_doubles(): number;
    palette_data(): number;
}

const MESH_OF = { surface: 0, caves: 1, veins: 2 } as const;
const LIMIT_BYTES = 12;

/** The chunk's bytes in the form of CHUNK_FORMAT.md, out of a COLUMNS payload. */
export function readColumnPayload(payload: Uint8Array): Uint8Array {
    if (payload.byteLength < 2) {
        throw new Error('columns: the payload is empty');
    }
    if (payload[0] === PLAIN) {
        return payload.subarray(1);
    }
    if (payload[0] !== ZSTD) {
        throw new Error(`columns: unknown tag ${payload[0]}`);
    }
    const frame = payload.subarray(1);
    const bytes = zstdContentBytes(frame);
    if (bytes > CHUNK_BYTES_MAX) {
        throw new Error(`columns: ${bytes} bytes are above the limit of ${CHUNK_BYTES_MAX}`);
    }
    return decompress(frame, new Uint8Array(bytes));
}

/** The size that a zstd frame's header names; it has one always. RFC 8878, 3.1.1.1. */
function zstdContentBytes(frame: Uint8Array): number {
    const view = new DataView(frame.buffer, frame.byteOffset, frame.byteLength);
    if (frame.byteLength < 6 || view.getUint32(0, true) !== ZSTD_MAGIC) {
        throw new Error('columns: not a zstd frame');
    }
    const descriptor = frame[4]!;
    const isSingleSegment = (descriptor >> 5) & 1;
    const at = 5 + (isSingleSegment ? 0 : 1) + [0, 1, 2, 4][descriptor & 3]!;
    const sizeFlag = descriptor >> 6;
    const sizeBytes = sizeFlag === 0 ? isSingleSegment : 1 << sizeFlag;
    if (sizeBytes === 0 || at + sizeBytes > frame.byteLength) {
        throw new Error('columns: the zstd frame does not say its size');
    }
    switch (sizeBytes) {
        case 1:
            return view.getUint8(at);
        case 2:
            return view.getUint16(at, true) + 256;
        case 4:
            return view.getUint32(at, true);
        default:
            return Number(view.getBigUint64(at, true));
    }
}

/** The room's module: compile it once, open a room a world. Node: leave the argument out. */
export async function compileColumns(
    source?: BufferSource | Response | Promise<Response>,
): Promise<WebAssembly.Module> {
    if (source === undefined) {
        const { readFile } = await import(/* @vite-ignore */ 'node:fs/promises' as string);
        const bytes = await readFile(new URL('./columns.wasm', /* @vite-ignore */ import.meta.url));
        return WebAssembly.compile(bytes);
    }
    if (source instanceof ArrayBuffer || ArrayBuffer.isView(source)) {
        return WebAssembly.compile(source as BufferSource);
    }
    return WebAssembly.compile(await (await source).arrayBuffer());
}

/** What the reader imports of its system is never needed: it has no files. An abort is a trap. */
function systemOf(module: WebAssembly.Module): WebAssembly.Imports {
    const imports: WebAssembly.Imports = {};
    for (const { module: from, name } of WebAssembly.Module.imports(module)) {
        (imports[from] ??= {})[name] =
            name === 'proc_exit'
                ? () => {
                      throw new Error('columns: the reader stopped');
                  }
                : () => 52; // ENOSYS
    }
    return imports;
}

export class ColumnRoom {
    private readonly api: Exports;

    private constructor(
        private readonly hello: ServerHello,
        instance: WebAssembly.Instance,
    ) {
        this.api = instance.exports as unknown as Exports;
        this.api._initialize();
        const { chunkSide, chunkHeight, materials, meshParts } = hello;
        const known = new Uint8Array(materials.length * 4);
        materials.forEach(({ color, kind }, i) => known.set([color >> 16, (color >> 8) & 255, color & 255, kind], 4 * i));
        this.fill(known);
        this.checked(
            this.api.room_open(chunkSide, chunkHeight, chunksPerStack(hello, 0), materials.length, meshParts ? 1 : 0),
        );
    }

    static async open(module: WebAssembly.Module, hello: ServerHello): Promise<ColumnRoom> {
        return new ColumnRoom(hello, await WebAssembly.instantiate(module, systemOf(module)));
    }

    /** Keeps a COLUMNS chunk; true if its stack is complete now. Throws on a broken payload. */
    put(chunk: Chunk): boolean {
        if (chunk.format !== Format.Columns) {
            throw new Error(`columns: a chunk of format ${chunk.format}`);
        }
        if (chunk.status === ChunkStatus.Uniform || chunk.status === ChunkStatus.Empty) {
            return this.putUniform(chunk.key, chunk.uniform);
        }
        const bytes = readColumnPayload(chunk.payload);
        this.fill(bytes);
        return this.checked(this.api.room_put(bytes.byteLength)) === 1;
    }

    putUniform(key: ChunkKey, shares: Share[]): boolean {
        const pairs = new Float64Array(shares.length * 2);
        shares.forEach((share, i) => pairs.set([share.material, share.concentration], 2 * i));
        this.fill(new Uint8Array(pairs.buffer));
        const main = shares[0];
        const isSolid = main !== undefined && (this.hello.materials[main.material]?.solid ?? true);
        const kind = isSolid ? PaletteKind.Layer : PaletteKind.Void;
        const { lod, x, y, z } = key;
        return this.checked(this.api.room_put_uniform(lod, x, y, z, kind, shares.length)) === 1;
    }

    drop({ lod, x, z }: Square): void {
        this.api.room_drop(lod, x, z);
    }

    has({ lod, x, z }: Square): boolean {
        return this.api.room_has(lod, x, z) === 1;
    }

    /** Stacks held, whole or not. */
    get stacks(): number {
        return this.api.room_stacks();
    }

    /** Memory that the columns take. */
    get bytes(): number {
        return this.api.room_bytes();
    }

    /** Memory of the whole room, which never shrinks. */
    get memoryBytes(): number {
        return this.api.memory.buffer.byteLength;
    }

    /** The mesh of a stack, or of `heights` of it at level 0. Throws if it is not complete. */
    mesh({ lod, x, z }: Square, what: MeshOf = 'surface', heights?: { first: number; last: number }): TerrainMesh {
        const first = heights?.first ?? 0;
        const last = heights?.last ?? Math.ceil(this.hello.heightBoundVoxels) + 1;
        const vertices = this.checked(this.api.room_mesh(lod, x, z, MESH_OF[what], first, last));
        const { buffer } = this.api.memory;
        const partsAt = this.api.mesh_parts();
        return {
            positions: new Float32Array(buffer, this.api.mesh_positions(), vertices * 3).slice(),
            normals: new Float32Array(buffer, this.api.mesh_normals(), vertices * 3).slice(),
            colors: new Uint8Array(buffer, this.api.mesh_colors(), vertices * 3).slice(),
            materials: new Uint8Array(buffer, this.api.mesh_materials(), vertices).slice(),
            parts: partsAt === 0 ? undefined : new Uint8Array(buffer, partsAt, vertices).slice(),
            indices: new Uint32Array(buffer, this.api.mesh_indices(), this.api.mesh_indices_count()).slice(),
        };
    }

    section(line: SectionLine): SectionPixels {
        const { x0, z0, x1, z1, y0, y1, width, height } = line;
        this.api.room_section(x0, z0, x1, z1, y0, y1, width, height);
        const bytes = 4 * width * height;
        const { buffer } = this.api.memory;
        return {
            colors: new Uint8Array(buffer, this.api.section_colors(), bytes).slice(),
            contents: new Uint8Array(buffer, this.api.section_contents(), bytes).slice(),
        };
    }

    /** A column of level 0 from the finest stack held there; none if there is none. */
    column(x: number, z: number): RoomLimit[] {
        const count = this.api.room_column(Math.floor(x), Math.floor(z));
        const view = new DataView(this.api.memory.buffer, this.api.column_limits(), count * LIMIT_BYTES);
        return Array.from({ length: count }, (_, i) => ({
            y256: view.getInt32(i * LIMIT_BYTES, true),
            paletteId: view.getUint16(i * LIMIT_BYTES + 4, true),
            flow: [6, 7, 8].map((at) => view.getInt8(i * LIMIT_BYTES + at)) as [number, number, number],
        }));
    }

    /** The same with compositions: what a ColumnQuery gives. */
    columnLimits(x: number, z: number): ColumnLimit[] {
        const palette = this.palette();
        return this.column(x, z).map(({ y256, paletteId, flow }) => ({
            y256,
            flow,
            composition: palette[paletteId]!.shares,
        }));
    }

    /** All columns of a stack. Throws if it is not complete. */
    columns({ lod, x, z }: Square): StackColumns {
        const at = this.api.stack_offsets(lod, x, z);
        if (at === 0) {
            throw new Error('columns: the stack is not here');
        }
        const side = this.hello.chunkSide;
        const { buffer } = this.api.memory;
        const offsets = new Uint32Array(buffer, at, side * side + 1).slice();
        const count = offsets[side * side]!;
        const view = new DataView(buffer, this.api.stack_limits(lod, x, z), count * LIMIT_BYTES);
        const y256 = new Int32Array(count);
        const paletteIds = new Uint16Array(count);
        for (let i = 0; i < count; ++i) {
            y256[i] = view.getInt32(i * LIMIT_BYTES, true);
            paletteIds[i] = view.getUint16(i * LIMIT_BYTES + 4, true);
        }
        return { side, offsets, y256, paletteIds };
    }

    /** What palette ids stand for. It only grows. */
    palette(): PaletteEntry[] {
        const count = this.api.palette_doubles();
        const numbers = new Float64Array(this.api.memory.buffer, this.api.palette_data(), count);
        const entries: PaletteEntry[] = [];
        for (let i = 0; i < count; ) {
            const [kind, alone, shareCount] = numbers.subarray(i, i + 3);
            const shares = [];
            i += 3;
            for (let share = 0; share < shareCount!; ++share, i += 2) {
                shares.push({ material: numbers[i]!, concentration: numbers[i + 1]! });
            }
            entries.push({ kind: kind!, alone: alone === 1, shares });
        }
        return entries;
    }

    private fill(bytes: Uint8Array): void {
        const at = this.api.room_buffer(bytes.byteLength);
        if (at === 0) {
            throw new Error(`columns: ${bytes.byteLength} bytes are too many`);
        }
        new Uint8Array(this.api.memory.buffer, at, bytes.byteLength).set(bytes);
    }

    private checked(result: number): number {
        if (result >= 0) {
            return result;
        }
        const bytes = new Uint8Array(this.api.memory.buffer, this.api.room_error());
        throw new Error(new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0))));
    }
}
