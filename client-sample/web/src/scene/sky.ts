// The sky: colour by direction, the sun's disc, and two layers of cloud out of the detail noise.
import * as THREE from 'three';

import { AIR_GLSL, lightUniforms } from './light';

const VERTEX = /* glsl */ `
varying vec3 vDirection;
void main() {
    vDirection = position;
    vec4 clip = projectionMatrix * vec4(mat3(viewMatrix) * position, 1.0);
    gl_Position = clip.xyww;
}
`;

const FRAGMENT = /* glsl */ `
${AIR_GLSL}
uniform sampler2D uNoise;
uniform float uTime;
uniform vec2 uDrift;
varying vec3 vDirection;

float cloudAt(vec2 at) {
    float wide = texture2D(uNoise, at).a;
    float fine = texture2D(uNoise, at * 3.7 + 0.31).a;
#if CLOUDS > 0
    float wisp = texture2D(uNoise, at * 11.0 - 0.17).b;
#else
    float wisp = 0.5;
#endif
    return smoothstep(0.54, 0.92, wide * 0.66 + fine * 0.28 + wisp * 0.12);
}

void main() {
    vec3 direction = normalize(vDirection);
    vec3 sky = skyColor(direction);
    float towardsSun = dot(direction, uSunDirection);
    if (direction.y > 0.0) {
        vec2 at = direction.xz / (direction.y + 0.12) * 0.11 + uDrift + uTime * 0.0006;
        float cloud = cloudAt(at);
        // Less cloud towards the sun means thinner there: its own light shows through.
#if CLOUDS > 0
        float lit = clamp(cloud - cloudAt(at + uSunDirection.xz * 0.012), -0.4, 0.5);
#else
        float lit = 0.25 - 0.5 * cloud;
#endif
        vec3 shade = mix(uAmbient * 0.75 + uHorizon * 0.30, uAmbient * 0.35 + uSunColor * 0.30 + uHorizon * 0.25, 0.55 + lit);
        shade += uSunColor * 0.22 * pow(max(towardsSun, 0.0), 10.0) * (1.0 - cloud);
        sky = mix(sky, shade, cloud * 0.86 * smoothstep(0.0, 0.22, direction.y));
    }
    float disc = smoothstep(0.99986, 0.99994, towardsSun);
    sky += uSunColor * 9.0 * disc * smoothstep(-0.02, 0.02, direction.y);
    gl_FragColor = vec4(sky, 1.0);
    #include <tonemapping_fragment>
    #include <colorspace_fragment>
}
`;

export function makeSky(noise: THREE.Texture): THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial> {
    const material = new THREE.ShaderMaterial({
        vertexShader: VERTEX,
        fragmentShader: FRAGMENT,
        uniforms: { ...lightUniforms, uNoise: { value: noise }, uDrift: { value: new THREE.Vector2(0.13, 0.41) } },
        defines: { CLOUDS: 1 },
        side: THREE.BackSide,
        depthWrite: false,
        depthFunc: THREE.LessEqualDepth,
    });
    const sky = new THREE.Mesh(new THREE.IcosahedronGeometry(1, 4), material);
    sky.frustumCulled = false;
    sky.renderOrder = 1000;
    return sky;
}
