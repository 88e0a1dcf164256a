// What goes over the wire, as plain values. protocol/wire/terrane.fbs explains each.
import { ChunkStatus } from './generated/terrane/wire/chunk-status.js';
import { FailureCode } from './generated/terrane/wire/failure-code.js';
import { Format } from './generated/terrane/wire/format.js';
import { MaterialKind } from './generated/terrane/wire/material-kind.js';
import { Source } from './generated/terrane/wire/source.js';

export { ChunkStatus, FailureCode, Format, MaterialKind, Source };

export const PROTOCOL_VERSION = 1;

/** A chunk: x, z in chunk sides of the level, y in chunk heights (0 at levels above 0). */
export interface ChunkKey {
    lod: number;
    x: number;
    y: number;
    z: number;
}

/** 32 lower-case hex digits. */
export type Hash = string;

export interface Share {
    /** Index into ServerHello.materials. */
    material: number;
    concentration: number;
}

export interface Material {
    name: string;
    /** sRGB, 0xrrggbb. */
    color: number;
    texture: string;
    /** One can stand on it. */
    solid: boolean;
    /** A kind newer than this client is Regular if it is solid, else Void. */
    kind: MaterialKind;
}

export interface Limits {
    keysPerRequestMax: number;
    keysInFlightMax: number;
    inboundFrameBytesMax: number;
    payloadBytesMax: number;
    /** 0: this server has no views; ask with requests. */
    viewRadiusMax: number;
    creditWindowBytes: number;
    requestsPerSecondMax: number;
    bytesPerSecondMax: number;
}

export interface ServerHello {
    protocolVersion: number;
    serverVersion: string;
    generatorVersion: number;
    encodingVersion: number;
    worldName: string;
    fingerprint: Hash;
    contentId: Hash;
    chunkSide: number;
    chunkHeight: number;
    voxelSizeM: number;
    levels: number;
    heightBoundVoxels: number;
    materials: Material[];
    limits: Limits;
    /** A landscape: its meshes tell ground, caves and water apart. */
    meshParts: boolean;
}

/** Microseconds that the server spent on an answer. */
export interface Timings {
    queueUs: number;
    generateUs: number;
    meshUs: number;
    encodeUs: number;
}

export interface Chunk {
    /** 0: of the view. */
    requestId: number;
    key: ChunkKey;
    format: Format;
    status: ChunkStatus;
    source: Source;
    etag: Hash;
    timings: Timings;
    /** Empty unless status is Full. Its memory is this chunk's own. */
    payload: Uint8Array;
    /** Of a Uniform chunk. */
    uniform: Share[];
}

export interface ColumnLimit {
    /** Height in 1/256 voxel. */
    y256: number;
    flow: [number, number, number];
    composition: Share[];
}

export interface Column {
    x: number;
    z: number;
    limits: ColumnLimit[];
}

export interface World {
    toml: string;
    fingerprint: Hash;
}

export interface Vector {
    x: number;
    y: number;
    z: number;
}

/** Where the viewer is and how far it sees. Lengths in voxels of level 0. */
export interface View {
    position: Vector;
    /** Where it looks; left out: nowhere in particular. */
    direction?: Vector;
    /** Whole angle of the view cone, radians; 0: all around. */
    fieldOfView?: number;
    /** Voxels a second. */
    velocity?: Vector;
    /** By level, in that level's chunk sides. */
    radiusChunks: number[];
    format: Format;
    withoutFlow?: boolean;
    bytesPerSecondMax?: number;
}

/** The server said no. */
export class TerraneError extends Error {
    constructor(
        readonly code: FailureCode,
        message: string,
        readonly retryAfterMs = 0,
    ) {
        super(message);
        this.name = 'TerraneError';
    }
}

export function keyName(key: ChunkKey): string {
    return `${key.lod}/${key.x}/${key.y}/${key.z}`;
}
