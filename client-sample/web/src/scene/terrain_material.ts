// How the ground looks. Colours and materials come with the vertices; what the eye expects between them
// - grain, cracks, clods, blades - is noise laid on from three sides (triplanar), with slopes that bend
// the normal. Sun with shadows, light of the sky from above and of the ground from below, fog.
//
// A tile fades in and out by dither, each step its own material of one program, so that a level changes
// without a pop and without sorting.
import * as THREE from 'three';

import { AIR_GLSL, lightUniforms } from './light';
import type { DetailTextures } from './noise_texture';
import { WATER_FRAGMENT, WATER_SIDES, WATER_VERTEX } from './water_material';

export const FADE_STEPS = 8;

/** 0: one plane, no normals; 1: three planes; 2: two scales too. */
export type Detail = 0 | 1 | 2;

/** The detail textures repeat after this many voxels times a power of two; origins move by it. */
export const DETAIL_PERIOD = 256;

const VERTEX = /* glsl */ `
#include <common>
#include <shadowmap_pars_vertex>
#include <clipping_planes_pars_vertex>
attribute vec4 tint;
attribute vec4 surface;
varying vec3 vWorld;
varying vec3 vNormalWorld;
varying vec3 vColor;
varying vec4 vSurface;

void main() {
    vec3 objectNormal = normal;
    vec3 transformedNormal = normalMatrix * objectNormal;
    vec4 worldPosition = modelMatrix * vec4(position, 1.0);
    vec4 mvPosition = viewMatrix * worldPosition;
    vWorld = worldPosition.xyz;
    // Tiles are stretched along x and z only: the inverse transposed of that.
    vec3 stretch = vec3(length(modelMatrix[0].xyz), length(modelMatrix[1].xyz), length(modelMatrix[2].xyz));
    vNormalWorld = normalize(objectNormal / stretch);
    vColor = tint.rgb;
    vSurface = surface;
    gl_Position = projectionMatrix * mvPosition;
    #include <clipping_planes_vertex>
    #include <shadowmap_vertex>
}
`;

