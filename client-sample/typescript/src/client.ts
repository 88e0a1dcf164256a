// A Terrane client in one object. See README.md for its use.
//
// The library keeps to the server's limits: keys are split over requests, no more are under way than
// the server takes, and a `busy` key is asked for again after the time that the server names. Chunks
// of a view are credited when the `onChunk` handler has dealt with them: if it gives a promise, when
// that settles, so that a slow decoder slows the server down and nothing piles up.
import * as codec from './codec.js';
import {
    FailureCode,
    TerraneError,
    keyName,
    type Chunk,
    type ChunkKey,
    type Column,
    type Format,
    type ServerHello,
    type View,
    type World,
} from './messages.js';
import { connectWebSocket, type Transport } from './transport.js';

/** A busy key is given up after this many tries, some 30 s from a first pause of 50 ms. */
const BUSY_TRIES_MAX = 12;
const BUSY_PAUSE_MS_MAX = 5000;
const HELLO_TIMEOUT_MS = 10_000;
/** Keys that wait for their turn or answer; a further request is refused. */
const UNANSWERED_MAX = 1 << 20;
/** Credit is sent for at least this share of the window, or when nothing else is being consumed. */
const CREDIT_SHARE = 1 / 8;

export interface ClientOptions {
    /** What the server logs. */
    name?: string;
    token?: string;
}

export interface ChunkRequestOptions extends codec.RequestOptions {
    /** Told of each chunk; failed keys are told by the promise. */
    onChunk?: (chunk: Chunk) => void;
    signal?: AbortSignal;
}

interface Wanted {
    key: ChunkKey;
    etag: string;
    request: Request;
    tries: number;
}

interface Request {
    options: ChunkRequestOptions;
    left: number;
    chunks: Chunk[];
    failures: TerraneError[];
    isCancelled: boolean;
    resolve: (chunks: Chunk[]) => void;
    reject: (error: Error) => void;
}

interface Query {
    resolve: (answer: never) => void;
    reject: (error: Error) => void;
}

export class TerraneClient {
    readonly hello: ServerHello;

    /** Chunks of the view. Give a promise to be credited when it settles. */
    onViewChunk: (chunk: Chunk) => void | Promise<void> = () => {};
    /** Chunks that have left the view. */
    onForget: (keys: ChunkKey[]) => void = () => {};
    /** Once, when the session ends; without a reason it was `close`. */
    onClose: (reason?: string) => void = () => {};

    /** Bytes of frames that came. */
    bytesReceived = 0;
    chunksReceived = 0;

    private nextId = 1;
    private readonly waiting: Wanted[] = [];
    private readonly underWay = new Map<number, Map<string, Wanted>>();
    private keysUnderWay = 0;
    private keysPaused = 0;
    private readonly queries = new Map<number, Query>();
    private readonly pings = new Map<bigint, () => void>();
    private nextNonce = 1n;
    private creditDue = 0;
    private consuming = 0;
    private isDraining = false;
    private closeReason: string | undefined | null = null;
    private isSendDue = false;

    private constructor(
        private readonly transport: Transport,
        hello: ServerHello,
    ) {
        this.hello = hello;
        transport.onFrame = (frame) => this.receive(frame);
        transport.onClose = (reason) => this.end(reason);
    }

    /** Greets the server over a connection that is open, or over a WebSocket to a URL. */
    static async connect(to: Transport | string, options: ClientOptions = {}): Promise<TerraneClient> {
        const transport = typeof to === 'string' ? await connectWebSocket(to) : to;
        const early: Uint8Array[] = [];
        const hello = await new Promise<ServerHello>((resolve, reject) => {
            const timer = setTimeout(
                () => reject(new Error(`no greeting in ${HELLO_TIMEOUT_MS / 1000} s`)),
                HELLO_TIMEOUT_MS,
            );
            transport.onClose = (reason) => {
                clearTimeout(timer);
                reject(new Error(reason ?? 'the connection ended'));
            };
            let greeted = false;
            transport.onFrame = (frame) => {
                if (greeted) {
                    early.push(frame);
                    return;
                }
                greeted = true;
                clearTimeout(timer);
                try {
                    const message = codec.decode(frame);
                    if (message.kind === 'hello') {
                        resolve(message.hello);
                    } else if (message.kind === 'failure') {
                        reject(new TerraneError(message.failure.code, message.failure.message));
                    } else {
                        reject(new Error(`the server greeted with ${message.kind}`));
                    }
                } catch (error) {
                    reject(error as Error);
                }
            };
            transport.send(
                codec.clientHello({
                    name: options.name ?? 'terrane-client (TypeScript)',
                    token: options.token ?? '',
                }),
            );
        }).catch((error: unknown) => {
            transport.onClose = undefined;
            transport.close();
            throw error;
        });
        const client = new TerraneClient(transport, hello);
        for (const frame of early) {
            client.receive(frame);
        }
        return client;
    }

