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
    // From the south west, as in the other page; not from where the sun is today.
    const light = Cesium.Matrix4.multiplyByPointAsVector(
        frame, new Cesium.Cartesian3(3, -2.5, -4), new Cesium.Cartesian3());
    scene.light = new Cesium.DirectionalLight({
        direction: Cesium.Cartesian3.normalize(light, light), intensity: 2.5,
    });

    /** Pixels that show the background. */
    function holes() {
        const gl = scene.context._gl;
        const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
        const pixels = new Uint8Array(width * height * 4);
        gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
        let count = 0;
        for (let i = 0; i < pixels.length; i += 4) {
            if (pixels[i] > 250 && pixels[i + 1] < 5 && pixels[i + 2] > 250) {
                ++count;
            }
        }
        return count;
    }

    let quiet = 0;
    scene.postRender.addEventListener(() => {
        if (state.done) {
            return;
        }
        if (!tileset.show) {
            // Would holes be seen if there were any? Without tiles there is nothing else.
            state.holesWithoutTiles = holes();
            tileset.show = true;
            return;
        }
        if (state.holesWithoutTiles !== undefined) {
            state.done = true;
            return;
        }
        const { selected } = tileset.statistics;
        quiet = tileset.tilesLoaded && selected > 0 ? quiet + 1 : 0;
        if (quiet > 10) {
            state.holes = holes();
            state.visible = selected;
            state.levels = [...new Set(tileset._selectedTiles.map(
                (tile) => Math.log2(tile.geometricError / numbers('voxel')[0])))].sort((a, b) => a - b);
            tileset.show = false;
        }
    });
}
run().catch((error) => state.errors.push(String(error?.stack ?? error)));
