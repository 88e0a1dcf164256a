// Plain values to frames, frames to plain values.
import { Builder } from 'flatbuffers';

import { Body } from './generated/terrane/wire/body.js';
import { ChunkCancel } from './generated/terrane/wire/chunk-cancel.js';
import { ChunkForget } from './generated/terrane/wire/chunk-forget.js';
import { ChunkKey as WireKey } from './generated/terrane/wire/chunk-key.js';
import { ChunkRequest } from './generated/terrane/wire/chunk-request.js';
import { Chunk as WireChunk } from './generated/terrane/wire/chunk.js';
import { ClientHello } from './generated/terrane/wire/client-hello.js';
import { ColumnQuery } from './generated/terrane/wire/column-query.js';
import { Column as WireColumn } from './generated/terrane/wire/column.js';
import type { Composition } from './generated/terrane/wire/composition.js';
import { Credit } from './generated/terrane/wire/credit.js';
import { Failure as WireFailure } from './generated/terrane/wire/failure.js';
import { Goodbye } from './generated/terrane/wire/goodbye.js';
import type { Hash as WireHash } from './generated/terrane/wire/hash.js';
import type { Material as WireMaterial } from './generated/terrane/wire/material.js';
import { Message } from './generated/terrane/wire/message.js';
import { Ping } from './generated/terrane/wire/ping.js';
import { Pong } from './generated/terrane/wire/pong.js';
import { ServerHello as WireHello } from './generated/terrane/wire/server-hello.js';
import { Vector as WireVector } from './generated/terrane/wire/vector.js';
import { ViewUpdate } from './generated/terrane/wire/view-update.js';
import { WorldDefinition } from './generated/terrane/wire/world-definition.js';
import { WorldQuery } from './generated/terrane/wire/world-query.js';
import { Hash as HashStruct } from './generated/terrane/wire/hash.js';
import { makeFrame, parseFrame } from './frame.js';
import {
    FailureCode,
    MaterialKind,
    PROTOCOL_VERSION,
    type Chunk,
    type ChunkKey,
    type Column,
    type Format,
    type Hash,
    type ServerHello,
    type Share,
    type Vector,
    type View,
    type World,
} from './messages.js';

export interface Failure {
    requestId: number;
    code: FailureCode;
    message: string;
    retryAfterMs: number;
    key: ChunkKey | undefined;
}

/** What a server says. */
export type Incoming =
    | { kind: 'hello'; hello: ServerHello }
    | { kind: 'chunk'; chunk: Chunk }
    | { kind: 'column'; requestId: number; column: Column }
    | { kind: 'world'; requestId: number; world: World }
    | { kind: 'failure'; failure: Failure }
    | { kind: 'forget'; keys: ChunkKey[] }
    | { kind: 'ping'; nonce: bigint }
    | { kind: 'pong'; nonce: bigint }
    | { kind: 'goodbye'; code: FailureCode; reason: string }
    | { kind: 'unknown'; type: number };

type Fill = (builder: Builder) => number;

function frameOf(type: Body, fill: Fill, bytes = 256): Uint8Array {
    const builder = new Builder(bytes);
    const body = fill(builder);
    Message.startMessage(builder);
    Message.addBodyType(builder, type);
    Message.addBody(builder, body);
    builder.finish(Message.endMessage(builder), 'TRNE', true);
    return makeFrame(builder.asUint8Array());
}

export function clientHello(options: { name: string; token: string }): Uint8Array {
    return frameOf(Body.ClientHello, (builder) => {
        const name = builder.createString(options.name);
        const token = builder.createString(options.token);
        return ClientHello.createClientHello(builder, PROTOCOL_VERSION, name, token);
    });
}

export interface RequestOptions {
    format: Format;
    /** -8..8; higher first. */
    priority?: number;
    withoutFlow?: boolean;
    /** One a key; '' for none. */
    knownEtags?: Hash[];
}

function hashParts(hash: Hash): [bigint, bigint] {
    return hash === '' ? [0n, 0n] : [BigInt(`0x${hash.slice(0, 16)}`), BigInt(`0x${hash.slice(16)}`)];
}

