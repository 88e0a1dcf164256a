// A page that walks the implicit tileset with three and 3d-tiles-renderer.
import {
    Color, DirectionalLight, HemisphereLight, PerspectiveCamera, Scene, Vector3, WebGLRenderer,
} from 'three';
import { DRACOLoader } from 'three/examples/jsm/loaders/DRACOLoader.js';
import { TilesRenderer } from '3d-tiles-renderer';
import { GLTFExtensionsPlugin, ImplicitTilingPlugin } from '3d-tiles-renderer/plugins';

const query = new URL(location).searchParams;
const numbers = (name) => query.get(name).split(',').map(Number);
const state = { errors: [], visible: 0, levels: [], done: false, triangles: 0 };
window.state = state;

const renderer = new WebGLRenderer({ antialias: false, preserveDrawingBuffer: true });
renderer.setSize(800, 600);
document.body.appendChild(renderer.domElement);
const scene = new Scene();
scene.background = new Color(query.get('background') ?? '#ff00ff');
scene.add(new HemisphereLight(0xdfeaff, 0x8a7f70, 1.6));
const sun = new DirectionalLight(0xfff2dd, 2.2);
sun.position.set(-3, 2.5, 4);
scene.add(sun);

// The tileset is z up: so is this scene.
const camera = new PerspectiveCamera(50, 800 / 600, 1, 400000);
camera.up.set(0, 0, 1);
camera.position.fromArray(numbers('eye'));
camera.lookAt(new Vector3().fromArray(numbers('look')));
camera.updateMatrixWorld();

const tiles = new TilesRenderer(query.get('tileset'));
const draco = new DRACOLoader().setDecoderPath('/draco/');
tiles.registerPlugin(new ImplicitTilingPlugin());
tiles.registerPlugin(new GLTFExtensionsPlugin({ dracoLoader: draco }));
tiles.errorTarget = Number(query.get('error') ?? 12);
tiles.setCamera(camera);
tiles.setResolution(camera, 800, 600);
tiles.addEventListener('load-error', (event) => {
    state.errors.push(`${event.url ?? ''} ${event.error?.message ?? event.error}`);
});
scene.add(tiles.group);

/** Pixels that show the background. */
function holes() {
    const gl = renderer.getContext();
    const pixels = new Uint8Array(800 * 600 * 4);
    gl.readPixels(0, 0, 800, 600, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    let count = 0;
    for (let i = 0; i < pixels.length; i += 4) {
        if (pixels[i] > 250 && pixels[i + 1] < 5 && pixels[i + 2] > 250) {
            ++count;
        }
    }
    return count;
}

let quiet = 0;
function frame() {
    tiles.update();
    renderer.render(scene, camera);
    const { downloading, parsing, queued = 0 } = tiles.stats;
    quiet = tiles.visibleTiles.size > 0 && downloading + parsing + queued === 0 ? quiet + 1 : 0;
    if (quiet > 20) {
        state.visible = tiles.visibleTiles.size;
        // A tile's error is 2^level voxels.
        state.levels = [...new Set([...tiles.visibleTiles].map(
            (tile) => Math.log2(tile.geometricError / numbers('voxel')[0])))].sort((a, b) => a - b);
        state.triangles = renderer.info.render.triangles;
        state.holes = holes();
        // Would holes be seen if there were any? Without tiles there is nothing else.
        tiles.group.visible = false;
        renderer.render(scene, camera);
        state.holesWithoutTiles = holes();
        tiles.group.visible = true;
        renderer.render(scene, camera);
        state.done = true;
        return;
    }
    setTimeout(frame, 30);
}
frame();
