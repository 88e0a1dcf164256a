// Flying and walking: mouse, keyboard and touch to a position in the world and a direction. Positions
// are doubles of world voxels; the picture is drawn around its own origin.
import * as THREE from 'three';

import type { GroundMap } from './ground_map';

const EYE_HEIGHT = 1.75;
const STEP_HEIGHT = 1.1;
const WALK_SPEED = 5.5;
const RUN_FACTOR = 2.4;
const GRAVITY = 19;
const JUMP_SPEED = 7.6;
const PITCH_MAX = Math.PI / 2 - 0.02;
const LOOK_PER_PIXEL = 0.0026;
const FLY_SPEED_MIN = 4;
const FLY_SPEED_MAX = 2000;
/** A flyer stays this far over the ground. */
const FLY_CLEARANCE = 1.2;

export type Mode = 'fly' | 'walk';

export class Controls {
    readonly position = { x: 0, y: 260, z: 0 };
    readonly velocity = new THREE.Vector3();
    yaw = -2.3;
    pitch = -0.28;
    mode: Mode = 'fly';
    flySpeed = 45;
    ground: GroundMap | undefined;
    /** Told when the mode is changed by a key. */
    onMode: (mode: Mode) => void = () => {};
    /** Takes a pointer that shall not turn the view, e.g. one that drags the cut. */
    grab: (event: PointerEvent) => boolean = () => false;
    onDrag: (event: PointerEvent) => void = () => {};
    onDrop: () => void = () => {};
    /** A click or tap that did not move. */
    onTap: (x: number, y: number) => void = () => {};

    private readonly keys = new Set<string>();
    private readonly pointers = new Map<number, { kind: 'look' | 'move' | 'grab'; x: number; y: number; startX: number; startY: number; moved: number }>();
    private readonly stick = { x: 0, y: 0 };
    private fall = 0;
    private isOnGround = false;

    constructor(private readonly canvas: HTMLElement) {
        canvas.addEventListener('pointerdown', (event) => this.pointerDown(event));
        canvas.addEventListener('pointermove', (event) => this.pointerMove(event));
        canvas.addEventListener('pointerup', (event) => this.pointerUp(event));
        canvas.addEventListener('pointercancel', (event) => this.pointerUp(event));
        canvas.addEventListener('contextmenu', (event) => event.preventDefault());
        canvas.addEventListener('wheel', (event) => this.wheel(event), { passive: false });
        window.addEventListener('keydown', (event) => this.keyDown(event));
        window.addEventListener('keyup', (event) => this.keys.delete(event.code));
        window.addEventListener('blur', () => this.keys.clear());
    }

    direction(out = new THREE.Vector3()): THREE.Vector3 {
        const flat = Math.cos(this.pitch);
        return out.set(Math.sin(this.yaw) * flat, Math.sin(this.pitch), Math.cos(this.yaw) * flat);
    }

    lookAlong(x: number, y: number, z: number): void {
        this.yaw = Math.atan2(x, z);
        this.pitch = THREE.MathUtils.clamp(Math.atan2(y, Math.hypot(x, z)), -PITCH_MAX, PITCH_MAX);
    }

    setMode(mode: Mode): void {
        this.mode = mode;
        this.fall = 0;
        this.velocity.set(0, 0, 0);
        this.onMode(mode);
    }

    stop(): void {
        this.velocity.set(0, 0, 0);
        this.fall = 0;
    }

    update(seconds: number): void {
        const key = (...codes: string[]) => (codes.some((code) => this.keys.has(code)) ? 1 : 0);
        const ahead = THREE.MathUtils.clamp(key('KeyW', 'ArrowUp') - key('KeyS', 'ArrowDown') - this.stick.y, -1, 1);
        const aside = THREE.MathUtils.clamp(key('KeyD', 'ArrowRight') - key('KeyA', 'ArrowLeft') + this.stick.x, -1, 1);
        const isFast = key('ShiftLeft', 'ShiftRight') === 1;
        // Seen along +z, +x is on the left: right is direction x up.
        const right = new THREE.Vector3(-Math.cos(this.yaw), 0, Math.sin(this.yaw));
        if (this.mode === 'fly') {
            const up = key('Space', 'KeyE') - key('KeyC', 'KeyQ', 'ControlLeft');
            const speed = this.flySpeed * (isFast ? 4 : 1);
            const target = this.direction().multiplyScalar(ahead).addScaledVector(right, aside);
            target.y += up;
            if (target.lengthSq() > 1) {
                target.normalize();
            }
            this.velocity.lerp(target.multiplyScalar(speed), 1 - Math.exp(-seconds * 6));
            if (this.velocity.length() < 0.02) {
                this.velocity.set(0, 0, 0);
            }
            this.move(seconds);
            const floor = this.ground?.floorUnder(this.position.x, this.position.y, this.position.z, 0.5);
            if (floor !== undefined && this.position.y < floor + FLY_CLEARANCE) {
                this.position.y = floor + FLY_CLEARANCE;
                this.velocity.y = Math.max(this.velocity.y, 0);
            }
        } else {
            this.walk(seconds, ahead, aside, right, isFast);
        }
    }

    private move(seconds: number): void {
        this.position.x += this.velocity.x * seconds;
        this.position.y += this.velocity.y * seconds;
        this.position.z += this.velocity.z * seconds;
    }

