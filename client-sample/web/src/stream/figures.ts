// What the panel shows of the stream: rates over the last seconds, waits over the last tiles.
import { Source, type Chunk } from 'terrane-client';

import type { FormatFigures, StreamFigures, WireFormat } from './messages';

const RATE_WINDOW_MS = 3000;
const WAITS_MAX = 400;

function noFigures(): FormatFigures {
    return { chunks: 0, bytes: 0, triangles: 0, clientMs: 0, generateUs: 0, meshUs: 0, encodeUs: 0, made: 0 };
}

export class Meter {
    private chunks = 0;
    private bytes = 0;
    private readonly recent: { at: number; bytes: number }[] = [];
    private readonly waits: number[] = [];
    readonly formats: Record<WireFormat, FormatFigures> = { draco: noFigures(), columns: noFigures() };

    came(chunk: Chunk, format: WireFormat): void {
        const bytes = chunk.payload.byteLength;
        ++this.chunks;
        this.bytes += bytes;
        this.recent.push({ at: performance.now(), bytes });
        const figures = this.formats[format];
        if (bytes > 0) {
            ++figures.chunks;
            figures.bytes += bytes;
        }
        if (bytes > 0 && chunk.source !== Source.Cache) {
            ++figures.made;
            figures.generateUs += chunk.timings.generateUs;
            figures.meshUs += chunk.timings.meshUs;
            figures.encodeUs += chunk.timings.encodeUs;
        }
    }

    decoded(format: WireFormat, ms: number, triangles: number): void {
        this.formats[format].clientMs += ms;
        this.formats[format].triangles += triangles;
    }

    waited(ms: number): void {
        this.waits.push(ms);
        if (this.waits.length > WAITS_MAX) {
            this.waits.shift();
        }
    }

    figures(): Pick<
        StreamFigures,
        'chunks' | 'bytes' | 'chunksPerSecond' | 'bytesPerSecond' | 'waitP50Ms' | 'waitP99Ms' | 'formats'
    > {
        const since = performance.now() - RATE_WINDOW_MS;
        while (this.recent.length > 0 && this.recent[0]!.at < since) {
            this.recent.shift();
        }
        const sorted = [...this.waits].sort((a, b) => a - b);
        const quantile = (share: number) => sorted[Math.floor(share * (sorted.length - 1))] ?? 0;
        const perSecond = 1000 / RATE_WINDOW_MS;
        return {
            chunks: this.chunks,
            bytes: this.bytes,
            chunksPerSecond: this.recent.length * perSecond,
            bytesPerSecond: this.recent.reduce((sum, { bytes }) => sum + bytes, 0) * perSecond,
            waitP50Ms: quantile(0.5),
            waitP99Ms: quantile(0.99),
            formats: this.formats,
        };
    }
}
