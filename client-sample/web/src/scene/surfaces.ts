// What a material's surface looks like, from its kind and its name. Unknown names look like rock.
import { MaterialKind, type Material } from 'terrane-client';

/** Shares of 255: grass, loose soil, gloss, snow. All 0: rock. */
export type Surface = [grass: number, soil: number, gloss: number, snow: number];

const RULES: [RegExp, Surface][] = [
    [/\b(turf|grass|moss|meadow|lawn|prairie|heath|fern|leaf)/i, [255, 40, 0, 0]],
    [/\b(snow|ice|glacier|frost|firn)/i, [0, 0, 60, 255]],
    [/\b(soil|clay|loam|mud|peat|silt|dirt|humus|earth|sand|dune|gravel|ash|till|scree)\b/i, [0, 255, 0, 0]],
    [/\b(marl|chalk|tuff|laterite|loess)/i, [0, 130, 0, 0]],
    [/\b(gold|silver|copper|iron|platinum|tin|lead|zinc|mithril|metal|pyrite|galena|ore)\b/i, [0, 0, 255, 0]],
    [/(crystal|quartz|amethyst|emerald|ruby|sapphire|diamond|malachite|obsidian|gem|opal|jade)/i, [0, 0, 210, 0]],
    [/\b(coal|anthracite|slate|shale)/i, [0, 0, 70, 0]],
];

const KINDS: Partial<Record<MaterialKind, Surface>> = {
    [MaterialKind.Soil]: [0, 255, 0, 0],
    [MaterialKind.Sand]: [0, 255, 0, 0],
    [MaterialKind.Snow]: [0, 0, 60, 255],
};

export function surfaceOf({ name, kind }: Material): Surface {
    return RULES.find(([names]) => names.test(name))?.[1] ?? KINDS[kind] ?? [0, 0, 0, 0];
}
