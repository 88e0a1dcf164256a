// The tiles of a view over one session: what is wanted, what has come, what is decoded. With a server
// that streams views it sends ViewUpdates and takes what comes; with any other it asks for the chunks
// of the same want-set itself, nearest first.
import {
    ChunkStatus,
    Format,
    chunksOf,
    chunksPerStack,
    distanceTo,
    squareName,
    wantSet,
    type Chunk,
    type ChunkKey,
    type ColumnRoom,
    type Square,
    type TerraneClient,
} from 'terrane-client';

import type { Surface } from '../scene/surfaces';
import type { DracoPool } from './draco_pool';
import type { Meter } from './figures';
import type { TileMesh, ViewState, WireFormat } from './messages';
import { joinPieces, type Piece } from './tile_mesh';

const VIEW_PERIOD_MS = 100;
/** Without views: tiles asked for at a time. */
const TILES_UNDER_WAY_MAX = 32;
/** A tile made of columns waits this long for its neighbours, and is made again when they come later. */
const NEIGHBOUR_WAIT_MS = 400;
const MESHING_SLICE_MS = 12;

interface Tile {
    square: Square;
    since: number;
    missing: Set<number>;
    pieces: Piece[];
    isShown: boolean;
    abort: AbortController | undefined;
}

export interface TileStreamHost {
    show(square: Square, mesh: TileMesh | null, format: WireFormat): void;
    isPinned(name: string): boolean;
}

export class TileStream {
    private view: ViewState | undefined;
    private readonly wanted = new Map<string, Tile>();
    private order: Square[] = [];
    private readonly toMesh = new Map<string, { square: Square; since: number }>();
    private readonly meshedWithout = new Set<string>();
    private isMeshing = false;
    private lastSentMs = 0;
    private sendTimer: ReturnType<typeof setTimeout> | undefined;
    private tilesUnderWay = 0;
    private isClosed = false;

    constructor(
        private readonly client: TerraneClient,
        private readonly room: ColumnRoom,
        private readonly flowless: Set<string>,
        private readonly pool: DracoPool,
        private readonly meter: Meter,
        private readonly surfaces: Surface[],
        /** Shown by earlier sessions of the same world, and not dropped since. */
        private readonly shown: Set<string>,
        private readonly host: TileStreamHost,
    ) {
        client.onViewChunk = (chunk) => this.take(chunk);
        client.onForget = (keys) => this.forget(keys);
    }

    close(): void {
        this.isClosed = true;
        clearTimeout(this.sendTimer);
        this.client.onViewChunk = () => {};
        this.client.onForget = () => {};
    }

    setView(view: ViewState): void {
        const { levels, limits } = this.client.hello;
        const most = this.client.hasViews ? limits.viewRadiusMax : Infinity;
        const radiusChunks = view.radiusChunks.slice(0, levels).map((radius) => Math.min(radius, most));
        if (this.view !== undefined && this.view.format !== view.format) {
            this.shown.clear();
            this.wanted.forEach((tile) => tile.abort?.abort());
            this.wanted.clear();
            this.toMesh.clear();
        }
        this.view = { ...view, radiusChunks };
        this.refreshWanted();
        this.sendSoon();
    }

    /** The page has thrown these tiles away. */
    dropped(names: string[]): void {
        for (const name of names) {
            this.shown.delete(name);
            this.dropColumns(name);
        }
    }

    /** Columns came by another way: tiles that were made without them are made again. */
    columnsArrived(square: Square): void {
        this.remeshAround(square);
        this.pump();
    }

    figures() {
        const { position } = this.view ?? { position: { x: 0, z: 0 } };
        const side = this.client.hello.chunkSide;
        let nearMissing = 0;
        let underfootMissing = 0;
        let missing = 0;
        for (const tile of this.wanted.values()) {
            if (!tile.isShown) {
                ++missing;
                nearMissing += tile.square.lod === 0 ? 1 : 0;
                underfootMissing += distanceTo(tile.square, position.x, position.z, side) === 0 ? 1 : 0;
            }
        }
        return {
            tilesWanted: this.wanted.size,
            tilesMissing: missing,
            nearMissing,
            underfootMissing,
            underWay: this.client.hasViews ? missing : this.tilesUnderWay,
            decodeQueue: this.pool.length + this.toMesh.size,
        };
    }

