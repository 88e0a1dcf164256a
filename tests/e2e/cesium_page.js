// A page that walks the tileset on the globe with CesiumJS (a global, from Build/Cesium).
const query = new URL(location).searchParams;
const numbers = (name) => query.get(name).split(',').map(Number);
const state = { errors: [], visible: 0, levels: [], done: false };
window.state = state;

async function run() {
    const widget = new Cesium.CesiumWidget('scene', {
        globe: false, skyBox: false, skyAtmosphere: false, baseLayer: false,
        requestRenderMode: false, showRenderLoopErrors: false,
        contextOptions: { webgl: { preserveDrawingBuffer: true, antialias: false } },
        msaaSamples: 1, creditContainer: document.createElement('div'),
    });
    const scene = widget.scene;
    scene.backgroundColor = Cesium.Color.MAGENTA;
    scene.fog.enabled = false;
    scene.highDynamicRange = false;
    scene.postProcessStages.fxaa.enabled = false;
    scene.renderError.addEventListener((_, error) => state.errors.push(String(error)));
    const tileset = await Cesium.Cesium3DTileset.fromUrl(query.get('tileset'), {
        maximumScreenSpaceError: Number(query.get('error') ?? 12),
    });
    tileset.tileFailed.addEventListener(({ url, message }) => state.errors.push(`${url} ${message}`));
    scene.primitives.add(tileset);
    // East, north, up at longitude 0, latitude 0: x, -z, y of the world.
    const frame = Cesium.Transforms.eastNorthUpToFixedFrame(Cesium.Cartesian3.fromDegrees(0, 0));
    const [eye, look] = [numbers('eye'), numbers('look')].map((at) =>
        Cesium.Matrix4.multiplyByPoint(frame, new Cesium.Cartesian3(...at), new Cesium.Cartesian3()));
    const direction = Cesium.Cartesian3.normalize(
        Cesium.Cartesian3.subtract(look, eye, new Cesium.Cartesian3()), new Cesium.Cartesian3());
    const up = Cesium.Matrix4.multiplyByPointAsVector(
        frame, new Cesium.Cartesian3(0, 0, 1), new Cesium.Cartesian3());
    const right = Cesium.Cartesian3.normalize(
        Cesium.Cartesian3.cross(direction, up, new Cesium.Cartesian3()), new Cesium.Cartesian3());
    scene.camera.setView({
        destination: eye,
        orientation: { direction, up: Cesium.Cartesian3.cross(right, direction, new Cesium.Cartesian3()) },
    });
    let quiet = 0;
    scene.postRender.addEventListener(() => {
        const { numberOfTilesWithContentReady, selected } = tileset.statistics;
        quiet = tileset.tilesLoaded && selected > 0 ? quiet + 1 : 0;
        if (quiet > 20 && !state.done) {
            const gl = scene.context._gl;
            const pixels = new Uint8Array(800 * 600 * 4);
            gl.readPixels(0, 0, 800, 600, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
            state.holes = 0;
            for (let i = 0; i < pixels.length; i += 4) {
                if (pixels[i] > 250 && pixels[i + 1] < 5 && pixels[i + 2] > 250) {
                    ++state.holes;
                }
            }
            state.visible = selected;
            state.ready = numberOfTilesWithContentReady;
            state.levels = [...new Set(tileset._selectedTiles.map(
                (tile) => Math.log2(tile.geometricError / numbers('voxel')[0])))].sort((a, b) => a - b);
            state.done = true;
        }
    });
}
run().catch((error) => state.errors.push(String(error?.stack ?? error)));