const FRAGMENT = /* glsl */ `
#include <common>
#include <packing>
#include <lights_pars_begin>
#include <shadowmap_pars_fragment>
#include <shadowmask_pars_fragment>
#include <clipping_planes_pars_fragment>
${AIR_GLSL}
uniform sampler2D uHeights;
uniform sampler2D uSlopes;
uniform vec3 uOriginPart;
uniform float uFade;
uniform float uGhost;
varying vec3 vWorld;
varying vec3 vNormalWorld;
varying vec3 vColor;
varying vec4 vSurface;

float dither(vec2 at) {
    return fract(52.9829189 * fract(dot(at, vec2(0.06711056, 0.00583715))));
}

struct Ground {
    vec4 heights;
    vec3 bend;
};

// Noise from three sides, weighed by where the ground faces.
Ground groundAt(vec3 point, vec3 weight, float scale) {
    Ground ground;
    vec2 x = point.zy * scale;
    vec2 y = point.xz * scale;
    vec2 z = point.xy * scale;
#if DETAIL > 0
    ground.heights = texture2D(uHeights, x) * weight.x + texture2D(uHeights, y) * weight.y + texture2D(uHeights, z) * weight.z;
    float soft = clamp(vSurface.x + vSurface.y, 0.0, 1.0);
    vec4 sx = texture2D(uSlopes, x) - 0.5;
    vec4 sy = texture2D(uSlopes, y) - 0.5;
    vec4 sz = texture2D(uSlopes, z) - 0.5;
    vec2 bx = mix(sx.xy, sx.zw, soft);
    vec2 by = mix(sy.xy, sy.zw, soft);
    vec2 bz = mix(sz.xy, sz.zw, soft);
    ground.bend = vec3(0.0, bx.y, bx.x) * weight.x + vec3(by.x, 0.0, by.y) * weight.y + vec3(bz.x, bz.y, 0.0) * weight.z;
#else
    vec2 at = weight.y > 0.5 ? y : (weight.x > weight.z ? x : z);
    ground.heights = texture2D(uHeights, at);
    ground.bend = vec3(0.0);
#endif
    return ground;
}

void main() {
    #include <clipping_planes_fragment>
    if (uFade < 1.0) {
        float at = dither(gl_FragCoord.xy);
        if (uFade >= 0.0 ? at >= uFade : at < -uFade) {
            discard;
        }
    }
    vec3 normal = normalize(vNormalWorld);
    vec3 eye = cameraPosition - vWorld;
    float distance = length(eye);
    eye /= distance;
    vec3 weight = pow(abs(normal), vec3(4.0));
    weight /= weight.x + weight.y + weight.z;
    vec3 point = vWorld + uOriginPart;
    float grass = vSurface.x * smoothstep(0.45, 0.8, normal.y);
    float soil = vSurface.y;
    float gloss = vSurface.z;
    float rock = clamp(1.0 - vSurface.x - soil - vSurface.w, 0.0, 1.0);

    Ground near = groundAt(point, weight, 1.0 / 8.0);
    vec4 heights = near.heights;
    vec3 bend = near.bend;
#if DETAIL > 1
    Ground wide = groundAt(point, weight, 1.0 / 32.0);
    heights = mix(heights, wide.heights, 0.45);
    bend = bend * 0.7 + wide.bend * 0.7;
#endif
    float near_share = 1.0 - smoothstep(90.0, 420.0, distance);
    float patches = texture2D(uHeights, point.xz / 256.0).a;
    float macro = texture2D(uHeights, point.xz / 2048.0 + 0.37).a;

    // Strata: rock on walls is banded along its height.
    float band = texture2D(uHeights, vec2(point.y / 16.0, 0.37 + point.x / 512.0)).r;
    float wall = smoothstep(0.85, 0.45, normal.y);
    float relief = rock * heights.r + soil * heights.g + (vSurface.x + vSurface.w) * heights.b;
    vec3 color = vColor;
    float grain = mix(0.5, relief, 0.35 + 0.65 * near_share) - 0.5;
    color *= 1.0 + grain * mix(0.85, 0.6, vSurface.x);
    color *= mix(1.0, 0.72 + 0.56 * band, rock * wall * 0.8);
    color *= 0.84 + 0.32 * patches;
    color *= 0.88 + 0.26 * macro;
    // Grass is not one green: dry and lush patches; where it gets steep the soil shows.
    vec3 dry = vec3(color.r * 1.32, color.g * 1.10, color.b * 0.72);
    vec3 lush = vec3(color.r * 0.62, color.g * 0.92, color.b * 0.60);
    vec3 meadow = mix(lush, dry, smoothstep(0.30, 0.72, patches * 0.65 + macro * 0.45 + (heights.b - 0.5) * 0.3));
    vec3 bare = vec3(0.26, 0.19, 0.125) * (0.7 + 0.6 * heights.g);
    float slope = smoothstep(0.86, 0.62, normal.y + (heights.r - 0.5) * 0.22);
    color = mix(color, mix(meadow, bare, slope * 0.8), vSurface.x);

#if DETAIL > 0
    float bending = mix(1.25, 0.8, soil) * (1.0 - 0.45 * grass) * mix(0.2, 1.0, near_share);
    bend -= normal * dot(bend, normal);
    normal = normalize(normal - bend * bending * 1.5);
    float hollow = mix(1.0, smoothstep(-0.1, 0.55, relief), 0.65 * mix(0.3, 1.0, near_share));
#else
    float hollow = 1.0;
#endif

    float facing = dot(normal, uSunDirection);
    float shadow = getShadowMask() * smoothstep(-0.05, 0.06, uSunDirection.y);
    vec3 light = uSunColor * max(facing, 0.0) * shadow;
    vec3 overhead = uAmbient * (0.62 + 0.38 * normal.y) + uHorizon * 0.10;
    vec3 bounce = uSunColor * max(uSunDirection.y, 0.0) * vec3(0.075, 0.065, 0.05) * (0.55 - 0.45 * normal.y);
    light += (overhead + bounce) * hollow;
    vec3 shown = color * light * 0.42;

    vec3 halfway = normalize(uSunDirection + eye);
    float shine = pow(max(dot(normal, halfway), 0.0), mix(16.0, 70.0, gloss)) * max(facing, 0.0) * shadow;
    float glint = gloss * (0.35 + 0.9 * smoothstep(0.55, 0.95, relief));
    shown += uSunColor * shine * mix(vec3(0.035), color * 1.5 + 0.08, gloss) * (0.25 + glint);
    shown += gloss * skyColor(reflect(-eye, normal)) * color * 0.22;
    // Blades of grass let light through from behind.
    shown += grass * uSunColor * shadow * color * 0.10 * pow(max(dot(-eye, uSunDirection), 0.0), 3.0);

    shown = withFog(shown, cameraPosition, vWorld);
    float alpha = 1.0;
    if (uGhost > 0.0) {
        float rim = 1.0 - abs(dot(eye, normalize(vNormalWorld)));
        alpha = mix(1.0, 0.05 + 0.42 * rim * rim, uGhost);
    }
    gl_FragColor = vec4(shown, alpha);
    #include <tonemapping_fragment>
    #include <colorspace_fragment>
}
`;