    get isOpen(): boolean {
        return this.closeReason === null;
    }

    /** Whether the server streams views; without, ask for chunks. */
    get hasViews(): boolean {
        return this.hello.limits.viewRadiusMax > 0;
    }

    /** Keys and queries without an answer. */
    get unanswered(): number {
        return this.waiting.length + this.keysUnderWay + this.keysPaused + this.queries.size;
    }

    /**
     * Asks for any number of chunks. Resolves when all have come, in the order they came; rejects
     * with the first failure once all are answered, or at once when the session ends.
     */
    requestChunks(keys: ChunkKey[], options: ChunkRequestOptions): Promise<Chunk[]> {
        return new Promise((resolve, reject) => {
            if (!this.isOpen) {
                reject(new Error(this.closeReason ?? 'the client is closed'));
                return;
            }
            if (this.unanswered + keys.length > UNANSWERED_MAX) {
                reject(new TerraneError(FailureCode.Busy, `${UNANSWERED_MAX} keys wait already`));
                return;
            }
            const request: Request = {
                options,
                left: keys.length,
                chunks: [],
                failures: [],
                isCancelled: false,
                resolve,
                reject,
            };
            if (keys.length === 0) {
                resolve([]);
                return;
            }
            options.signal?.addEventListener('abort', () => this.cancel(request), { once: true });
            if (options.signal?.aborted) {
                reject(new TerraneError(FailureCode.Cancelled, 'cancelled'));
                return;
            }
            keys.forEach((key, i) => {
                this.enqueue({ key, etag: options.knownEtags?.[i] ?? '', request, tries: 0 });
            });
            this.sendSoon();
        });
    }

    async requestChunk(key: ChunkKey, format: Format): Promise<Chunk> {
        return (await this.requestChunks([key], { format }))[0]!;
    }

    /** The limits of one column, bottom first. */
    queryColumn(x: number, z: number): Promise<Column> {
        return this.query((id) => codec.columnQuery(id, x, z));
    }

    /** The canonical world file, if the server publishes it. */
    queryWorld(): Promise<World> {
        return this.query((id) => codec.worldQuery(id));
    }

    /** Replaces what is wanted. Radii are clamped to what the server takes. */
    updateView(view: View): void {
        const most = this.hello.limits.viewRadiusMax;
        const radiusChunks = view.radiusChunks
            .slice(0, this.hello.levels)
            .map((radius) => Math.min(radius, most));
        this.send(codec.viewUpdate({ ...view, radiusChunks }));
    }

    /** Milliseconds to the server and back. */
    ping(): Promise<number> {
        return new Promise((resolve, reject) => {
            if (!this.isOpen) {
                reject(new Error('the client is closed'));
                return;
            }
            const nonce = this.nextNonce++;
            const begin = performance.now();
            this.pings.set(nonce, () => resolve(performance.now() - begin));
            this.send(codec.ping(nonce));
        });
    }

    close(): void {
        if (this.isOpen) {
            this.send(codec.goodbye());
            this.end();
            this.transport.close();
        }
    }

    private send(frame: Uint8Array): void {
        if (this.isOpen) {
            this.transport.send(frame);
        }
    }

    private query<Answer>(frame: (id: number) => Uint8Array): Promise<Answer> {
        return new Promise((resolve, reject) => {
            if (!this.isOpen) {
                reject(new Error(this.closeReason ?? 'the client is closed'));
                return;
            }
            const id = this.takeId();
            this.queries.set(id, { resolve: resolve as (answer: never) => void, reject });
            this.send(frame(id));
        });
    }

