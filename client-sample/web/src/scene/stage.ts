// Renderer, camera, sky, sun with its shadow: everything around the tiles.
import * as THREE from 'three';

import { lightUniforms, setHour } from './light';
import { makeDetailTextures, type DetailTextures } from './noise_texture';
import type { Quality } from './quality';
import { makeSky } from './sky';

const SHADOW_REACH = 190;
const FAR = 60_000;
export const FIELD_OF_VIEW_DEGREES = 62;

export class Stage {
    readonly renderer: THREE.WebGLRenderer;
    readonly scene = new THREE.Scene();
    readonly camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEGREES, 1, 0.35, FAR);
    readonly textures: DetailTextures = makeDetailTextures();
    readonly rendererName: string;
    /** Drawn by the processor: filters that hardware has for nothing are dear. */
    readonly isSoftware: boolean;
    private readonly sky: ReturnType<typeof makeSky>;
    hour = 16.6;
    private readonly sun = new THREE.DirectionalLight(0xffffff, 1);
    private shadowSize = 0;
    private readonly shadowAt = new THREE.Vector3(Infinity, 0, 0);
    private pixelRatio = 1;

    constructor(canvas: HTMLCanvasElement) {
        this.renderer = new THREE.WebGLRenderer({ canvas, antialias: window.devicePixelRatio < 2, powerPreference: 'high-performance' });
        this.renderer.toneMapping = THREE.ACESFilmicToneMapping;
        this.renderer.toneMappingExposure = 1.02;
        this.renderer.localClippingEnabled = true;
        this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
        this.renderer.shadowMap.autoUpdate = false;
        const gl = this.renderer.getContext();
        const info = gl.getExtension('WEBGL_debug_renderer_info');
        this.rendererName = String(gl.getParameter(info?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER));
        this.isSoftware = /swiftshader|llvmpipe|software|basic render/i.test(this.rendererName);
        this.textures.heights.anisotropy = this.textures.slopes.anisotropy = this.isSoftware ? 1 : 4;
        this.sky = makeSky(this.textures.heights);
        this.scene.add(this.sky, this.sun, this.sun.target);
        this.sun.shadow.camera.near = 1;
        this.sun.shadow.camera.far = 1400;
        this.sun.shadow.bias = -0.0006;
        this.sun.shadow.normalBias = 0.9;
        this.setHour(this.hour);
    }

    get sunDirection(): THREE.Vector3 {
        return lightUniforms.uSunDirection.value;
    }

    setHour(hour: number): void {
        this.hour = hour;
        setHour(hour);
        this.shadowAt.x = Infinity;
    }

    setQuality(quality: Quality): void {
        this.pixelRatio = quality.pixelRatio;
        const clouds = quality.detail > 0 ? 1 : 0;
        if (this.sky.material.defines.CLOUDS !== clouds) {
            this.sky.material.defines.CLOUDS = clouds;
            this.sky.material.needsUpdate = true;
        }
        if (quality.shadows !== this.shadowSize) {
            this.shadowSize = quality.shadows;
            this.renderer.shadowMap.enabled = quality.shadows > 0;
            this.sun.castShadow = quality.shadows > 0;
            this.sun.shadow.map?.dispose();
            this.sun.shadow.map = null;
            this.sun.shadow.mapSize.set(Math.max(quality.shadows, 1), Math.max(quality.shadows, 1));
        }
        this.resize();
        this.shadowsChanged();
    }

    resize(): void {
        const ratio = Math.min(this.pixelRatio, Math.max(window.devicePixelRatio, this.pixelRatio < 1 ? 0 : 1));
        this.renderer.setPixelRatio(ratio);
        this.renderer.setSize(window.innerWidth, window.innerHeight, false);
        this.camera.aspect = window.innerWidth / window.innerHeight;
        this.camera.updateProjectionMatrix();
    }

    /** The shadow is drawn anew with the next frame. */
    shadowsChanged(): void {
        this.shadowAt.x = Infinity;
    }

    render(seconds: number): void {
        lightUniforms.uTime.value += seconds;
        this.placeSun();
        this.renderer.render(this.scene, this.camera);
    }

    /** The shadow's frame follows the eye in steps of whole texels, so that edges do not swim. */
    private placeSun(): void {
        if (this.shadowSize === 0) {
            return;
        }
        const eye = this.camera.position;
        if (this.shadowAt.distanceTo(eye) < SHADOW_REACH * 0.06) {
            return;
        }
        this.shadowAt.copy(eye);
        const direction = lightUniforms.uSunDirection.value;
        const reach = SHADOW_REACH * THREE.MathUtils.clamp(eye.y / 260, 1, 2.2);
        const ahead = this.camera.getWorldDirection(new THREE.Vector3()).setY(0).multiplyScalar(reach * 0.45);
        const middle = new THREE.Vector3(eye.x, 0, eye.z).add(ahead);
        middle.y = Math.max(eye.y - 90, 60);
        const texel = (reach * 2) / this.shadowSize;
        const right = new THREE.Vector3().crossVectors(new THREE.Vector3(0, 1, 0), direction).normalize();
        const up = new THREE.Vector3().crossVectors(direction, right);
        const a = Math.round(middle.dot(right) / texel) * texel;
        const b = Math.round(middle.dot(up) / texel) * texel;
        middle.copy(right).multiplyScalar(a).addScaledVector(up, b).addScaledVector(direction, middle.dot(direction));
        this.sun.target.position.copy(middle);
        this.sun.position.copy(middle).addScaledVector(direction, 700);
        this.sun.target.updateMatrixWorld();
        this.sun.updateMatrixWorld();
        const { camera } = this.sun.shadow;
        camera.left = camera.bottom = -reach;
        camera.right = camera.top = reach;
        camera.updateProjectionMatrix();
        this.renderer.shadowMap.needsUpdate = true;
    }
}