export function chunkRequest(id: number, keys: ChunkKey[], options: RequestOptions): Uint8Array {
    return frameOf(
        Body.ChunkRequest,
        (builder) => {
            ChunkRequest.startKeysVector(builder, keys.length);
            for (const key of [...keys].reverse()) {
                WireKey.createChunkKey(builder, key.lod, key.x, key.y, key.z);
            }
            const keysAt = builder.endVector();
            let etagsAt = 0;
            if (options.knownEtags !== undefined) {
                ChunkRequest.startKnownEtagsVector(builder, options.knownEtags.length);
                for (const etag of [...options.knownEtags].reverse()) {
                    HashStruct.createHash(builder, ...hashParts(etag));
                }
                etagsAt = builder.endVector();
            }
            ChunkRequest.startChunkRequest(builder);
            ChunkRequest.addRequestId(builder, id);
            ChunkRequest.addFormat(builder, options.format);
            ChunkRequest.addKeys(builder, keysAt);
            if (etagsAt !== 0) {
                ChunkRequest.addKnownEtags(builder, etagsAt);
            }
            ChunkRequest.addPriority(builder, options.priority ?? 0);
            ChunkRequest.addWithoutFlow(builder, options.withoutFlow ?? false);
            return ChunkRequest.endChunkRequest(builder);
        },
        2048,
    );
}

export function chunkCancel(ids: number[]): Uint8Array {
    return frameOf(Body.ChunkCancel, (builder) =>
        ChunkCancel.createChunkCancel(builder, ChunkCancel.createRequestIdsVector(builder, ids)),
    );
}

export function columnQuery(id: number, x: number, z: number): Uint8Array {
    return frameOf(Body.ColumnQuery, (builder) =>
        ColumnQuery.createColumnQuery(builder, id, BigInt(x), BigInt(z)),
    );
}

export function worldQuery(id: number): Uint8Array {
    return frameOf(Body.WorldQuery, (builder) => WorldQuery.createWorldQuery(builder, id));
}

export function credit(bytes: number): Uint8Array {
    return frameOf(Body.Credit, (builder) => Credit.createCredit(builder, BigInt(bytes)));
}

export function ping(nonce: bigint): Uint8Array {
    return frameOf(Body.Ping, (builder) => Ping.createPing(builder, nonce));
}

export function pong(nonce: bigint): Uint8Array {
    return frameOf(Body.Pong, (builder) => Pong.createPong(builder, nonce));
}

export function goodbye(): Uint8Array {
    return frameOf(Body.Goodbye, (builder) =>
        Goodbye.createGoodbye(builder, FailureCode.None, builder.createString('')),
    );
}

function vectorOf(builder: Builder, { x, y, z }: Vector): number {
    return WireVector.createVector(builder, x, y, z);
}

export function viewUpdate(view: View): Uint8Array {
    return frameOf(Body.ViewUpdate, (builder) => {
        const radius = ViewUpdate.createRadiusChunksVector(builder, view.radiusChunks);
        ViewUpdate.startViewUpdate(builder);
        ViewUpdate.addX(builder, view.position.x);
        ViewUpdate.addY(builder, view.position.y);
        ViewUpdate.addZ(builder, view.position.z);
        // A struct lies in its table: it is made right where it is added.
        if (view.direction !== undefined) {
            ViewUpdate.addDirection(builder, vectorOf(builder, view.direction));
        }
        ViewUpdate.addFieldOfView(builder, view.fieldOfView ?? 0);
        if (view.velocity !== undefined) {
            ViewUpdate.addVelocity(builder, vectorOf(builder, view.velocity));
        }
        ViewUpdate.addRadiusChunks(builder, radius);
        ViewUpdate.addFormat(builder, view.format);
        ViewUpdate.addWithoutFlow(builder, view.withoutFlow ?? false);
        ViewUpdate.addBytesPerSecondMax(builder, BigInt(view.bytesPerSecondMax ?? 0));
        return ViewUpdate.endViewUpdate(builder);
    });
}

function hashOf(hash: WireHash | null): Hash {
    const part = (value: bigint) => value.toString(16).padStart(16, '0');
    return hash === null ? '' : part(hash.high()) + part(hash.low());
}

function keyOf(key: WireKey): ChunkKey {
    return { lod: key.lod(), x: key.x(), y: key.y(), z: key.z() };
}

function sharesOf(composition: Composition | null): Share[] {
    const shares: Share[] = [];
    for (let i = 0; composition !== null && i < composition.sharesLength(); ++i) {
        const share = composition.shares(i)!;
        shares.push({ material: share.material(), concentration: share.concentration() });
    }
    return shares;
}

function kindOf(material: WireMaterial): MaterialKind {
    const kind = material.kind();
    return kind in MaterialKind ? kind : material.solid() ? MaterialKind.Regular : MaterialKind.Void;
}