    private takeId(): number {
        do {
            this.nextId = this.nextId >= 0xffffffff ? 1 : this.nextId + 1;
        } while (this.underWay.has(this.nextId) || this.queries.has(this.nextId));
        return this.nextId;
    }

    /** Keeps what waits in order of priority, first come first among equals. */
    private enqueue(wanted: Wanted): void {
        const priority = wanted.request.options.priority ?? 0;
        let at = this.waiting.length;
        while (at > 0 && (this.waiting[at - 1]!.request.options.priority ?? 0) < priority) {
            --at;
        }
        this.waiting.splice(at, 0, wanted);
    }

    private sendSoon(): void {
        if (!this.isSendDue) {
            this.isSendDue = true;
            queueMicrotask(() => {
                this.isSendDue = false;
                this.sendWaiting();
            });
        }
    }

    /** Sends as many requests as the server takes; keys of one request share its options. */
    private sendWaiting(): void {
        const { keysPerRequestMax, keysInFlightMax } = this.hello.limits;
        while (this.isOpen && !this.isDraining && this.waiting.length > 0) {
            const room = Math.min(keysPerRequestMax, keysInFlightMax - this.keysUnderWay);
            if (room <= 0) {
                return;
            }
            const { options } = this.waiting[0]!.request;
            let count = 1;
            while (
                count < room &&
                count < this.waiting.length &&
                this.waiting[count]!.request.options === options
            ) {
                ++count;
            }
            const batch = new Map<string, Wanted>();
            while (count > 0 && !batch.has(keyName(this.waiting[0]!.key))) {
                const wanted = this.waiting.shift()!;
                batch.set(keyName(wanted.key), wanted);
                --count;
            }
            const id = this.takeId();
            this.underWay.set(id, batch);
            this.keysUnderWay += batch.size;
            const sent = [...batch.values()];
            this.send(
                codec.chunkRequest(id, sent.map((wanted) => wanted.key), {
                    ...options,
                    knownEtags: options.knownEtags && sent.map((wanted) => wanted.etag),
                }),
            );
        }
    }

    private cancel(request: Request): void {
        if (request.left === 0 || request.isCancelled) {
            return;
        }
        request.isCancelled = true;
        for (let i = this.waiting.length - 1; i >= 0; --i) {
            if (this.waiting[i]!.request === request) {
                this.waiting.splice(i, 1);
            }
        }
        const ids = [...this.underWay]
            .filter(([, batch]) => [...batch.values()].some((wanted) => wanted.request === request))
            .map(([id]) => id);
        if (ids.length > 0) {
            this.send(codec.chunkCancel(ids));
        }
        request.reject(new TerraneError(FailureCode.Cancelled, 'cancelled'));
    }

    private receive(frame: Uint8Array): void {
        if (!this.isOpen) {
            return;
        }
        this.bytesReceived += frame.byteLength;
        let message: codec.Incoming;
        try {
            message = codec.decode(frame);
        } catch (error) {
            this.end(`the server broke the protocol: ${(error as Error).message}`);
            this.transport.close();
            return;
        }
        switch (message.kind) {
            case 'chunk':
                this.receiveChunk(message.chunk);
                break;
            case 'failure':
                this.receiveFailure(message.failure);
                break;
            case 'column':
                this.answer(message.requestId, message.column);
                break;
            case 'world':
                this.answer(message.requestId, message.world);
                break;
            case 'forget':
                this.onForget(message.keys);
                break;
            case 'ping':
                this.send(codec.pong(message.nonce));
                break;
            case 'pong':
                this.pings.get(message.nonce)?.();
                this.pings.delete(message.nonce);
                break;
            case 'goodbye':
                this.isDraining = true;
                if (this.underWay.size === 0) {
                    this.end(message.reason || 'the server says goodbye');
                    this.transport.close();
                }
                break;
            case 'hello':
            case 'unknown':
                break;
        }
    }

    private answer(id: number, value: unknown): void {
        const query = this.queries.get(id);
        this.queries.delete(id);
        query?.resolve(value as never);
    }

