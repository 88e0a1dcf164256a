// The cutting plane: an upright plane through the world. What lies between it and the viewer is taken
// away, and the cut face is drawn out of columns: layers, blends, veins, caves (one looks into them),
// and on demand the flow as arrows. The face has a near part, four pixels a voxel when at rest, and a
// far part from coarser columns, so that the cut goes to the horizon.
import * as THREE from 'three';
import type { SectionLine, ServerHello } from 'terrane-client';

import { AIR_GLSL, lightUniforms } from '../scene/light';
import type { DetailTextures } from '../scene/noise_texture';
import type { SectionImage } from '../stream/messages';

const NEAR_LENGTH = 384;
const FAR_LENGTH = 6144;
const NEAR_PIXELS_PER_VOXEL = { moving: 1, still: 3 };
const FAR_WIDTH = 1024;
const SETTLE_MS = 220;
const ARROW_SPACING = 6;
const ARROWS_MAX = 4000;

const FACE_VERTEX = /* glsl */ `
varying vec2 vUv;
varying vec3 vWorld;
void main() {
    vUv = uv;
    vec4 world = modelMatrix * vec4(position, 1.0);
    vWorld = world.xyz;
    gl_Position = projectionMatrix * viewMatrix * world;
}
`;

const FACE_FRAGMENT = /* glsl */ `
${AIR_GLSL}
uniform sampler2D uColors;
uniform sampler2D uContents;
uniform sampler2D uHeights;
uniform vec2 uPixels;
uniform vec2 uSize;
uniform vec2 uHole;
uniform vec3 uNormal;
uniform float uAlong;
varying vec2 vUv;
varying vec3 vWorld;

void main() {
    if (vUv.x > uHole.x && vUv.x < uHole.y) {
        discard;
    }
    vec4 face = texture2D(uColors, vUv);
    if (face.a < 0.5) {
        discard;
    }
    vec4 content = texture2D(uContents, vUv);
    vec2 pixel = 1.0 / uPixels;
    // A fine line where the material changes, a voxel wide at most, thinner from afar.
    vec2 reach = max(pixel, fwidth(vUv) * 0.75);
    float differs = 0.0;
    for (int i = 0; i < 4; ++i) {
        vec2 side = vec2(i == 0 ? 1.0 : (i == 1 ? -1.0 : 0.0), i == 2 ? 1.0 : (i == 3 ? -1.0 : 0.0));
        vec4 other = texture2D(uContents, vUv + side * reach);
        differs = max(differs, step(0.5 / 255.0, abs(other.r - content.r) + abs(other.g - content.g)));
    }
    vec2 at = vec2(vUv.x * uSize.x + uAlong, vUv.y * uSize.y);
    vec4 grain = texture2D(uHeights, at / 9.0);
    vec4 wide = texture2D(uHeights, at / vec2(64.0, 21.0));
    float bed = texture2D(uHeights, vec2(at.x / 190.0, at.y / 5.0)).a;
    float kind = floor(content.g * 255.0 + 0.5);
    bool isVein = kind == 3.0;
    vec3 color = face.rgb * (0.80 + 0.26 * grain.r + 0.10 * (wide.g - 0.5) + 0.16 * (bed - 0.5));
    color *= 1.0 - 0.42 * differs;
    vec3 light = uSunColor * (0.16 + 0.28 * max(dot(uNormal, uSunDirection), 0.0)) + uAmbient * 0.95 + uHorizon * 0.12;
    vec3 shown = color * light * 0.62;
    if (isVein) {
        float spark = smoothstep(0.62, 0.95, grain.r) * 0.9 + 0.25;
        shown = color * light * 0.62 + color * spark * 0.55;
    }
    shown = withFog(shown, cameraPosition, vWorld);
    gl_FragColor = vec4(shown, 1.0);
    #include <tonemapping_fragment>
    #include <colorspace_fragment>
}
`;

export interface CutRequest {
    near: SectionLine;
    far: SectionLine;
    withFlow: boolean;
}

class Face {
    readonly mesh: THREE.Mesh<THREE.PlaneGeometry, THREE.ShaderMaterial>;
    image: SectionImage | undefined;

