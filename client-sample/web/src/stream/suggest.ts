// A place to begin at, for a URL that names none: over the land, near the world's middle, where much of
// the picture is relief and some of it water. Found on a coarse grid of heights out of columns, by walking
// rays over it.
import {
    ColumnRoom,
    Format,
    MaterialKind,
    PaletteKind,
    chunksOf,
    type Square,
    type TerraneClient,
} from 'terrane-client';

/** Heights every 2^4 columns tell a valley from a ridge, and stacks of that level are soon made. */
const LEVEL = 4;
/** Stacks from the middle to each side: 1,024 columns where stacks have 32. */
const REACH = 2;
/** Heights over the ground around to look from. */
const EYES_OVER_GROUND = [36, 75];
/** Slope of the way to the picture's lower edge. */
const LOWER_EDGE = -0.85;
const CANDIDATE_STEP = 4;
const DIRECTIONS = 24;
/** Half the picture, and rays on it. */
const HALF_ANGLE = 0.55;
const RAYS = 7;
const STEPS = 36;
/** So much of the picture's ground as water is enough, and so much relief (voxels, one sigma). */
const WATER_ENOUGH = 0.16;
const WATER_TOO_MUCH = 0.5;
const RELIEF_ENOUGH = 36;

export interface Suggested {
    x: number;
    y: number;
    z: number;
    yaw: number;
    pitch: number;
}

/** Heights in voxels by cell; the first cell stands at column (x0, z0). */
export interface HeightGrid {
    width: number;
    x0: number;
    z0: number;
    cell: number;
    ground: Float32Array;
    /** -Infinity: dry. */
    water: Float32Array;
}

export async function heightsAround(client: TerraneClient, module: WebAssembly.Module): Promise<HeightGrid> {
    const { hello } = client;
    const lod = Math.min(LEVEL, hello.levels - 1);
    const side = hello.chunkSide;
    const room = await ColumnRoom.open(module, hello);
    const squares: Square[] = [];
    for (let z = -REACH; z < REACH; ++z) {
        for (let x = -REACH; x < REACH; ++x) {
            squares.push({ lod, x, z });
        }
    }
    const keys = squares.flatMap((square) => chunksOf(square, hello));
    await client.requestChunks(keys, { format: Format.Columns, withoutFlow: true, priority: 4, onChunk: (chunk) => room.put(chunk) });
    const width = 2 * REACH * side;
    const ground = new Float32Array(width * width);
    const water = new Float32Array(width * width).fill(-Infinity);
    const contents = room.palette().map(({ kind, shares }) => ({
        isSolid: kind === PaletteKind.Layer || kind === PaletteKind.Vein,
        isWater: hello.materials[shares[0]?.material ?? -1]?.kind === MaterialKind.Water,
    }));
    for (const square of squares) {
        const { offsets, y256, paletteIds } = room.columns(square);
        for (let i = 0; i < side * side; ++i) {
            const at = (square.x + REACH) * side + (i % side) + width * ((square.z + REACH) * side + Math.floor(i / side));
            for (let limit = offsets[i]!; limit < offsets[i + 1]!; ++limit) {
                const { isSolid, isWater } = contents[paletteIds[limit]!]!;
                if (isSolid) {
                    ground[at] = y256[limit]! / 256;
                } else if (isWater) {
                    water[at] = y256[limit]! / 256;
                }
            }
            if (water[at]! <= ground[at]!) {
                water[at] = -Infinity;
            }
        }
    }
    const cell = 2 ** lod;
    return { width, x0: -REACH * side * cell, z0: -REACH * side * cell, cell, ground, water };
}

/** What one would see from a cell: the spread of heights, the share of the picture's ground that is water,
 * the share of rays' ground that is in sight. */
function seen(grid: HeightGrid, at: number, eye: number, yaw: number) {
    const { width, cell, ground, water } = grid;
    const [cx, cz] = [at % width, Math.floor(at / width)];
    let count = 0;
    let area = 0;
    let wet = 0;
    let sum = 0;
    let squares = 0;
    let total = 0;
    let lowest = 0;
    for (let ray = 0; ray < RAYS; ++ray) {
        const angle = yaw + HALF_ANGLE * ((2 * ray) / (RAYS - 1) - 1);
        const [dx, dz] = [Math.sin(angle), Math.cos(angle)];
        let horizon = -Infinity;
        for (let step = 2; step <= STEPS; ++step) {
            const [x, z] = [Math.round(cx + dx * step), Math.round(cz + dz * step)];
            if (x < 0 || z < 0 || x >= width || z >= width) {
                break;
            }
            ++total;
            const cellAt = x + z * width;
            const height = Math.max(ground[cellAt]!, water[cellAt]!);
            const slope = (height - eye) / (step * cell);
            if (slope < horizon) {
                continue;
            }
            // As tall as it stands in the picture.
            const tall = Math.max(slope - Math.max(horizon, LOWER_EDGE), 0);
            horizon = slope;
            area += tall;
            wet += water[cellAt]! > -Infinity ? tall : 0;
            ++count;
            sum += height;
            squares += height * height;
            lowest += slope;
        }
    }
    const mean = sum / Math.max(count, 1);
    return {
        relief: Math.sqrt(Math.max(squares / Math.max(count, 1) - mean * mean, 0)),
        water: wet / Math.max(area, 0.1),
        share: count / Math.max(total, 1),
        isWhole: total >= RAYS * (STEPS - 1),
        slope: lowest / Math.max(count, 1),
    };
}

/** `sunYaw`: the way to the sun; light from the side shows shapes. */
export function bestPlace(grid: HeightGrid, sunYaw: number): Suggested | undefined {
    const { width, cell, ground, water } = grid;
    let best: Suggested | undefined;
    let bestScore = -Infinity;
    for (let z = CANDIDATE_STEP; z < width - CANDIDATE_STEP; z += CANDIDATE_STEP) {
        for (let x = CANDIDATE_STEP; x < width - CANDIDATE_STEP; x += CANDIDATE_STEP) {
            const at = x + z * width;
            let under = Math.max(ground[at]!, water[at]!);
            for (const beside of [at - 1, at + 1, at - width, at + width]) {
                under = Math.max(under, ground[beside]!);
            }
            const away = Math.hypot(x - width / 2, z - width / 2) / width;
            for (let i = 0; i < DIRECTIONS * EYES_OVER_GROUND.length; ++i) {
                const yaw = ((i % DIRECTIONS) / DIRECTIONS) * 2 * Math.PI;
                const eye = under + EYES_OVER_GROUND[Math.floor(i / DIRECTIONS)]!;
                const { relief, water: wet, share, isWhole, slope } = seen(grid, at, eye, yaw);
                if (!isWhole) {
                    continue;
                }
                const score =
                    Math.min(relief / RELIEF_ENOUGH, 1) +
                    1.1 * Math.min(wet / WATER_ENOUGH, 1) - 2 * Math.max(wet - WATER_TOO_MUCH, 0) +
                    0.6 * Math.min(share / 0.5, 1) -
                    0.35 * Math.max(Math.cos(yaw - sunYaw), 0) -
                    0.3 * away;
                if (score > bestScore) {
                    bestScore = score;
                    const pitch = Math.min(Math.max(Math.atan(slope) * 0.8, -0.38), -0.1);
                    best = { x: grid.x0 + x * cell, y: eye, z: grid.z0 + z * cell, yaw, pitch };
                }
            }
        }
    }
    return best;
}