    private get format(): WireFormat {
        return this.view?.format ?? 'draco';
    }

    private refreshWanted(): void {
        const view = this.view!;
        this.order = wantSet(view.position, view.radiusChunks, this.client.hello.chunkSide);
        const names = new Set<string>();
        const now = performance.now();
        for (const square of this.order) {
            const name = squareName(square);
            names.add(name);
            if (!this.wanted.has(name)) {
                const isShown = this.shown.has(name);
                this.wanted.set(name, { square, since: now, missing: this.yOf(square), pieces: [], isShown, abort: undefined });
            }
        }
        for (const [name, tile] of this.wanted) {
            if (!names.has(name)) {
                tile.abort?.abort();
                this.wanted.delete(name);
                this.toMesh.delete(name);
                this.dropColumns(name);
            }
        }
    }

    private yOf(square: Square): Set<number> {
        return new Set(Array.from({ length: chunksPerStack(this.client.hello, square.lod) }, (_, y) => y));
    }

    private dropColumns(name: string): void {
        if (!this.wanted.has(name) && !this.host.isPinned(name)) {
            const [lod, x, z] = name.split('/').map(Number);
            this.room.drop({ lod: lod!, x: x!, z: z! });
            this.flowless.delete(name);
            this.meshedWithout.delete(name);
        }
    }

    private sendSoon(): void {
        if (this.sendTimer !== undefined) {
            return;
        }
        const after = Math.max(0, this.lastSentMs + VIEW_PERIOD_MS - performance.now());
        this.sendTimer = setTimeout(() => {
            this.sendTimer = undefined;
            this.lastSentMs = performance.now();
            this.send();
        }, after);
    }

    private send(): void {
        const view = this.view!;
        if (!this.client.isOpen) {
            return;
        }
        if (this.client.hasViews) {
            this.client.updateView({
                position: view.position,
                direction: view.direction,
                fieldOfView: view.fieldOfView,
                velocity: view.velocity,
                radiusChunks: view.radiusChunks,
                format: view.format === 'draco' ? Format.Draco : Format.Columns,
                withoutFlow: true,
            });
        } else {
            this.askForMore();
        }
    }

    /** Without views: the nearest tiles that are not there yet. */
    private askForMore(): void {
        for (const square of this.order) {
            if (this.tilesUnderWay >= TILES_UNDER_WAY_MAX || this.isClosed) {
                return;
            }
            const tile = this.wanted.get(squareName(square));
            if (tile !== undefined && !tile.isShown && tile.abort === undefined) {
                this.ask(tile);
            }
        }
    }

    private ask(tile: Tile): void {
        const abort = new AbortController();
        tile.abort = abort;
        ++this.tilesUnderWay;
        this.client
            .requestChunks(chunksOf(tile.square, this.client.hello), {
                format: this.format === 'draco' ? Format.Draco : Format.Columns,
                withoutFlow: true,
                signal: abort.signal,
                onChunk: (chunk) => void this.take(chunk),
            })
            .catch(() => {
                if (!abort.signal.aborted) {
                    setTimeout(() => (tile.abort = undefined), 1000);
                }
            })
            .finally(() => {
                --this.tilesUnderWay;
                this.askForMore();
            });
    }

    private forget(keys: ChunkKey[]): void {
        for (const key of keys) {
            const tile = this.wanted.get(squareName(key));
            if (tile !== undefined && !tile.isShown) {
                tile.missing = this.yOf(tile.square);
                tile.pieces = [];
            }
        }
    }

    /** Settles when the chunk is decoded: that is when it is credited. */
    private take(chunk: Chunk): Promise<void> | void {
        const format: WireFormat = chunk.format === Format.Columns ? 'columns' : 'draco';
        this.meter.came(chunk, format);
        const tile = this.wanted.get(squareName(chunk.key));
        if (tile === undefined || tile.isShown || format !== this.format || this.isClosed) {
            return;
        }
        return format === 'draco' ? this.takeDraco(tile, chunk) : this.takeColumns(tile, chunk);
    }