    constructor(textures: DetailTextures, order: number) {
        const material = new THREE.ShaderMaterial({
            vertexShader: FACE_VERTEX,
            fragmentShader: FACE_FRAGMENT,
            uniforms: {
                ...lightUniforms,
                uColors: { value: null },
                uContents: { value: null },
                uHeights: { value: textures.heights },
                uPixels: { value: new THREE.Vector2(1, 1) },
                uSize: { value: new THREE.Vector2(1, 1) },
                uHole: { value: new THREE.Vector2(2, 2) },
                uNormal: { value: new THREE.Vector3() },
                uAlong: { value: 0 },
            },
            side: THREE.DoubleSide,
        });
        this.mesh = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), material);
        this.mesh.frustumCulled = false;
        this.mesh.renderOrder = order;
        this.mesh.visible = false;
    }

    show(image: SectionImage): void {
        const { line } = image;
        const { uniforms } = this.mesh.material;
        (uniforms.uColors!.value as THREE.Texture | null)?.dispose();
        (uniforms.uContents!.value as THREE.Texture | null)?.dispose();
        const make = (bytes: Uint8Array, isColor: boolean) => {
            const texture = new THREE.DataTexture(bytes, line.width, line.height, THREE.RGBAFormat);
            texture.colorSpace = isColor ? THREE.SRGBColorSpace : THREE.NoColorSpace;
            texture.magFilter = texture.minFilter = THREE.NearestFilter;
            if (isColor) {
                texture.minFilter = THREE.LinearMipmapLinearFilter;
                texture.generateMipmaps = true;
                texture.anisotropy = 8;
            }
            texture.needsUpdate = true;
            return texture;
        };
        this.image = image;
        uniforms.uColors!.value = make(image.colors, true);
        uniforms.uContents!.value = make(image.contents, false);
        uniforms.uPixels!.value.set(line.width, line.height);
        uniforms.uSize!.value.set(Math.hypot(line.x1 - line.x0, line.z1 - line.z0), line.y1 - line.y0);
        this.mesh.visible = true;
    }

    place(origin: { x: number; z: number }): void {
        if (this.image === undefined) {
            return;
        }
        const { x0, z0, x1, z1, y0, y1 } = this.image.line;
        const length = Math.hypot(x1 - x0, z1 - z0);
        this.mesh.position.set((x0 + x1) / 2 - origin.x, (y0 + y1) / 2, (z0 + z1) / 2 - origin.z);
        this.mesh.rotation.y = -Math.atan2(z1 - z0, x1 - x0);
        this.mesh.scale.set(length, y1 - y0, 1);
    }
}

export class Cut {
    readonly group = new THREE.Group();
    isOn = false;
    withFlow = false;
    /** A point of the plane in the world, and the way along it (radians from +x towards +z). */
    readonly point = { x: 0, z: 0 };
    heading = 0;
    /** Near stacks of the cut that have not come yet. */
    missing = 0;

    private readonly near: Face;
    private readonly far: Face;
    private readonly plane = new THREE.Plane();
    private readonly arrows: THREE.InstancedMesh;
    private readonly rim: THREE.Line;
    private side = 1;
    private nextId = 1;
    private shownId = 0;
    private settle: ReturnType<typeof setTimeout> | undefined;

