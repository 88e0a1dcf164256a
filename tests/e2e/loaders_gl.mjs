// The explicit tileset with loaders.gl: its loaders read every document and tile on the way; which
// tiles are worth loading is decided here as any such client does, by error over distance.
import { load, registerLoaders } from '@loaders.gl/core';
import { Tiles3DLoader } from '@loaders.gl/3d-tiles';
import { DracoLoader } from '@loaders.gl/draco';
import draco3d from 'draco3d';

const OPTIONS = {
    worker: false,
    modules: { draco3d },
    '3d-tiles': { loadGLTF: true },
    gltf: { loadBuffers: true, loadImages: false, decompressMeshes: true },
};

function distance(box, eye) {
    const half = [box[3], box[7], box[11]];
    const away = eye.map((at, i) => Math.max(0, Math.abs(at - box[i]) - half[i]));
    return Math.hypot(...away);
}

/** Loads what `eye` (z up, metres) should see; gives {tiles, triangles, levels, documents}. */
export async function walkExplicit(url, eye, { errorTarget, tilesMax }) {
    registerLoaders([DracoLoader]);
    const seen = { tiles: 0, triangles: 0, levels: new Set(), documents: 0 };
    const wanted = [];

    async function openDocument(documentUrl) {
        const tileset = await load(documentUrl, Tiles3DLoader, OPTIONS);
        ++seen.documents;
        await visit(tileset.root ?? tileset, documentUrl);
    }

    async function visit(tile, documentUrl) {
        const box = tile.boundingVolume.box;
        // Pixels of error for 600 pixels over 50 degrees.
        const pixels = tile.geometricError * 643 / Math.max(1, distance(box, eye));
        const uri = new URL(tile.content.uri ?? tile.contentUrl, documentUrl).href;
        if (uri.endsWith('.json')) {
            await openDocument(uri);
        } else if (tile.children?.length && pixels > errorTarget) {
            for (const child of tile.children) {
                await visit(child, documentUrl);
            }
        } else {
            wanted.push({ uri, away: distance(box, eye) });
        }
    }

    await openDocument(url);
    wanted.sort((a, b) => a.away - b.away);
    // Near and far ones, evenly.
    const every = Math.max(1, wanted.length / tilesMax);
    for (let i = 0; i < wanted.length; i += every) {
        const { uri } = wanted[Math.floor(i)];
        const tile = await load(uri, Tiles3DLoader, OPTIONS);
        const gltf = tile.gltf;
        for (const mesh of gltf.meshes ?? gltf.json?.meshes ?? []) {
            for (const primitive of mesh.primitives) {
                const position = primitive.attributes.POSITION;
                const indices = primitive.indices;
                const values = position?.value ?? gltf.accessors?.[position]?.value;
                const corners = indices?.value ?? gltf.accessors?.[indices]?.value;
                if (!values?.length || !corners?.length) {
                    throw new Error(`${uri}: no geometry came out`);
                }
                if (![...values.slice(0, 300)].every(Number.isFinite)) {
                    throw new Error(`${uri}: positions are no numbers`);
                }
                seen.triangles += corners.length / 3;
            }
        }
        ++seen.tiles;
        seen.levels.add(Number(uri.match(/content\/(\d+)\//)[1]));
    }
    seen.wanted = wanted.length;
    return seen;
}