    private walk(seconds: number, ahead: number, aside: number, right: THREE.Vector3, isFast: boolean): void {
        const speed = WALK_SPEED * (isFast ? RUN_FACTOR : 1);
        const target = new THREE.Vector3(Math.sin(this.yaw), 0, Math.cos(this.yaw)).multiplyScalar(ahead).addScaledVector(right, aside);
        if (target.lengthSq() > 1) {
            target.normalize();
        }
        target.multiplyScalar(speed);
        const share = 1 - Math.exp(-seconds * (this.isOnGround ? 12 : 2));
        this.velocity.x += (target.x - this.velocity.x) * share;
        this.velocity.z += (target.z - this.velocity.z) * share;
        const { ground, position } = this;
        const feet = position.y - EYE_HEIGHT;
        const floorHere = ground?.floorUnder(position.x, feet, position.z, STEP_HEIGHT);
        if (ground === undefined || floorHere === undefined) {
            this.velocity.set(0, 0, 0); // Nothing is known of the ground yet: wait rather than fall.
            return;
        }
        // Along each axis alone, so that one slides along a wall.
        for (const axis of ['x', 'z'] as const) {
            const next = { x: position.x, z: position.z };
            next[axis] += this.velocity[axis] * seconds;
            const floor = ground.floorUnder(next.x, feet, next.z, STEP_HEIGHT);
            const isWall = floor === undefined || floor > feet + STEP_HEIGHT || ground.ceilingOver(next.x, floor + 0.2, next.z) < floor + EYE_HEIGHT;
            if (isWall) {
                this.velocity[axis] = 0;
            } else {
                position[axis] = next[axis];
            }
        }
        const floor = ground.floorUnder(position.x, feet, position.z, STEP_HEIGHT) ?? floorHere;
        this.fall -= GRAVITY * seconds;
        let next = feet + this.fall * seconds;
        const ceiling = ground.ceilingOver(position.x, feet + 0.5, position.z);
        if (next + EYE_HEIGHT + 0.1 > ceiling) {
            next = ceiling - EYE_HEIGHT - 0.1;
            this.fall = Math.min(this.fall, 0);
        }
        this.isOnGround = next <= floor + 0.02;
        if (this.isOnGround || (this.fall <= 0 && next - floor < 0.35)) {
            // Steps and slopes are climbed smoothly.
            next = feet + (floor - feet) * (1 - Math.exp(-seconds * 18));
            this.isOnGround = true;
            this.fall = this.keys.has('Space') ? JUMP_SPEED : 0;
            next += this.fall * seconds;
        }
        this.velocity.y = this.fall;
        position.y = next + EYE_HEIGHT;
    }

    private keyDown(event: KeyboardEvent): void {
        const target = event.target as HTMLElement;
        if (target.tagName === 'INPUT' || event.metaKey || event.ctrlKey && event.code !== 'ControlLeft') {
            return;
        }
        this.keys.add(event.code);
        if (event.code === 'KeyF' && !event.repeat) {
            this.setMode(this.mode === 'fly' ? 'walk' : 'fly');
        }
        if (event.code === 'Space' || event.code.startsWith('Arrow')) {
            event.preventDefault();
        }
    }

    private wheel(event: WheelEvent): void {
        event.preventDefault();
        if (this.mode === 'fly') {
            const factor = Math.exp(-event.deltaY * 0.0012);
            this.flySpeed = THREE.MathUtils.clamp(this.flySpeed * factor, FLY_SPEED_MIN, FLY_SPEED_MAX);
        }
    }

    private pointerDown(event: PointerEvent): void {
        (document.activeElement as HTMLElement | null)?.blur();
        this.canvas.setPointerCapture(event.pointerId);
        const isLeftThumb = event.pointerType === 'touch' && event.clientX < window.innerWidth * 0.42;
        const kind = this.grab(event) ? 'grab' : isLeftThumb ? 'move' : 'look';
        const { clientX: x, clientY: y } = event;
        this.pointers.set(event.pointerId, { kind, x, y, startX: x, startY: y, moved: 0 });
    }

    private pointerMove(event: PointerEvent): void {
        const pointer = this.pointers.get(event.pointerId);
        if (pointer === undefined) {
            return;
        }
        const dx = event.clientX - pointer.x;
        const dy = event.clientY - pointer.y;
        pointer.x = event.clientX;
        pointer.y = event.clientY;
        pointer.moved += Math.abs(dx) + Math.abs(dy);
        if (pointer.kind === 'grab') {
            this.onDrag(event);
        } else if (pointer.kind === 'move') {
            this.stick.x = THREE.MathUtils.clamp((pointer.x - pointer.startX) / 60, -1, 1);
            this.stick.y = THREE.MathUtils.clamp((pointer.y - pointer.startY) / 60, -1, 1);
        } else {
            this.yaw -= dx * LOOK_PER_PIXEL;
            this.pitch = THREE.MathUtils.clamp(this.pitch - dy * LOOK_PER_PIXEL, -PITCH_MAX, PITCH_MAX);
        }
    }

    private pointerUp(event: PointerEvent): void {
        const pointer = this.pointers.get(event.pointerId);
        this.pointers.delete(event.pointerId);
        if (pointer?.kind === 'move') {
            this.stick.x = this.stick.y = 0;
        }
        if (pointer?.kind === 'grab') {
            this.onDrop();
        }
        if (pointer !== undefined && pointer.moved < 6 && event.type === 'pointerup') {
            this.onTap(event.clientX, event.clientY);
        }
    }
}