/** A look in steps of fading in and out. */
class Fading {
    private readonly shown: THREE.ShaderMaterial;
    private readonly coming: THREE.ShaderMaterial[] = [];
    private readonly leaving: THREE.ShaderMaterial[] = [];

    constructor(make: (fade: number) => THREE.ShaderMaterial) {
        this.shown = make(1);
        for (let i = 1; i < FADE_STEPS; ++i) {
            this.coming.push(make(i / FADE_STEPS));
            this.leaving.push(make(-i / FADE_STEPS));
        }
    }

    get all(): THREE.ShaderMaterial[] {
        return [this.shown, ...this.coming, ...this.leaving];
    }

    /** `share` 0..1 of the way in, or, leaving, of the way out. */
    at(share: number, isLeaving: boolean): THREE.ShaderMaterial {
        const step = Math.min(Math.floor(share * FADE_STEPS), FADE_STEPS);
        if (isLeaving) {
            return step < 1 ? this.shown : this.leaving[Math.min(step, FADE_STEPS - 1) - 1]!;
        }
        return step >= FADE_STEPS ? this.shown : this.coming[Math.max(step, 1) - 1]!;
    }
}

export class TerrainMaterials {
    readonly ground: Fading;
    readonly water: Fading;
    readonly originPart = { value: new THREE.Vector3() };
    private readonly ghost = { value: 0 };

    constructor(textures: DetailTextures, detail: Detail) {
        const uniforms = (fade: number) => ({
            ...THREE.UniformsUtils.clone(THREE.UniformsLib.lights),
            ...lightUniforms,
            uHeights: { value: textures.heights },
            uSlopes: { value: textures.slopes },
            uOriginPart: this.originPart,
            uFade: { value: fade },
            uGhost: this.ghost,
        });
        const common = { defines: { DETAIL: detail }, lights: true, clipping: true };
        this.ground = new Fading((fade) => {
            const material = new THREE.ShaderMaterial({
                ...common, defines: { ...common.defines }, vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms: uniforms(fade),
            });
            material.shadowSide = THREE.DoubleSide;
            return material;
        });
        this.water = new Fading((fade) =>
            new THREE.ShaderMaterial({
                ...common, ...WATER_SIDES, defines: { ...common.defines },
                vertexShader: WATER_VERTEX, fragmentShader: WATER_FRAGMENT, uniforms: uniforms(fade),
            }),
        );
    }

    /** Planes that cut the world open now. */
    clip: THREE.Plane[] = [];

    private get all(): THREE.ShaderMaterial[] {
        return [...this.ground.all, ...this.water.all];
    }

    setDetail(detail: Detail): void {
        for (const material of this.all) {
            material.defines.DETAIL = detail;
            material.needsUpdate = true;
        }
    }

    setClip(planes: THREE.Plane[]): void {
        this.clip = planes;
        for (const material of this.all) {
            const differs = (material.clippingPlanes?.length ?? 0) !== planes.length;
            material.clippingPlanes = planes.length > 0 ? planes : null;
            material.needsUpdate ||= differs;
        }
        for (const material of this.ground.all) {
            material.side = planes.length > 0 ? THREE.DoubleSide : THREE.FrontSide;
        }
    }

    setGhost(share: number): void {
        this.ghost.value = share;
        const isGhost = share > 0;
        // Rivers are hollows too: the X-ray shows them.
        for (const material of this.water.all) {
            material.visible = !isGhost;
        }
        for (const material of this.ground.all) {
            if (material.transparent !== isGhost) {
                material.transparent = isGhost;
                material.depthWrite = !isGhost;
                material.needsUpdate = true;
            }
        }
    }
}