    constructor(
        private readonly hello: ServerHello,
        textures: DetailTextures,
        private readonly ask: (id: number, request: CutRequest) => void,
    ) {
        this.near = new Face(textures, 2);
        this.far = new Face(textures, 3);
        this.arrows = new THREE.InstancedMesh(arrowGeometry(), new THREE.MeshBasicMaterial({ color: 0xffffff, transparent: true, opacity: 0.85, toneMapped: false }), ARROWS_MAX);
        this.arrows.frustumCulled = false;
        this.arrows.count = 0;
        this.arrows.renderOrder = 4;
        this.rim = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: 0xfff1d0, transparent: true, opacity: 0.9, toneMapped: false }));
        this.rim.frustumCulled = false;
        this.group.add(this.near.mesh, this.far.mesh, this.arrows, this.rim);
        this.group.visible = false;
    }

    get normal(): { x: number; z: number } {
        return { x: -Math.sin(this.heading), z: Math.cos(this.heading) };
    }

    /** Puts the plane across the view, some way ahead. */
    open(eye: { x: number; z: number }, yaw: number, ahead: number): void {
        this.isOn = true;
        this.group.visible = true;
        this.point.x = Math.round(eye.x + Math.sin(yaw) * ahead);
        this.point.z = Math.round(eye.z + Math.cos(yaw) * ahead);
        this.heading = Math.PI / 2 - yaw + Math.PI / 2;
        this.moved();
    }

    close(): void {
        this.isOn = false;
        this.group.visible = false;
        this.near.mesh.visible = this.far.mesh.visible = false;
        this.arrows.count = 0;
        clearTimeout(this.settle);
    }

    /** Moves the plane along its normal, away from the viewer if positive. */
    shift(voxels: number): void {
        const { x, z } = this.normal;
        this.point.x -= x * voxels * this.side;
        this.point.z -= z * voxels * this.side;
        this.moved();
    }

    /** Slides what is drawn finely along the plane. */
    slide(voxels: number): void {
        this.point.x += Math.cos(this.heading) * voxels;
        this.point.z += Math.sin(this.heading) * voxels;
    }

    turn(radians: number): void {
        this.heading += radians;
        this.moved();
    }

    setFlow(withFlow: boolean): void {
        this.withFlow = withFlow;
        this.moved();
    }

    /** Asks for the picture of where the plane is now: a rough one at once, a fine one at rest. */
    moved(): void {
        if (!this.isOn) {
            return;
        }
        this.send(NEAR_PIXELS_PER_VOXEL.moving);
        clearTimeout(this.settle);
        this.settle = setTimeout(() => this.send(NEAR_PIXELS_PER_VOXEL.still), SETTLE_MS);
    }

    show(id: number, near: SectionImage, far: SectionImage, missing: number): void {
        if (!this.isOn || id < this.shownId) {
            return;
        }
        this.shownId = id;
        this.missing = missing;
        this.near.show(near);
        this.far.show(far);
        const hole = NEAR_LENGTH / FAR_LENGTH / 2;
        this.far.mesh.material.uniforms.uHole!.value.set(0.5 - hole, 0.5 + hole);
        this.placeArrows();
        this.placeRim();
    }

    /** Every frame: where things are from the scene's origin, and what is taken away. */
    update(origin: { x: number; z: number }, eye: { x: number; z: number }): THREE.Plane[] {
        if (!this.isOn) {
            return [];
        }
        const { x, z } = this.normal;
        const ahead = (eye.x - this.point.x) * x + (eye.z - this.point.z) * z;
        this.side = ahead >= 0 ? 1 : -1;
        const line = this.near.image?.line;
        // The clip follows the picture that is shown, not the one that is asked for.
        const on = line === undefined ? this.point : { x: (line.x0 + line.x1) / 2, z: (line.z0 + line.z1) / 2 };
        const along = line === undefined ? { x: Math.cos(this.heading), z: Math.sin(this.heading) } : direction(line);
        const clip = new THREE.Vector3(along.z, 0, -along.x);
        if (clip.x * (eye.x - on.x) + clip.z * (eye.z - on.z) > 0) {
            clip.negate();
        }
        this.plane.setFromNormalAndCoplanarPoint(clip, new THREE.Vector3(on.x - origin.x, 0, on.z - origin.z));
        for (const face of [this.near, this.far]) {
            face.place(origin);
            face.mesh.material.uniforms.uNormal!.value.copy(clip).negate();
        }
        this.arrows.position.set(-origin.x, 0, -origin.z);
        this.rim.position.set(-origin.x, 0, -origin.z);
        return line === undefined ? [] : [this.plane];
    }

    /** Where a ray hits the cut face, in the world; undefined where the face is hollow. */
    hit(ray: THREE.Ray, origin: { x: number; z: number }): { x: number; y: number; z: number } | undefined {
        const point = this.isOn ? ray.intersectPlane(this.plane, new THREE.Vector3()) : null;
        if (point === null) {
            return undefined;
        }
        const world = { x: point.x + origin.x, y: point.y, z: point.z + origin.z };
        const found = this.contentAt(world.x, world.y, world.z);
        return found !== undefined && found.isSolid ? world : undefined;
    }

    /** What the face shows at a point of the plane. */
    contentAt(x: number, y: number, z: number): { material: number; kind: number; isSolid: boolean; color: number[] } | undefined {
        for (const { image } of [this.near, this.far]) {
            if (image === undefined) {
                continue;
            }
            const { line } = image;
            const length = Math.hypot(line.x1 - line.x0, line.z1 - line.z0);
            const t = ((x - line.x0) * (line.x1 - line.x0) + (z - line.z0) * (line.z1 - line.z0)) / length ** 2;
            const column = Math.floor(t * line.width);
            const row = Math.floor(((y - line.y0) / (line.y1 - line.y0)) * line.height);
            if (column >= 0 && column < line.width && row >= 0 && row < line.height) {
                const at = 4 * (row * line.width + column);
                return {
                    material: image.contents[at]!,
                    kind: image.contents[at + 1]! - 1,
                    isSolid: image.colors[at + 3]! > 0,
                    color: [...image.colors.subarray(at, at + 3)],
                };
            }
        }
        return undefined;
    }

    private send(pixelsPerVoxel: number): void {
        const height = Math.ceil(this.hello.heightBoundVoxels) + 2;
        const x = Math.cos(this.heading);
        const z = Math.sin(this.heading);
        const line = (length: number, width: number, rows: number): SectionLine => ({
            x0: this.point.x - (x * length) / 2,
            z0: this.point.z - (z * length) / 2,
            x1: this.point.x + (x * length) / 2,
            z1: this.point.z + (z * length) / 2,
            y0: 0,
            y1: height,
            width,
            height: Math.min(rows, 2048),
        });
        this.ask(this.nextId++, {
            near: line(NEAR_LENGTH, NEAR_LENGTH * pixelsPerVoxel, height * pixelsPerVoxel),
            far: line(FAR_LENGTH, FAR_WIDTH, height),
            withFlow: this.withFlow,
        });
    }

    /** The line along the top of the cut. */
    private placeRim(): void {
        const { line, colors } = this.near.image!;
        const points: number[] = [];
        for (let i = 0; i < line.width; ++i) {
            let row = line.height - 1;
            while (row >= 0 && colors[4 * (row * line.width + i) + 3] === 0) {
                --row;
            }
            if (row >= 0) {
                const t = (i + 0.5) / line.width;
                const y = line.y0 + ((line.y1 - line.y0) * (row + 1)) / line.height;
                points.push(line.x0 + t * (line.x1 - line.x0), y + 0.05, line.z0 + t * (line.z1 - line.z0));
            }
        }
        this.rim.geometry.dispose();
        this.rim.geometry = new THREE.BufferGeometry();
        this.rim.geometry.setAttribute('position', new THREE.Float32BufferAttribute(points, 3));
    }

    private placeArrows(): void {
        this.arrows.count = 0;
        const { line, contents, colors } = this.near.image!;
        if (!this.withFlow) {
            return;
        }
        const { x, z } = direction(line);
        const pixels = line.width / NEAR_LENGTH;
        const step = Math.round(ARROW_SPACING * pixels);
        const matrix = new THREE.Matrix4();
        const lift = this.side * 0.25;
        const turn = new THREE.Quaternion();
        const forward = new THREE.Vector3(1, 0, 0);
        const size = new THREE.Vector3(4.4, 4.4, 4.4);
        let count = 0;
        for (let row = step >> 1; row < line.height; row += step) {
            for (let i = step >> 1; i < line.width && count < ARROWS_MAX; i += step) {
                const at = 4 * (row * line.width + i);
                const along = contents[at + 2]! - 128;
                const up = contents[at + 3]! - 128;
                const strength = Math.hypot(along, up) / 127;
                if (colors[at + 3] === 0 || strength < 0.12) {
                    continue;
                }
                const t = (i + 0.5) / line.width;
                const position = new THREE.Vector3(
                    line.x0 + t * (line.x1 - line.x0) - z * lift,
                    line.y0 + ((line.y1 - line.y0) * (row + 0.5)) / line.height,
                    line.z0 + t * (line.z1 - line.z0) + x * lift,
                );
                turn.setFromUnitVectors(forward, new THREE.Vector3(x * along, up, z * along).normalize());
                matrix.compose(position, turn, size.setScalar(4.8 * Math.min(0.35 + strength * 0.65, 1)));
                this.arrows.setMatrixAt(count++, matrix);
            }
        }
        this.arrows.count = count;
        this.arrows.instanceMatrix.needsUpdate = true;
    }
}

function direction(line: SectionLine): { x: number; z: number } {
    const length = Math.hypot(line.x1 - line.x0, line.z1 - line.z0);
    return { x: (line.x1 - line.x0) / length, z: (line.z1 - line.z0) / length };
}

/** A slim dart along +x, one long, seen from either side. */
function arrowGeometry(): THREE.BufferGeometry {
    const shaft = new THREE.CylinderGeometry(0.022, 0.022, 0.62, 5).translate(0, -0.19, 0);
    const tip = new THREE.ConeGeometry(0.1, 0.38, 6).translate(0, 0.31, 0);
    const positions = [shaft, tip].flatMap((part) => [...part.toNonIndexed().getAttribute('position').array]);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.Float32BufferAttribute(positions, 3));
    geometry.rotateZ(-Math.PI / 2);
    return geometry;
}
