// The explicit tileset walked by loaders.gl's own Tileset3D, which deck.gl draws with: it decides
// what is visible, opens the documents below and refines until nothing is left to load. Only the
// camera is ours.
import { Vector3 } from '@math.gl/core';
import { Ellipsoid } from '@math.gl/geospatial';
import { load, registerLoaders } from '@loaders.gl/core';
import { Tiles3DLoader } from '@loaders.gl/3d-tiles';
import { Tileset3D } from '@loaders.gl/tiles';
import { DracoLoader } from '@loaders.gl/draco';
import draco3d from 'draco3d';

const WIDTH = 800;
const HEIGHT = 600;
const FIELD_OF_VIEW = 50 * Math.PI / 180;
const NEAR_M = 1;
const FAR_M = 200000;
const TO_EARTH = Ellipsoid.WGS84.eastNorthUpToFixedFrame(new Vector3(Ellipsoid.WGS84.radii[0], 0, 0));

/** What Tileset3D asks of a deck.gl viewport. Its space is metres around longitude 0, latitude 0:
 *  x east, y north, z up, as in tileset-geo.json. */
class Viewport {
    constructor({ eye, look }) {
        this.id = 'eye';
        this.width = WIDTH;
        this.height = HEIGHT;
        this.longitude = 0;
        this.latitude = 0;
        this.bearing = 0;
        this.zoom = 1;
        this.distanceScales = { metersPerUnit: [1, 1, 1] };
        this.center = [0, 0, 0];
        this.cameraPosition = eye;
        if (eye) {
            const forward = new Vector3(look).subtract(eye).normalize();
            const right = new Vector3(forward).cross([0, 0, 1]).normalize();
            this.cameraDirection = forward;
            this.cameraUp = new Vector3(right).cross(forward);
            this.right = right;
        }
    }

    unprojectPosition(point) {
        const earth = TO_EARTH.transformAsPoint(new Vector3(point));
        return Ellipsoid.WGS84.cartesianToCartographic(earth, new Vector3());
    }

    getFrustumPlanes() {
        const up = Math.tan(FIELD_OF_VIEW / 2);
        const side = up * WIDTH / HEIGHT;
        const forward = this.cameraDirection;
        const through = (normal, point) => ({ normal, distance: normal.dot(point) });
        // A side's plane holds the eye and is as steep as the view is wide.
        const slanted = (axis, slope) => through(
            new Vector3(axis).subtract(new Vector3(forward).scale(slope)).normalize(),
            this.cameraPosition);
        const along = (metres) => new Vector3(forward).scale(metres).add(this.cameraPosition);
        return {
            left: slanted(new Vector3(this.right).negate(), side),
            right: slanted(this.right, side),
            bottom: slanted(new Vector3(this.cameraUp).negate(), up),
            top: slanted(this.cameraUp, up),
            near: through(new Vector3(forward).negate(), along(NEAR_M)),
            far: through(new Vector3(forward), along(FAR_M)),
        };
    }
}

/** "/content/17/65536/65536.glb" as {level, x, y}. */
function placeOf(tile) {
    const [level, x, y] = tile.contentUrl.match(/content\/(\d+)\/(\d+)\/(\d+)\.glb/).slice(1).map(Number);
    return { level, x, y };
}

function isWithin(inner, outer) {
    const up = 2 ** (inner.level - outer.level);
    return inner.level > outer.level && Math.floor(inner.x / up) === outer.x
        && Math.floor(inner.y / up) === outer.y;
}

/** Of a grid of points on the ground at height 0 that the view looks at, those on no visible tile. */
function uncovered(viewport, visible) {
    const boxes = visible.map((tile) => tile.header.boundingVolume.box);
    const up = Math.tan(FIELD_OF_VIEW / 2);
    const side = up * WIDTH / HEIGHT;
    let count = 0;
    for (let row = -1; row <= 1; row += 0.1) {
        for (let column = -1; column <= 1; column += 0.1) {
            const ray = new Vector3(viewport.cameraDirection)
                .add(new Vector3(viewport.right).scale(column * side))
                .add(new Vector3(viewport.cameraUp).scale(row * up));
            const metres = -viewport.cameraPosition[2] / ray[2];
            const [x, y] = ray.scale(metres).add(viewport.cameraPosition);
            count += boxes.some((box) => Math.abs(x - box[0]) <= box[3]
                && Math.abs(y - box[1]) <= box[7]) ? 0 : 1;
        }
    }
    return count;
}

/** Lets Tileset3D come to rest on a view (z up, metres); gives what it shows then. */
export async function traverse(url, view, { errorTarget, roundsMax }) {
    registerLoaders([DracoLoader]);
    const errors = [];
    const seen = { documents: 1, tiles: 0 };
    const json = await load(url, Tiles3DLoader, {});
    const tileset = new Tileset3D(json, {
        maximumScreenSpaceError: errorTarget,
        maximumMemoryUsage: 512,
        loadOptions: {
            worker: false,
            modules: { draco3d },
            '3d-tiles': { loadGLTF: true },
            gltf: { loadBuffers: true, loadImages: false, decompressMeshes: true },
        },
        onTileLoad: (tile) => {
            seen[tile.hasTilesetContent ? 'documents' : 'tiles'] += 1;
        },
        onTileError: (tile, message, at) => errors.push(`${at}: ${message}`),
    });
    const viewport = new Viewport(view);
    let rounds = 0;
    for (let before = ''; rounds < roundsMax; ++rounds) {
        await tileset.selectTiles([viewport]);
        for (const tile of tileset.selectedTiles) {
            tile.tileDrawn = true;  // what a layer says when it has drawn it
        }
        const shown = tileset.selectedTiles.map((tile) => tile.id).sort().join();
        if (tileset.isLoaded() && shown === before && shown !== '') {
            break;
        }
        before = shown;
        await new Promise((resolve) => setTimeout(resolve, 5));
    }
    const visible = tileset.selectedTiles.filter((tile) => tile.hasRenderContent);
    const places = visible.map(placeOf);
    const state = {
        ...seen,
        errors,
        done: rounds < roundsMax,
        rounds,
        visible: visible.length,
        levels: [...new Set(places.map((place) => place.level))].sort((a, b) => a - b),
        uncovered: uncovered(viewport, visible),
        overlaps: places.filter((inner) => places.some((outer) => isWithin(inner, outer))).length,
        headers: tileset.stats.get('Tiles In Tileset(s)').count,
        draco: tileset.contentFormats.draco,
        vertices: visible.reduce((sum, tile) => sum + (tile.content.gltf?.meshes ?? []).reduce(
            (all, mesh) => all + mesh.primitives.reduce(
                (some, primitive) => some + primitive.attributes.POSITION.value.length / 3, 0), 0), 0),
    };
    tileset.destroy();
    return state;
}
