// The tiles that are on the screen. What is wanted is a set of squares; what is shown at any moment
// covers the plane without a hole as far as anything has come: while a square of the set is missing,
// its finer or coarser tiles from before stay, and once it is there they give way to it by dither.
import * as THREE from 'three';
import { squareName, wantSet, type Square } from 'terrane-client';

import type { TileMesh } from '../stream/messages';
import { DETAIL_PERIOD, type TerrainMaterials } from './terrain_material';

const FADE_SECONDS = 0.5;
/** Tiles that are neither wanted nor shown are kept while there are at most so many. */
const SPARE_TILES_MAX = 260;
/** The scene's origin moves when the eye is this far from it: floats stay fine, whatever the place. */
const ORIGIN_REACH = DETAIL_PERIOD * 16;

interface Tile {
    square: Square;
    name: string;
    mesh: THREE.Mesh | null;
    triangles: number;
    bytes: number;
    isWanted: boolean;
    isShown: boolean;
    fade: number;
    lastUse: number;
}

export class TileSet {
    readonly group = new THREE.Group();
    /** World position of the scene's (0, 0, 0): whole numbers. */
    readonly origin = { x: 0, z: 0 };
    private readonly tiles = new Map<string, Tile>();
    private leaves = new Set<string>();
    private inner = new Set<string>();
    private roots: Square[] = [];
    private showsCaves = true;
    private showsCaps = true;
    private isDirty = true;
    private isFading = false;
    private clock = 0;

    constructor(
        private readonly materials: TerrainMaterials,
        private readonly chunkSide: number,
        private readonly onDropped: (names: string[]) => void,
    ) {}

    /** What the stream wants now, for the same view. */
    setView(position: { x: number; z: number }, radiusChunks: number[]): void {
        const inner = new Set<string>();
        const leaves = wantSet(position, radiusChunks, this.chunkSide, (square) => inner.add(squareName(square)));
        const top = radiusChunks.length - 1;
        const roots = new Map<string, Square>();
        for (const { lod, x, z } of leaves) {
            const root = { lod: top, x: Math.floor(x / 2 ** (top - lod)), z: Math.floor(z / 2 ** (top - lod)) };
            roots.set(squareName(root), root);
        }
        this.inner = inner;
        this.leaves = new Set(leaves.map(squareName));
        this.roots = [...roots.values()];
        this.tiles.forEach((tile) => (tile.isWanted = this.leaves.has(tile.name)));
        this.isDirty = true;
    }

    add(square: Square, mesh: TileMesh | null): void {
        const name = squareName(square);
        const known = this.tiles.get(name);
        if (known !== undefined) {
            this.removeMesh(known);
        }
        const tile: Tile = known ?? {
            square,
            name,
            mesh: null,
            triangles: 0,
            bytes: 0,
            isWanted: this.leaves.has(name),
            isShown: false,
            fade: 0,
            lastUse: this.clock,
        };
        tile.mesh = mesh === null ? null : this.makeMesh(square, mesh);
        tile.triangles = mesh === null ? 0 : mesh.indices.length / 3;
        tile.bytes = mesh === null ? 0 : mesh.positions.byteLength + mesh.indices.byteLength + 12 * (mesh.positions.length / 3);
        this.tiles.set(name, tile);
        if (tile.isShown && tile.mesh !== null) {
            // Made again, it looks as it did.
            this.dress(tile, tile.fade, false);
            tile.mesh.visible = true;
        }
        this.isDirty = true;
    }

    /** What lies under much rock can be left out: nobody above the ground sees it. */
    setCaves(areShown: boolean): void {
        this.showsCaves = areShown;
        this.tiles.forEach(({ mesh }) => mesh !== null && this.drawCaves(mesh));
    }

    /** Caps are the walls that coarse tiles close level 0's caves with. */
    setCaps(areShown: boolean): void {
        this.showsCaps = areShown;
        this.tiles.forEach(({ mesh }) => mesh !== null && this.drawCaves(mesh));
    }

    /** Every frame. Gives whether anything changed. */
    update(seconds: number, eye: { x: number; z: number }): boolean {
        this.clock += seconds;
        const moved = this.moveOrigin(eye);
        let changed = moved;
        if (this.isDirty) {
            this.isDirty = false;
            this.choose();
            this.dropSpares();
            changed = true;
        }
        if (this.isFading) {
            this.fade(seconds);
            changed = true;
        }
        return changed;
    }

    clear(): void {
        for (const tile of this.tiles.values()) {
            this.removeMesh(tile);
        }
        this.tiles.clear();
        this.isDirty = true;
    }

    /** Meshes on the screen now, near ones for a ray to hit. */
    shownMeshes(maxLod: number): THREE.Mesh[] {
        const meshes = [];
        for (const { mesh, isShown, square } of this.tiles.values()) {
            if (mesh !== null && isShown && square.lod <= maxLod) {
                meshes.push(mesh);
            }
        }
        return meshes;
    }

