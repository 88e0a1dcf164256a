// What the page and the stream worker tell each other. The worker holds the connection, the decoders
// and the room of columns; the page holds the picture.
import type { Column, SectionLine, ServerHello, Square } from 'terrane-client';

import type { Suggested } from './suggest';

/** A tile's geometry, ready for the GPU: positions in columns of the level and voxels. */
export interface TileMesh {
    positions: Float32Array;
    /** Four bytes a vertex: x, y, z in -127..127. */
    normals: Int8Array;
    /** Four bytes a vertex: linear red, green, blue, main material. */
    colors: Uint8Array;
    /** Four bytes a vertex: how much grass, soil, gloss, snow (see surfaces.ts). Of water: how deep it
     * is, in 1/8 voxel, and three that mean nothing. */
    surfaces: Uint8Array;
    /** Ground, from `cavesFirst` on caves, from `waterFirst` on water. */
    indices: Uint16Array | Uint32Array;
    cavesFirst: number;
    waterFirst: number;
    lowest: number;
    highest: number;
}

export type WireFormat = 'draco' | 'columns';

export interface ViewState {
    position: { x: number; y: number; z: number };
    direction: { x: number; y: number; z: number };
    velocity: { x: number; y: number; z: number };
    fieldOfView: number;
    radiusChunks: number[];
    format: WireFormat;
}

/** Heights of solid ground in voxels: column i has spans[offsets[i] .. offsets[i + 1]], each a bottom
 * and a top, upwards; the lowest bottom is -1. */
export interface Ground {
    square: Square;
    offsets: Uint32Array;
    spans: Float32Array;
}

/** Means over the answers that had a payload. */
export interface FormatFigures {
    chunks: number;
    bytes: number;
    triangles: number;
    /** Client: decoding, and for columns meshing too. Milliseconds a tile. */
    clientMs: number;
    /** Server, microseconds an answer that it did not have in its cache. */
    generateUs: number;
    meshUs: number;
    encodeUs: number;
    made: number;
}

export interface StreamFigures {
    chunks: number;
    bytes: number;
    chunksPerSecond: number;
    bytesPerSecond: number;
    tilesWanted: number;
    tilesMissing: number;
    /** Tiles right under the viewer that are not there. */
    underfootMissing: number;
    /** Wanted tiles of level 0 that are not there. */
    nearMissing: number;
    underWay: number;
    decodeQueue: number;
    pingMs: number;
    /** From wanted to shown, of the last tiles. */
    waitP50Ms: number;
    waitP99Ms: number;
    columnStacks: number;
    columnBytes: number;
    wasmBytes: number;
    usesViews: boolean;
    formats: Record<WireFormat, FormatFigures>;
}

export interface Comparison {
    tiles: number;
    triangles: Record<WireFormat, number>;
    bytes: Record<WireFormat, number>;
    clientMs: Record<WireFormat, number>;
    serverMs: Record<WireFormat, { mesh: number; encode: number }>;
}

export type ToWorker =
    | { kind: 'connect'; url: string; token: string }
    | { kind: 'view'; view: ViewState }
    | { kind: 'dropped'; names: string[] }
    | { kind: 'ground'; squares: Square[] }
    | { kind: 'section'; id: number; near: SectionLine; far: SectionLine; withFlow: boolean }
    | { kind: 'sectionOff' }
    | { kind: 'xray'; squares: Square[] }
    | { kind: 'column'; id: number; x: number; z: number }
    | { kind: 'suggest'; sunYaw: number }
    | { kind: 'compare'; squares: Square[] };

export interface SectionImage {
    line: SectionLine;
    colors: Uint8Array;
    contents: Uint8Array;
}

export type FromWorker =
    | { kind: 'hello'; hello: ServerHello; isNewWorld: boolean }
    | { kind: 'closed'; reason: string; retryMs: number }
    | { kind: 'tile'; square: Square; mesh: TileMesh | null; format: WireFormat }
    | { kind: 'ground'; ground: Ground }
    | { kind: 'section'; id: number; near: SectionImage; far: SectionImage; missing: number }
    | { kind: 'xray'; square: Square; caves: TileMesh | null; veins: TileMesh | null }
    | { kind: 'column'; id: number; column: Column | null; error: string }
    | { kind: 'suggested'; place: Suggested | undefined }
    | { kind: 'figures'; figures: StreamFigures }
    | { kind: 'comparison'; comparison: Comparison | null; error: string };
