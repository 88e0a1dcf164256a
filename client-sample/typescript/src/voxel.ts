// What is at a height of a column: the same rule as the server's (generator/volume/voxel.h).
import type { ColumnLimit, Share } from './messages.js';

export interface Voxel {
    shares: Share[];
    flow: [number, number, number];
}

/** The mix at any height, in 1/256 voxel: between two limits everything is interpolated. */
export function mixAt(limits: ColumnLimit[], y256: number): Voxel {
    let above = 0;
    while (above < limits.length && limits[above]!.y256 <= y256) {
        ++above;
    }
    if (limits.length === 0) {
        return { shares: [], flow: [0, 0, 0] };
    }
    if (above === 0 || above === limits.length) {
        const only = limits[Math.max(above - 1, 0)]!;
        return { shares: only.composition, flow: only.flow };
    }
    const low = limits[above - 1]!;
    const high = limits[above]!;
    const t = (y256 - low.y256) / (high.y256 - low.y256);
    const shares = low.composition
        .map(({ material, concentration }) => ({ material, concentration: concentration * (1 - t) }));
    for (const { material, concentration } of high.composition) {
        const known = shares.find((share) => share.material === material);
        if (known !== undefined) {
            known.concentration += concentration * t;
        } else {
            shares.push({ material, concentration: concentration * t });
        }
    }
    const flow = low.flow.map((value, i) => Math.round(value + t * (high.flow[i]! - value)));
    return {
        shares: shares.filter((share) => share.concentration > 0),
        flow: flow as [number, number, number],
    };
}

/** Voxel y of a column; its centre is at y + 1/2. */
export function voxelAt(limits: ColumnLimit[], y: number): Voxel {
    return mixAt(limits, y * 256 + 128);
}

/** The material with the largest share; the first of equals. */
export function mainMaterial(shares: Share[]): number {
    return shares.reduce((most, share) => (share.concentration > most.concentration ? share : most), {
        material: -1,
        concentration: 0,
    }).material;
}