    figures(): { tiles: number; shown: number; triangles: number; bytes: number; isFading: boolean } {
        let shown = 0;
        let triangles = 0;
        let bytes = 0;
        for (const tile of this.tiles.values()) {
            shown += tile.isShown ? 1 : 0;
            triangles += tile.isShown ? tile.triangles : 0;
            bytes += tile.bytes;
        }
        return { tiles: this.tiles.size, shown, triangles, bytes, isFading: this.isFading || this.isDirty };
    }

    /** Whether the ground under a point is drawn, at any level. */
    isCovered(x: number, z: number): boolean {
        for (const { square, isShown } of this.tiles.values()) {
            const side = this.chunkSide * 2 ** square.lod;
            if (isShown && Math.floor(x / side) === square.x && Math.floor(z / side) === square.z) {
                return true;
            }
        }
        return false;
    }

    private dress({ mesh }: Tile, share: number, isLeaving: boolean): void {
        if (mesh !== null) {
            mesh.material = this.materials.ground.at(share, isLeaving);
            for (const water of mesh.children as THREE.Mesh[]) {
                water.material = this.materials.water.at(share, isLeaving);
            }
        }
    }

    private drawCaves(mesh: THREE.Mesh): void {
        const { cavesFirst, lod } = mesh.userData as { cavesFirst: number; lod: number };
        const isDrawn = this.showsCaves && (this.showsCaps || lod === 0);
        mesh.geometry.setDrawRange(0, isDrawn ? Infinity : cavesFirst);
    }

    /** The ground, with the water as its child. Both have the same vertices. */
    private makeMesh(square: Square, tile: TileMesh): THREE.Mesh {
        const attributes = {
            position: new THREE.BufferAttribute(tile.positions, 3),
            normal: new THREE.BufferAttribute(tile.normals, 4, true),
            tint: new THREE.BufferAttribute(tile.colors, 4, true),
            surface: new THREE.BufferAttribute(tile.surfaces, 4, true),
        };
        const { lowest, highest, indices, waterFirst } = tile;
        const middle = this.chunkSide / 2;
        const half = (highest - lowest) / 2;
        const geometryOf = (part: Uint16Array | Uint32Array) => {
            const geometry = new THREE.BufferGeometry();
            Object.entries(attributes).forEach(([name, attribute]) => geometry.setAttribute(name, attribute));
            geometry.setIndex(new THREE.BufferAttribute(part, 1));
            geometry.boundingBox = new THREE.Box3(
                new THREE.Vector3(0, lowest, 0),
                new THREE.Vector3(this.chunkSide, highest, this.chunkSide),
            );
            geometry.boundingSphere = new THREE.Sphere(
                new THREE.Vector3(middle, lowest + half, middle),
                Math.hypot(middle, half, middle) + 1,
            );
            return geometry;
        };
        const mesh = new THREE.Mesh(geometryOf(indices.subarray(0, waterFirst)), this.materials.ground.at(0, false));
        if (waterFirst < indices.length) {
            const water = new THREE.Mesh(geometryOf(indices.subarray(waterFirst)), this.materials.water.at(0, false));
            water.receiveShadow = true;
            water.matrixAutoUpdate = false;
            mesh.add(water);
        }
        mesh.userData = { cavesFirst: tile.cavesFirst, lod: square.lod };
        this.drawCaves(mesh);
        const scale = 2 ** square.lod;
        mesh.scale.set(scale, 1, scale);
        mesh.castShadow = square.lod <= 1;
        mesh.receiveShadow = true;
        mesh.visible = false;
        mesh.matrixAutoUpdate = false;
        this.place(mesh, square);
        this.group.add(mesh);
        return mesh;
    }

    private place(mesh: THREE.Mesh, { lod, x, z }: Square): void {
        const side = this.chunkSide * 2 ** lod;
        mesh.position.set(x * side - this.origin.x, 0, z * side - this.origin.z);
        mesh.updateMatrix();
        mesh.updateMatrixWorld(true);
    }

    private removeMesh(tile: Tile): void {
        if (tile.mesh !== null) {
            this.group.remove(tile.mesh);
            tile.mesh.geometry.dispose();
            (tile.mesh.children as THREE.Mesh[]).forEach(({ geometry }) => geometry.dispose());
            tile.mesh = null;
        }
    }

    private moveOrigin(eye: { x: number; z: number }): boolean {
        if (Math.max(Math.abs(eye.x - this.origin.x), Math.abs(eye.z - this.origin.z)) < ORIGIN_REACH) {
            return false;
        }
        this.origin.x = Math.round(eye.x / DETAIL_PERIOD) * DETAIL_PERIOD;
        this.origin.z = Math.round(eye.z / DETAIL_PERIOD) * DETAIL_PERIOD;
        const part = (value: number) => value - Math.floor(value / (DETAIL_PERIOD * 8)) * DETAIL_PERIOD * 8;
        this.materials.originPart.value.set(part(this.origin.x), 0, part(this.origin.z));
        this.tiles.forEach(({ mesh, square }) => mesh !== null && this.place(mesh, square));
        return true;
    }