    private async takeDraco(tile: Tile, chunk: Chunk): Promise<void> {
        const { y } = chunk.key;
        if (chunk.status === ChunkStatus.Full) {
            const { mesh, ms } = await this.pool.decode(chunk.payload);
            this.meter.decoded('draco', ms, mesh.indices.length / 3);
            if (tile.missing.has(y)) {
                tile.pieces.push({ ...mesh, y: y * this.client.hello.chunkHeight });
            }
        }
        if (tile.missing.delete(y) && tile.missing.size === 0 && this.isWanted(tile) && this.format === 'draco') {
            this.show(tile, joinPieces(tile.pieces, this.surfaces));
            tile.pieces = [];
        }
    }

    private isWanted(tile: Tile): boolean {
        return !this.isClosed && this.wanted.get(squareName(tile.square)) === tile;
    }

    private takeColumns(tile: Tile, chunk: Chunk): void {
        const begin = performance.now();
        const name = squareName(tile.square);
        const wasThere = this.room.has(tile.square);
        const isComplete = this.room.put(chunk);
        this.meter.decoded('columns', performance.now() - begin, 0);
        if (isComplete && !wasThere) {
            this.flowless.add(name);
        }
        tile.missing.delete(chunk.key.y);
        if (isComplete && tile.missing.size === 0) {
            this.toMesh.set(name, { square: tile.square, since: performance.now() });
            this.remeshAround(tile.square);
            this.pump();
        }
    }

    private neighboursOf({ lod, x, z }: Square): Square[] {
        const squares = [];
        for (let i = 0; i < 9; ++i) {
            if (i !== 4) {
                squares.push({ lod, x: x + (i % 3) - 1, z: z + Math.floor(i / 3) - 1 });
            }
        }
        return squares;
    }

    private remeshAround(square: Square): void {
        for (const neighbour of this.neighboursOf(square)) {
            const name = squareName(neighbour);
            if (this.meshedWithout.delete(name) && this.wanted.has(name) && this.format === 'columns') {
                this.toMesh.set(name, { square: neighbour, since: performance.now() });
            }
        }
    }

    private lacksNeighbours(square: Square): boolean {
        return this.neighboursOf(square).some((neighbour) => this.wanted.has(squareName(neighbour)) && !this.room.has(neighbour));
    }

    /** Makes meshes for a moment, then lets messages in. */
    private pump(): void {
        if (this.isMeshing) {
            return;
        }
        this.isMeshing = true;
        setTimeout(() => {
            this.isMeshing = false;
            const begin = performance.now();
            let waits = false;
            for (const [name, { square, since }] of this.toMesh) {
                if (performance.now() - begin > MESHING_SLICE_MS) {
                    this.pump();
                    return;
                }
                const lacks = this.lacksNeighbours(square);
                if (lacks && begin - since < NEIGHBOUR_WAIT_MS) {
                    waits = true;
                    continue;
                }
                this.toMesh.delete(name);
                this.mesh(name, square, lacks);
            }
            if (waits) {
                setTimeout(() => this.pump(), 50);
            }
        }, 0);
    }

    private mesh(name: string, square: Square, lacks: boolean): void {
        const tile = this.wanted.get(name);
        if (tile === undefined || this.isClosed || !this.room.has(square)) {
            return;
        }
        const begin = performance.now();
        const mesh = this.room.mesh(square);
        this.meter.decoded('columns', performance.now() - begin, mesh.indices.length / 3);
        if (lacks) {
            this.meshedWithout.add(name);
        }
        this.show(tile, joinPieces([{ ...mesh, y: 0 }], this.surfaces));
    }

    private show(tile: Tile, mesh: TileMesh | null): void {
        if (!tile.isShown) {
            tile.isShown = true;
            this.meter.waited(performance.now() - tile.since);
        }
        this.shown.add(squareName(tile.square));
        this.host.show(tile.square, mesh, this.format);
    }
}