    private receiveChunk(chunk: Chunk): void {
        ++this.chunksReceived;
        if (chunk.requestId === 0) {
            this.consume(chunk);
            return;
        }
        const wanted = this.take(chunk.requestId, chunk.key);
        if (wanted !== undefined && !wanted.request.isCancelled) {
            wanted.request.chunks.push(chunk);
            wanted.request.options.onChunk?.(chunk);
            this.finishOne(wanted.request);
        }
        this.sendSoon();
    }

    private consume(chunk: Chunk): void {
        const bytes = chunk.payload.byteLength;
        let done: void | Promise<void>;
        ++this.consuming;
        const credit = () => {
            --this.consuming;
            this.creditDue += bytes;
            const least = this.hello.limits.creditWindowBytes * CREDIT_SHARE;
            if (this.creditDue > 0 && (this.creditDue >= least || this.consuming === 0)) {
                this.send(codec.credit(this.creditDue));
                this.creditDue = 0;
            }
        };
        try {
            done = this.onViewChunk(chunk);
        } catch (error) {
            credit();
            throw error;
        }
        if (done instanceof Promise) {
            done.then(credit, credit);
        } else {
            credit();
        }
    }

    private take(id: number, key: ChunkKey): Wanted | undefined {
        const batch = this.underWay.get(id);
        const wanted = batch?.get(keyName(key));
        if (batch !== undefined && wanted !== undefined) {
            batch.delete(keyName(key));
            --this.keysUnderWay;
            if (batch.size === 0) {
                this.underWay.delete(id);
            }
        }
        return wanted;
    }

    private receiveFailure(failure: codec.Failure): void {
        const error = new TerraneError(failure.code, failure.message, failure.retryAfterMs);
        if (failure.requestId === 0) {
            // Of the whole session; what ends it is followed by the end. A kind of message that an
            // older server does not know is no reason to stop.
            if (failure.code !== FailureCode.Unsupported) {
                this.end(failure.message);
                this.transport.close();
            }
            return;
        }
        const query = this.queries.get(failure.requestId);
        if (query !== undefined) {
            this.queries.delete(failure.requestId);
            query.reject(error);
            return;
        }
        const batch = this.underWay.get(failure.requestId);
        const keys = failure.key ? [failure.key] : [...(batch?.values() ?? [])].map(({ key }) => key);
        for (const key of keys) {
            const wanted = this.take(failure.requestId, key);
            if (wanted === undefined || wanted.request.isCancelled) {
                continue;
            }
            const canRetry =
                failure.code === FailureCode.Busy ||
                // Another request of ours shared its id with one that was cancelled.
                failure.code === FailureCode.Cancelled;
            if (canRetry && wanted.tries < BUSY_TRIES_MAX) {
                this.retry(wanted, failure.retryAfterMs);
            } else {
                wanted.request.failures.push(error);
                this.finishOne(wanted.request);
            }
        }
        this.sendSoon();
    }

    private retry(wanted: Wanted, afterMs: number): void {
        const pause = Math.min(Math.max(afterMs, 1) * 2 ** wanted.tries, BUSY_PAUSE_MS_MAX);
        ++wanted.tries;
        ++this.keysPaused;
        setTimeout(() => {
            --this.keysPaused;
            if (this.isOpen && !wanted.request.isCancelled) {
                this.enqueue(wanted);
                this.sendWaiting();
            }
        }, pause);
    }

    private finishOne(request: Request): void {
        if (--request.left > 0) {
            return;
        }
        if (request.failures.length > 0) {
            request.reject(request.failures[0]!);
        } else {
            request.resolve(request.chunks);
        }
    }

    private end(reason?: string): void {
        if (!this.isOpen) {
            return;
        }
        this.closeReason = reason;
        const error = new Error(reason ?? 'the client was closed');
        const requests = new Set(this.waiting.map((wanted) => wanted.request));
        for (const batch of this.underWay.values()) {
            for (const wanted of batch.values()) {
                requests.add(wanted.request);
            }
        }
        this.waiting.length = 0;
        this.underWay.clear();
        this.keysUnderWay = 0;
        requests.forEach((request) => request.reject(error));
        this.queries.forEach((query) => query.reject(error));
        this.queries.clear();
        this.onClose(reason);
    }
}
