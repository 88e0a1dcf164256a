// The sun and the colours of the sky at any hour. One set of uniforms is shared by everything that is
// lit, so that fog, sky and ground always agree. All colours are linear.
import * as THREE from 'three';

interface Hour {
    /** Sine of the sun's height. */
    height: number;
    zenith: THREE.Color;
    horizon: THREE.Color;
    sun: THREE.Color;
    ambient: THREE.Color;
}

const color = (hex: number, strength = 1) => new THREE.Color(hex).multiplyScalar(strength);

const HOURS: Hour[] = [
    { height: -0.12, zenith: color(0x0b1430, 0.5), horizon: color(0x57476b, 0.55), sun: color(0xff7a4a, 0.0), ambient: color(0x4a5686, 0.34) },
    { height: 0.02, zenith: color(0x24406f, 0.75), horizon: color(0xe89a6c, 0.95), sun: color(0xff8b4d, 1.7), ambient: color(0x7584ad, 0.55) },
    { height: 0.22, zenith: color(0x2c62ab, 0.9), horizon: color(0xdcc9b3, 1.0), sun: color(0xffc48a, 3.0), ambient: color(0x8faedd, 0.72) },
    { height: 0.55, zenith: color(0x2566b8, 0.95), horizon: color(0xbfd6ea, 1.0), sun: color(0xfff0d8, 3.5), ambient: color(0x93b8ea, 0.82) },
    { height: 1.0, zenith: color(0x1f62b8, 1.0), horizon: color(0xb5d3ee, 1.0), sun: color(0xfffaf0, 3.7), ambient: color(0x96bcf0, 0.88) },
];

export const lightUniforms = {
    uSunDirection: { value: new THREE.Vector3(0.5, 0.5, 0.3).normalize() },
    uSunColor: { value: new THREE.Color() },
    uZenith: { value: new THREE.Color() },
    uHorizon: { value: new THREE.Color() },
    uAmbient: { value: new THREE.Color() },
    /** Share of light lost by a voxel of air at height 0, and how it thins with height. */
    uFogDensity: { value: 0.00017 },
    uFogFalloff: { value: 0.0022 },
    uTime: { value: 0 },
};

/** Colour of the sky without clouds, and fog over a distance. Shared by every shader. */
export const AIR_GLSL = /* glsl */ `
uniform vec3 uSunDirection;
uniform vec3 uSunColor;
uniform vec3 uZenith;
uniform vec3 uHorizon;
uniform vec3 uAmbient;
uniform float uFogDensity;
uniform float uFogFalloff;

vec3 skyColor(vec3 direction) {
    float up = max(direction.y, 0.0);
    float towardsSun = max(dot(direction, uSunDirection), 0.0);
    vec3 sky = mix(uHorizon, uZenith, 1.0 - exp(-up * 4.2));
    // Dust near the ground scatters forward: the horizon glows under the sun.
    float low = exp(-up * 6.0);
    sky += uSunColor * (0.055 * pow(towardsSun, 6.0) * (0.35 + low) + 0.09 * pow(towardsSun, 48.0));
    sky = mix(sky, uHorizon * 0.62, smoothstep(0.0, -0.35, direction.y));
    return sky;
}

// Air thins out with height: the mean density along the ray, in closed form.
vec3 withFog(vec3 color, vec3 eye, vec3 point) {
    vec3 ray = point - eye;
    float distance = length(ray);
    vec3 direction = ray / max(distance, 1e-3);
    float rise = uFogFalloff * ray.y;
    float mean = abs(rise) > 1e-3 ? (1.0 - exp(-rise)) / rise : 1.0 - 0.5 * rise;
    float depth = uFogDensity * distance * clamp(mean * exp(-uFogFalloff * max(eye.y, 0.0)), 0.0, 4.0);
    vec3 through = exp(-depth * vec3(0.82, 1.0, 1.28));
    vec3 haze = skyColor(normalize(vec3(direction.x, max(direction.y, 0.0) * 0.5 + 0.015, direction.z)));
    return color * through + haze * (1.0 - through);
}
`;

/** `hour` 0..24; the sun rises at 6 in the east (+x) and passes the south (+z). */
export function setHour(hour: number): void {
    const turn = ((hour - 6) / 12) * Math.PI;
    const direction = lightUniforms.uSunDirection.value;
    direction.set(Math.cos(turn), Math.sin(turn) * 0.86, Math.sin(turn) * 0.42 + 0.12).normalize();
    const { y } = direction;
    let i = 1;
    while (i < HOURS.length - 1 && HOURS[i]!.height < y) {
        ++i;
    }
    const low = HOURS[i - 1]!;
    const high = HOURS[i]!;
    const t = THREE.MathUtils.clamp((y - low.height) / (high.height - low.height), 0, 1);
    lightUniforms.uZenith.value.lerpColors(low.zenith, high.zenith, t);
    lightUniforms.uHorizon.value.lerpColors(low.horizon, high.horizon, t);
    lightUniforms.uSunColor.value.lerpColors(low.sun, high.sun, t);
    lightUniforms.uAmbient.value.lerpColors(low.ambient, high.ambient, t);
}