    /** Walks the wanted quadtree and marks what shall be shown. */
    private choose(): void {
        const chosen = new Set<string>();
        const covered = this.coveredNow();
        for (const root of this.roots) {
            const shown: string[] = [];
            this.cover(root, shown);
            shown.forEach((name) => chosen.add(name));
        }
        for (const tile of this.tiles.values()) {
            const isShown = chosen.has(tile.name);
            if (isShown) {
                tile.lastUse = this.clock;
            }
            if (isShown !== tile.isShown) {
                tile.isShown = isShown;
                this.isFading = true;
                if (isShown && tile.fade === 0 && !covered(tile.square)) {
                    // Over nothing it appears at once: a fade would show holes.
                    tile.fade = 1;
                    this.dress(tile, 1, false);
                }
            }
        }
    }

    /** Whether anything of a square is on the screen, as coarser or finer tiles. */
    private coveredNow(): (square: Square) => boolean {
        const shown = new Set<string>();
        const above = new Set<string>();
        const up = ({ lod, x, z }: Square) => ({ lod: lod + 1, x: Math.floor(x / 2), z: Math.floor(z / 2) });
        const top = this.roots[0]?.lod ?? 0;
        for (const { name, square, fade } of this.tiles.values()) {
            if (fade > 0) {
                shown.add(name);
                for (let parent = up(square); parent.lod <= top; parent = up(parent)) {
                    above.add(squareName(parent));
                }
            }
        }
        return (square) => {
            if (above.has(squareName(square))) {
                return true;
            }
            for (let parent = up(square); parent.lod <= top; parent = up(parent)) {
                if (shown.has(squareName(parent))) {
                    return true;
                }
            }
            return false;
        };
    }

    /** Appends tiles that show as much of a square as is there; true if that is all of it. */
    private cover(square: Square, shown: string[]): boolean {
        const name = squareName(square);
        const own = this.tiles.get(name);
        if (this.leaves.has(name)) {
            if (own !== undefined) {
                shown.push(name);
                return true;
            }
            return this.coverFiner(square, shown);
        }
        if (!this.inner.has(name)) {
            return true; // beyond the view
        }
        const children: string[] = [];
        let isWhole = true;
        for (let i = 0; i < 4; ++i) {
            const child = { lod: square.lod - 1, x: square.x * 2 + (i & 1), z: square.z * 2 + (i >> 1) };
            isWhole = this.cover(child, children) && isWhole;
        }
        if (!isWhole && own !== undefined) {
            shown.push(name);
            return true;
        }
        shown.push(...children);
        return isWhole;
    }

    /** A square from tiles that are finer than wanted, left over from before. */
    private coverFiner(square: Square, shown: string[], depth = 0): boolean {
        if (square.lod === 0 || depth > 3) {
            return false;
        }
        let isWhole = true;
        for (let i = 0; i < 4; ++i) {
            const child = { lod: square.lod - 1, x: square.x * 2 + (i & 1), z: square.z * 2 + (i >> 1) };
            const name = squareName(child);
            if (this.tiles.has(name)) {
                shown.push(name);
            } else {
                isWhole = this.coverFiner(child, shown, depth + 1) && isWhole;
            }
        }
        return isWhole;
    }

    private fade(seconds: number): void {
        this.isFading = false;
        const step = seconds / FADE_SECONDS;
        for (const tile of this.tiles.values()) {
            const target = tile.isShown ? 1 : 0;
            if (tile.fade === target) {
                if (tile.mesh !== null && tile.isShown && !tile.mesh.visible) {
                    tile.mesh.visible = true;
                }
                continue;
            }
            tile.fade = tile.isShown ? Math.min(tile.fade + step, 1) : Math.max(tile.fade - step, 0);
            this.isFading ||= tile.fade !== target;
            this.isDirty ||= tile.fade === 0;
            if (tile.mesh !== null) {
                tile.mesh.visible = tile.fade > 0;
                this.dress(tile, tile.isShown ? tile.fade : 1 - tile.fade, !tile.isShown);
            }
        }
    }

    private dropSpares(): void {
        const spare = [...this.tiles.values()].filter((tile) => !tile.isWanted && !tile.isShown && tile.fade === 0);
        if (spare.length <= SPARE_TILES_MAX) {
            return;
        }
        spare.sort((a, b) => a.lastUse - b.lastUse);
        const dropped = spare.slice(0, spare.length - SPARE_TILES_MAX / 2);
        for (const tile of dropped) {
            this.removeMesh(tile);
            this.tiles.delete(tile.name);
        }
        this.onDropped(dropped.map(({ name }) => name));
    }
}