function helloOf(hello: WireHello): ServerHello {
    const materials = [];
    for (let i = 0; i < hello.materialsLength(); ++i) {
        const material = hello.materials(i)!;
        materials.push({
            name: material.name() ?? '',
            color: material.colorRgb(),
            texture: material.texture() ?? '',
            solid: material.solid(),
            kind: kindOf(material),
        });
    }
    const limits = hello.limits();
    return {
        protocolVersion: hello.protocolVersion(),
        serverVersion: hello.serverVersion() ?? '',
        generatorVersion: hello.generatorVersion(),
        encodingVersion: hello.encodingVersion(),
        worldName: hello.worldName() ?? '',
        fingerprint: hashOf(hello.fingerprint()),
        contentId: hashOf(hello.contentId()),
        chunkSide: hello.chunkSide(),
        chunkHeight: hello.chunkHeight(),
        voxelSizeM: hello.voxelSizeM(),
        levels: hello.levels(),
        heightBoundVoxels: hello.heightBoundVoxels(),
        materials,
        limits: {
            keysPerRequestMax: limits?.keysPerRequestMax() || 64,
            keysInFlightMax: limits?.keysInFlightMax() || 64,
            inboundFrameBytesMax: limits?.inboundFrameBytesMax() ?? 65536,
            payloadBytesMax: limits?.payloadBytesMax() ?? 0,
            viewRadiusMax: limits?.viewRadiusMax() ?? 0,
            creditWindowBytes: limits?.creditWindowBytes() ?? 0,
            requestsPerSecondMax: limits?.requestsPerSecondMax() ?? 0,
            bytesPerSecondMax: Number(limits?.bytesPerSecondMax() ?? 0n),
        },
        meshParts: hello.meshParts(),
    };
}

function chunkOf(chunk: WireChunk, payload: Uint8Array): Chunk {
    const timings = chunk.timings();
    if (chunk.payloadBytes() !== payload.byteLength) {
        throw new Error(`chunk: ${payload.byteLength} bytes came, ${chunk.payloadBytes()} were named`);
    }
    const key = chunk.key();
    if (key === null) {
        throw new Error('chunk: an answer without a key');
    }
    return {
        requestId: chunk.requestId(),
        key: keyOf(key),
        format: chunk.format(),
        status: chunk.status(),
        source: chunk.source(),
        etag: hashOf(chunk.etag()),
        timings: {
            queueUs: timings?.queueUs() ?? 0,
            generateUs: timings?.generateUs() ?? 0,
            meshUs: timings?.meshUs() ?? 0,
            encodeUs: timings?.encodeUs() ?? 0,
        },
        payload,
        uniform: sharesOf(chunk.uniform()),
    };
}

function columnOf(column: WireColumn): Column {
    const limits = [];
    for (let i = 0; i < column.limitsLength(); ++i) {
        const limit = column.limits(i)!;
        const flow = limit.flow();
        limits.push({
            y256: limit.y256(),
            flow: [flow?.x() ?? 0, flow?.y() ?? 0, flow?.z() ?? 0] as [number, number, number],
            composition: sharesOf(limit.composition()),
        });
    }
    return { x: Number(column.x()), z: Number(column.z()), limits };
}

/** Throws on a frame that is none. A kind that is newer than this client is 'unknown'. */
export function decode(bytes: Uint8Array): Incoming {
    const { head, payload } = parseFrame(bytes);
    const message = Message.getRootAsMessage(head);
    const type = message.bodyType();
    switch (type) {
        case Body.ServerHello:
            return { kind: 'hello', hello: helloOf(message.body(new WireHello())) };
        case Body.Chunk:
            return { kind: 'chunk', chunk: chunkOf(message.body(new WireChunk()), payload) };
        case Body.Column: {
            const column: WireColumn = message.body(new WireColumn());
            return { kind: 'column', requestId: column.requestId(), column: columnOf(column) };
        }
        case Body.WorldDefinition: {
            const world: WorldDefinition = message.body(new WorldDefinition());
            const read = { toml: world.toml() ?? '', fingerprint: hashOf(world.fingerprint()) };
            return { kind: 'world', requestId: world.requestId(), world: read };
        }
        case Body.Failure: {
            const failure: WireFailure = message.body(new WireFailure());
            const key = failure.key();
            return {
                kind: 'failure',
                failure: {
                    requestId: failure.requestId(),
                    code: failure.code(),
                    message: failure.message() ?? '',
                    retryAfterMs: failure.retryAfterMs(),
                    key: key === null ? undefined : keyOf(key),
                },
            };
        }
        case Body.ChunkForget: {
            const forget: ChunkForget = message.body(new ChunkForget());
            const keys = [];
            for (let i = 0; i < forget.keysLength(); ++i) {
                keys.push(keyOf(forget.keys(i)!));
            }
            return { kind: 'forget', keys };
        }
        case Body.Ping:
            return { kind: 'ping', nonce: message.body(new Ping()).nonce() };
        case Body.Pong:
            return { kind: 'pong', nonce: message.body(new Pong()).nonce() };
        case Body.Goodbye: {
            const bye: Goodbye = message.body(new Goodbye());
            return { kind: 'goodbye', code: bye.code(), reason: bye.reason() ?? '' };
        }
        default:
            return { kind: 'unknown', type };
    }
}
