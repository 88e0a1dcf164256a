// Loads stacks of columns into a room for whoever looks inside: a few at a time, nearest first as they
// were asked for. A stack that is there without flow is loaded again when flow is wanted.
import { Format, chunksOf, squareName, type ColumnRoom, type Square, type TerraneClient } from 'terrane-client';

const UNDER_WAY_MAX = 12;

export class ColumnLoads {
    /** Squares whose columns came without flow. */
    readonly flowless = new Set<string>();
    private queue: { square: Square; withFlow: boolean }[] = [];
    private readonly underWay = new Set<string>();

    constructor(
        private readonly client: TerraneClient,
        private readonly room: ColumnRoom,
        private readonly arrived: (square: Square) => void,
    ) {}

    has(square: Square, withFlow: boolean): boolean {
        return this.room.has(square) && !(withFlow && this.flowless.has(squareName(square)));
    }

    /** Replaces what waits: the squares that are not there yet, in this order. */
    want(squares: Square[], withFlow: boolean, keep: boolean): void {
        const missing = squares.filter((square) => !this.has(square, withFlow));
        const added = missing.map((square) => ({ square, withFlow }));
        const names = new Set(missing.map(squareName));
        this.queue = keep
            ? [...added, ...this.queue.filter(({ square }) => !names.has(squareName(square)))]
            : added;
        this.next();
    }

    get length(): number {
        return this.queue.length + this.underWay.size;
    }

    private next(): void {
        while (this.underWay.size < UNDER_WAY_MAX && this.queue.length > 0) {
            const { square, withFlow } = this.queue.shift()!;
            const name = squareName(square);
            if (this.underWay.has(name) || this.has(square, withFlow)) {
                continue;
            }
            this.underWay.add(name);
            this.load(square, withFlow)
                .then(() => this.arrived(square))
                .catch(() => {}) // The session ended or the server is busy: asked for again when wanted.
                .finally(() => {
                    this.underWay.delete(name);
                    this.next();
                });
        }
    }

    private async load(square: Square, withFlow: boolean): Promise<void> {
        const chunks = await this.client.requestChunks(chunksOf(square, this.client.hello), {
            format: Format.Columns,
            withoutFlow: !withFlow,
            priority: 4,
        });
        if (this.has(square, withFlow)) {
            return;
        }
        this.room.drop(square);
        this.flowless.delete(squareName(square));
        chunks.forEach((chunk) => this.room.put(chunk));
        if (!withFlow) {
            this.flowless.add(squareName(square));
        }
    }
}
