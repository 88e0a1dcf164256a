// How much the picture may cost. It starts from what draws (a software rasteriser starts low), then
// follows the frame time; a step that turned out too dear is not tried again for a while.
import type { Detail } from './terrain_material';

export interface Quality {
    name: string;
    pixelRatio: number;
    detail: Detail;
    /** Side of the shadow map; 0: none. */
    shadows: number;
    radiusChunks: number[];
}

/** Rings of eight levels: the coarsest reaches four sides of 128 chunks, 512 chunk sides. */
export const QUALITIES: Quality[] = [
    { name: 'least', pixelRatio: 0.5, detail: 0, shadows: 0, radiusChunks: [2, 2, 2, 2, 2, 2, 2, 4] },
    { name: 'low', pixelRatio: 0.75, detail: 0, shadows: 1024, radiusChunks: [3, 2, 2, 2, 2, 2, 2, 4] },
    { name: 'medium', pixelRatio: 1, detail: 1, shadows: 2048, radiusChunks: [5, 4, 3, 3, 3, 3, 3, 4] },
    { name: 'high', pixelRatio: 1.5, detail: 2, shadows: 2048, radiusChunks: [7, 5, 5, 4, 4, 4, 4, 4] },
    { name: 'best', pixelRatio: 2, detail: 2, shadows: 4096, radiusChunks: [10, 7, 6, 6, 5, 5, 5, 4] },
];

const SLOW_MS = 42;
const FAST_MS = 18.5;
const DOWN_AFTER_S = 2;
const UP_AFTER_S = 5;
const RETRY_AFTER_S = 90;

export class QualityControl {
    level: number;
    private slowFor = 0;
    private fastFor = 0;
    private clock = 0;
    private readonly failedAt = new Map<number, number>();

    constructor(
        renderer: string,
        isSoftware: boolean,
        private readonly fixed: number | undefined,
    ) {
        const isMobile = /mali|adreno|powervr|apple gpu/i.test(renderer);
        this.level = fixed ?? (isSoftware ? 0 : isMobile ? 2 : 3);
    }

    get now(): Quality {
        return QUALITIES[this.level]!;
    }

    /** Takes the time of a frame that was drawn; true if the quality has changed. */
    frame(ms: number): boolean {
        const seconds = Math.min(ms, 250) / 1000;
        this.clock += seconds;
        this.slowFor = ms > SLOW_MS ? this.slowFor + seconds : Math.max(0, this.slowFor - seconds);
        this.fastFor = ms < FAST_MS ? this.fastFor + seconds : 0;
        if (this.fixed !== undefined) {
            return false;
        }
        if (this.slowFor > DOWN_AFTER_S && this.level > 0) {
            this.failedAt.set(this.level, this.clock);
            return this.change(-1);
        }
        const triedAt = this.failedAt.get(this.level + 1);
        const mayRise = triedAt === undefined || this.clock - triedAt > RETRY_AFTER_S;
        return this.fastFor > UP_AFTER_S && this.level < QUALITIES.length - 1 && mayRise && this.change(1);
    }

    private change(by: number): boolean {
        this.level += by;
        this.slowFor = this.fastFor = 0;
        return true;
    }
}
