// X-ray: the ground becomes glass, caves and veins are seen in it. Their meshes are made by the mesher
// from columns in which they alone are solid.
import * as THREE from 'three';
import { squareName, type ServerHello, type Square } from 'terrane-client';

import { AIR_GLSL, lightUniforms } from '../scene/light';
import type { TileMesh } from '../stream/messages';

export const XRAY_RADIUS = 5;

const VERTEX = /* glsl */ `
attribute vec4 tint;
varying vec3 vWorld;
varying vec3 vNormalWorld;
varying vec3 vColor;
void main() {
    vec4 world = modelMatrix * vec4(position, 1.0);
    vWorld = world.xyz;
    vNormalWorld = normal;
    vColor = tint.rgb;
    gl_Position = projectionMatrix * viewMatrix * world;
}
`;

const FRAGMENT = /* glsl */ `
${AIR_GLSL}
uniform float uIsCave;
varying vec3 vWorld;
varying vec3 vNormalWorld;
varying vec3 vColor;
void main() {
    vec3 normal = normalize(vNormalWorld);
    vec3 eye = normalize(cameraPosition - vWorld);
    float facing = abs(dot(normal, eye));
    float rim = 1.0 - facing;
    vec3 cave = mix(vec3(0.05, 0.16, 0.22), vec3(0.35, 0.85, 1.0), rim * rim) * (0.55 + 0.45 * normal.y);
    vec3 vein = vColor * (0.55 + 0.75 * facing) + vColor * rim * 0.9 + vec3(0.06) * pow(facing, 12.0);
    vec3 color = mix(vein, cave, uIsCave);
    gl_FragColor = vec4(mix(color, withFog(color, cameraPosition, vWorld), 0.5), mix(1.0, 0.26 + 0.5 * rim, uIsCave));
    #include <tonemapping_fragment>
    #include <colorspace_fragment>
}
`;

export class Xray {
    readonly group = new THREE.Group();
    isOn = false;
    private readonly shown = new Map<string, { square: Square; meshes: THREE.Mesh[] }>();
    private wanted = new Set<string>();
    private readonly caves: THREE.ShaderMaterial;
    private readonly veins: THREE.ShaderMaterial;

    constructor(
        private readonly hello: ServerHello,
        private readonly ask: (squares: Square[]) => void,
    ) {
        const make = (isCave: boolean) =>
            new THREE.ShaderMaterial({
                vertexShader: VERTEX,
                fragmentShader: FRAGMENT,
                uniforms: { ...lightUniforms, uIsCave: { value: isCave ? 1 : 0 } },
                side: THREE.DoubleSide,
                transparent: isCave,
                depthWrite: !isCave,
            });
        this.caves = make(true);
        this.veins = make(false);
    }

    toggle(isOn: boolean): void {
        this.isOn = isOn;
        this.group.visible = isOn;
        if (!isOn) {
            this.ask([]);
            this.wanted.clear();
            this.shown.forEach((_, name) => this.remove(name));
        }
    }

    /** Asks for the stacks around the viewer when they have changed. */
    update(eye: { x: number; z: number }, origin: { x: number; z: number }): void {
        if (!this.isOn) {
            return;
        }
        const side = this.hello.chunkSide;
        const cx = Math.floor(eye.x / side);
        const cz = Math.floor(eye.z / side);
        if (!this.wanted.has(`center ${cx} ${cz}`)) {
            const squares: Square[] = [];
            for (let dz = -XRAY_RADIUS; dz <= XRAY_RADIUS; ++dz) {
                for (let dx = -XRAY_RADIUS; dx <= XRAY_RADIUS; ++dx) {
                    squares.push({ lod: 0, x: cx + dx, z: cz + dz });
                }
            }
            const distance = (square: Square) => Math.max(Math.abs(square.x - cx), Math.abs(square.z - cz));
            squares.sort((a, b) => distance(a) - distance(b));
            this.wanted = new Set([`center ${cx} ${cz}`, ...squares.map(squareName)]);
            [...this.shown.keys()].filter((name) => !this.wanted.has(name)).forEach((name) => this.remove(name));
            this.ask(squares);
        }
        for (const { square, meshes } of this.shown.values()) {
            meshes.forEach((mesh) => mesh.position.set(square.x * side - origin.x, 0, square.z * side - origin.z));
        }
    }

    add(square: Square, caves: TileMesh | null, veins: TileMesh | null): void {
        const name = squareName(square);
        this.remove(name);
        if (!this.isOn || !this.wanted.has(name)) {
            return;
        }
        const meshes: THREE.Mesh[] = [];
        for (const [mesh, material, order] of [[veins, this.veins, 10], [caves, this.caves, 11]] as const) {
            if (mesh !== null) {
                const geometry = new THREE.BufferGeometry();
                geometry.setAttribute('position', new THREE.BufferAttribute(mesh.positions, 3));
                geometry.setAttribute('normal', new THREE.BufferAttribute(mesh.normals, 4, true));
                geometry.setAttribute('tint', new THREE.BufferAttribute(mesh.colors, 4, true));
                geometry.setIndex(new THREE.BufferAttribute(mesh.indices, 1));
                const made = new THREE.Mesh(geometry, material);
                made.renderOrder = order;
                meshes.push(made);
                this.group.add(made);
            }
        }
        this.shown.set(name, { square, meshes });
    }

    get triangles(): { caves: number; veins: number } {
        const count = (material: THREE.Material) =>
            [...this.shown.values()].flatMap(({ meshes }) => meshes).filter((mesh) => mesh.material === material)
                .reduce((sum, mesh) => sum + mesh.geometry.index!.count / 3, 0);
        return { caves: count(this.caves), veins: count(this.veins) };
    }

    private remove(name: string): void {
        this.shown.get(name)?.meshes.forEach((mesh) => {
            this.group.remove(mesh);
            mesh.geometry.dispose();
        });
        this.shown.delete(name);
    }
}
