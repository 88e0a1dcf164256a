// How water looks: it mirrors the sky, more so the flatter one looks at it, and what it does not mirror it
// lets through, less so the deeper it is. Depths come with the vertices (stream/tile_mesh.ts).
import * as THREE from 'three';

import { AIR_GLSL } from './light';

export const WATER_VERTEX = /* glsl */ `
#include <common>
#include <shadowmap_pars_vertex>
#include <clipping_planes_pars_vertex>
attribute vec4 tint;
attribute vec4 surface;
varying vec3 vWorld;
varying vec3 vNormalWorld;
varying vec3 vColor;
varying float vDepth;

void main() {
    vec3 objectNormal = normal;
    vec3 transformedNormal = normalMatrix * objectNormal;
    vec4 worldPosition = modelMatrix * vec4(position, 1.0);
    vec4 mvPosition = viewMatrix * worldPosition;
    vWorld = worldPosition.xyz;
    vNormalWorld = objectNormal;
    vColor = tint.rgb;
    vDepth = surface.x * (255.0 / 8.0);
    gl_Position = projectionMatrix * mvPosition;
    #include <clipping_planes_vertex>
    #include <shadowmap_vertex>
}
`;

export const WATER_FRAGMENT = /* glsl */ `
#include <common>
#include <packing>
#include <lights_pars_begin>
#include <shadowmap_pars_fragment>
#include <shadowmask_pars_fragment>
#include <clipping_planes_pars_fragment>
${AIR_GLSL}
uniform sampler2D uSlopes;
uniform vec3 uOriginPart;
uniform float uTime;
uniform float uFade;
varying vec3 vWorld;
varying vec3 vNormalWorld;
varying vec3 vColor;
varying float vDepth;

float dither(vec2 at) {
    return fract(52.9829189 * fract(dot(at, vec2(0.06711056, 0.00583715))));
}

void main() {
    #include <clipping_planes_fragment>
    if (uFade < 1.0) {
        float at = dither(gl_FragCoord.xy);
        if (uFade >= 0.0 ? at >= uFade : at < -uFade) {
            discard;
        }
    }
    vec3 eye = cameraPosition - vWorld;
    float distance = length(eye);
    eye /= distance;
    vec3 normal = normalize(vNormalWorld);
    // Where water falls it is white, and mirrors nothing.
    float fall = smoothstep(0.6, 0.2, abs(normal.y));
    normal *= dot(normal, eye) < 0.0 ? -1.0 : 1.0;
    vec3 flat_normal = normal;
#if DETAIL > 0
    // Ripples of two sizes that drift apart; far ones are smaller than a pixel.
    vec2 point = (vWorld + uOriginPart).xz;
    vec2 bend = texture2D(uSlopes, point / 16.0 + uTime * vec2(0.011, 0.004)).zw - 0.5;
    bend += texture2D(uSlopes, point.yx / 64.0 - uTime * vec2(0.003, 0.005)).zw - 0.5;
    bend *= 0.10 * (1.0 - fall) * (1.0 - smoothstep(150.0, 900.0, distance));
    normal = normalize(normal + vec3(bend.x, 0.0, bend.y) * sign(normal.y));
#endif
    float facing = max(dot(eye, normal), 0.0);
    float mirror = (0.02 + 0.98 * pow(1.0 - facing, 5.0)) * (1.0 - fall);

    float shadow = getShadowMask() * smoothstep(-0.05, 0.06, uSunDirection.y);
    vec3 light = uSunColor * max(uSunDirection.y, 0.0) * mix(0.35, 1.0, shadow) + uAmbient + uHorizon * 0.10;
    vec3 body = mix(vColor * 0.8, vec3(0.75), fall * 0.55) * light * 0.42;
    // The way of a ray through the water to the bed, which looks shallower than it is.
    float path = vDepth / max(dot(eye, flat_normal), 0.3);
    float murk = max(1.0 - exp(-0.20 * path), 0.30 * smoothstep(0.0, 0.4, vDepth));
    murk = mix(murk, 0.55, fall);

    vec3 reflected = reflect(-eye, normal);
    reflected.y = abs(reflected.y);
    vec3 shown = mix(body * murk, skyColor(reflected), mirror);
    float alpha = murk + (1.0 - murk) * mirror;
    vec3 halfway = normalize(uSunDirection + eye);
    float glint = pow(max(dot(normal, halfway), 0.0), 240.0) * shadow * (1.0 - fall);
    shown += uSunColor * glint * 0.9;
    alpha = max(clamp(alpha, 0.02, 1.0), min(glint, 1.0));
    shown = withFog(shown / alpha, cameraPosition, vWorld);
    // Far away the bed is not to be told from its fog.
    alpha = mix(alpha, 1.0, smoothstep(1500.0, 6000.0, distance) * step(0.4, vDepth));
    gl_FragColor = vec4(shown, alpha);
    #include <tonemapping_fragment>
    #include <colorspace_fragment>
}
`;

/** Seen from below too. */
export const WATER_SIDES = { side: THREE.DoubleSide, forceSinglePass: true, transparent: true } as const;
