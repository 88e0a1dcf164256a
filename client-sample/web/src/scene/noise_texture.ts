// Tileable noise for detail, made once at the start: heights of four kinds of ground in one texture and
// the slopes of two of them in another. Mipmaps keep far ground calm.
import * as THREE from 'three';

const SIZE = 256;

/** A lattice of random gradients that repeats, smoothed: Perlin's noise of 1985 on a torus. */
function makeNoise(seed: number): (x: number, y: number, period: number) => number {
    const hash = (x: number, y: number) => {
        let h = Math.imul(x, 374761393) + Math.imul(y, 668265263) + Math.imul(seed, 974634777);
        h = Math.imul(h ^ (h >>> 13), 1274126177);
        return ((h ^ (h >>> 16)) >>> 0) / 4294967296;
    };
    // The page waits for these textures: each gradient is made once, not once a texel.
    const tables = new Map<number, Float32Array>();
    const tableOf = (period: number) => {
        const table = new Float32Array(2 * period * period);
        for (let i = 0; i < period * period; ++i) {
            const angle = hash(i % period, Math.floor(i / period)) * Math.PI * 2;
            table[2 * i] = Math.cos(angle);
            table[2 * i + 1] = Math.sin(angle);
        }
        tables.set(period, table);
        return table;
    };
    const fade = (t: number) => t * t * t * (t * (t * 6 - 15) + 10);
    return (x, y, period) => {
        const table = tables.get(period) ?? tableOf(period);
        const x0 = Math.floor(x);
        const y0 = Math.floor(y);
        const dx = x - x0;
        const dy = y - y0;
        const left = ((x0 % period) + period) % period;
        const right = left + 1 === period ? 0 : left + 1;
        const low = (((y0 % period) + period) % period) * period;
        const high = low + period === period * period ? 0 : low + period;
        const at = (i: number, byX: number, byY: number) => table[2 * i]! * byX + table[2 * i + 1]! * byY;
        const u = fade(dx);
        const a = at(low + left, dx, dy);
        const b = at(high + left, dx, dy - 1);
        const lower = a + u * (at(low + right, dx - 1, dy) - a);
        const upper = b + u * (at(high + right, dx - 1, dy - 1) - b);
        return (lower + fade(dy) * (upper - lower)) * 1.4;
    };
}

/** Distance to the edge between the two nearest of scattered points: cracks. */
function makeCracks(seed: number, cells: number): (x: number, y: number) => number {
    const random = (wrapped: number, which: number) => {
        let h = Math.imul(wrapped + 1, 2654435761) ^ Math.imul(seed + which, 2246822519);
        h = Math.imul(h ^ (h >>> 15), 2246822519);
        return ((h ^ (h >>> 13)) >>> 0) / 4294967296;
    };
    const points = Float32Array.from({ length: 2 * cells * cells }, (_, i) => random(i >> 1, 1 + (i & 1)));
    return (x, y) => {
        let nearest = Infinity;
        let second = Infinity;
        const ix = Math.floor(x);
        const iy = Math.floor(y);
        for (let dy = -1; dy <= 1; ++dy) {
            const row = ((((iy + dy) % cells) + cells) % cells) * cells;
            for (let dx = -1; dx <= 1; ++dx) {
                const cell = row + ((((ix + dx) % cells) + cells) % cells);
                const px = ix + dx + points[2 * cell]! - x;
                const py = iy + dy + points[2 * cell + 1]! - y;
                const distance = px * px + py * py;
                if (distance < nearest) {
                    second = nearest;
                    nearest = distance;
                } else if (distance < second) {
                    second = distance;
                }
            }
        }
        return Math.sqrt(second) - Math.sqrt(nearest);
    };
}

function field(sample: (u: number, v: number) => number): Float32Array {
    const values = new Float32Array(SIZE * SIZE);
    let least = Infinity;
    let most = -Infinity;
    for (let y = 0; y < SIZE; ++y) {
        for (let x = 0; x < SIZE; ++x) {
            const value = sample(x / SIZE, y / SIZE);
            values[y * SIZE + x] = value;
            least = Math.min(least, value);
            most = Math.max(most, value);
        }
    }
    return values.map((value) => (value - least) / (most - least));
}

function texture(channels: Float32Array[]): THREE.DataTexture {
    const data = new Uint8Array(SIZE * SIZE * 4);
    channels.forEach((values, channel) => {
        values.forEach((value, i) => (data[4 * i + channel] = Math.round(Math.min(Math.max(value, 0), 1) * 255)));
    });
    const made = new THREE.DataTexture(data, SIZE, SIZE, THREE.RGBAFormat);
    made.wrapS = made.wrapT = THREE.RepeatWrapping;
    made.magFilter = THREE.LinearFilter;
    made.minFilter = THREE.LinearMipmapLinearFilter;
    made.generateMipmaps = true;
    made.needsUpdate = true;
    return made;
}

/** Half the slope along x and y, around 1/2. */
function slopes(values: Float32Array, strength: number): [Float32Array, Float32Array] {
    const at = (x: number, y: number) => values[((y + SIZE) % SIZE) * SIZE + ((x + SIZE) % SIZE)]!;
    const along = (dx: number, dy: number) =>
        values.map((_, i) => {
            const x = i % SIZE;
            const y = Math.floor(i / SIZE);
            return 0.5 + strength * (at(x + dx, y + dy) - at(x - dx, y - dy));
        });
    return [along(1, 0), along(0, 1)];
}

export interface DetailTextures {
    /** Rock, soil, grass, large patches. */
    heights: THREE.DataTexture;
    /** Slopes of rock in red and green, of soil in blue and alpha. */
    slopes: THREE.DataTexture;
}

export function makeDetailTextures(): DetailTextures {
    const noise = makeNoise(7);
    const octaves = (u: number, v: number, period: number, count: number, gain = 0.5) => {
        let sum = 0;
        let amount = 1;
        for (let i = 0; i < count; ++i, period *= 2, amount *= gain) {
            sum += amount * noise(u * period, v * period, period);
        }
        return sum;
    };
    const cracks = makeCracks(3, 6);
    const fineCracks = makeCracks(11, 17);
    const rock = field((u, v) => {
        const bend = 0.35 * octaves(u, v, 4, 3);
        const wide = Math.min(cracks(u * 6 + bend, v * 6 - bend) * 2.2, 1);
        const fine = Math.min(fineCracks(u * 17, v * 17) * 2.5, 1);
        return 0.55 * wide ** 0.6 + 0.2 * fine ** 0.5 + 0.55 * octaves(u, v, 6, 5, 0.55);
    });
    const soil = field((u, v) => {
        const pebbles = 1 - Math.min(makePebble(fineCracks, u, v), 1);
        return octaves(u, v, 8, 5, 0.62) + 0.35 * pebbles;
    });
    const grass = field((u, v) => octaves(u, v, 10, 5, 0.78));
    const patches = field((u, v) => octaves(u, v, 3, 5, 0.5));
    return {
        heights: texture([rock, soil, grass, patches]),
        slopes: texture([...slopes(rock, 1.6), ...slopes(soil, 1.6)]),
    };
}

function makePebble(cracks: (x: number, y: number) => number, u: number, v: number): number {
    return 1.6 * cracks(u * 17 + 5, v * 17 + 9);
}
