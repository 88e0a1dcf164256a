// One viewer: a place in one world, what is seen from it and what is looked into.
import * as THREE from 'three';
import type { Column, ServerHello } from 'terrane-client';

import { Cut } from './inside/cut';
import { Xray } from './inside/xray';
import { httpBase, parseCoordinates, readPlace, webSocketUrl, writePlace } from './place';
import { Controls } from './scene/controls';
import { GroundMap } from './scene/ground_map';
import { QUALITIES, QualityControl } from './scene/quality';
import { FIELD_OF_VIEW_DEGREES, Stage } from './scene/stage';
import { TerrainMaterials } from './scene/terrain_material';
import { TileSet } from './scene/tile_set';
import type { Comparison, FromWorker, StreamFigures, ToWorker, WireFormat } from './stream/messages';
import type { Suggested } from './stream/suggest';
import { FiguresPanel } from './ui/figures_panel';
import { MiniMap } from './ui/mini_map';
import { ProbePanel } from './ui/probe_panel';
import { Shell } from './ui/shell';

const VIEW_PERIOD_MS = 120;
const PLACE_PERIOD_MS = 700;
const MAP_PERIOD_MS = 250;
const FRAME_SECONDS_MAX = 0.1;
const IDLE_FRAME_MS = 400;
const CUT_AHEAD_MIN = 70;
const CUT_AHEAD_MAX = 300;
/** Radians below the picture's middle. */
const CUT_BELOW_CENTER = 0.1;
const COMPARED_SIDE = 5;

/** All that belongs to the world of the session. */
interface World {
    hello: ServerHello;
    tiles: TileSet;
    ground: GroundMap;
    cut: Cut;
    xray: Xray;
    probe: ProbePanel;
}

export class Viewer {
    world: World | undefined;
    readonly controls: Controls;
    figures: StreamFigures | undefined;
    /** The last comparison of both formats. */
    comparison: Comparison | null = null;
    /** Times since the page began, in ms. */
    readonly times = { hello: 0, firstTile: 0, nearView: 0 };
    framesDrawn = 0;

    private readonly stage: Stage;
    private readonly quality: QualityControl;
    private readonly materials: TerrainMaterials;
    private readonly shell: Shell;
    private readonly panel: FiguresPanel;
    private readonly map: MiniMap;
    private readonly worker = new Worker(new URL('./stream/stream.worker.ts', import.meta.url), { type: 'module' });
    private readonly queries = new Map<number, { resolve: (column: Column) => void; reject: (error: Error) => void }>();
    private nextQuery = 1;
    private format: WireFormat = 'draco';
    private url: string;
    private token: string;
    private showsCaves: boolean;
    private isProbing = false;
    private hasPlace: boolean;
    private lastFrameMs = performance.now();
    private lastDrawMs = 0;
    private lastViewMs = 0;
    private lastPlaceMs = 0;
    private lastMapMs = 0;
    private frameMs = 16;
    private drawMs = 16;
    private needsFrame = true;
    private groundAsked = '';
    private lastPose = '';
    private grabbed: { x: number; y: number; z: number } | undefined;

    constructor(
        private readonly canvas: HTMLCanvasElement,
        ui: HTMLElement,
    ) {
        const query = new URLSearchParams(location.search);
        const address = query.get('server') ?? '';
        this.url = webSocketUrl(address, location);
        // First of all: the worker greets the server while this thread makes textures and programs.
        this.token = query.get('token') ?? '';
        this.connect();
        this.controls = new Controls(canvas);
        const place = readPlace(location.hash);
        this.hasPlace = place !== undefined;
        if (place !== undefined) {
            Object.assign(this.controls.position, { x: place.x, y: place.y, z: place.z });
            this.controls.yaw = place.yaw;
            this.controls.pitch = place.pitch;
        }
        this.format = query.get('format') === 'columns' ? 'columns' : 'draco';
        this.showsCaves = query.get('caves') !== '0';
        if (this.hasPlace) {
            // Every quality wants at least this much: it is under way before the first picture can be drawn.
            this.sendStream(QUALITIES[0]!.radiusChunks);
        }
        this.stage = new Stage(canvas);
        const hour = Number(query.get('hour'));
        if (hour > 0) {
            this.stage.setHour(hour);
        }
        const fixed = query.has('quality') ? Math.min(Math.max(Number(query.get('quality')), 0), 4) : undefined;
        this.quality = new QualityControl(this.stage.rendererName, this.stage.isSoftware, fixed);
        document.body.classList.toggle('plain', this.stage.isSoftware);
        this.stage.setQuality(this.quality.now);
        this.materials = new TerrainMaterials(this.stage.textures, this.quality.now.detail);
        this.shell = new Shell(ui, this.actions(), { hour: this.stage.hour, address, token: this.token });
        this.panel = new FiguresPanel(() => this.compare());
        this.map = new MiniMap((x, z) => this.jump(x, undefined, z));
        this.shell.side.append(this.map.root, this.shell.fields, this.panel.root);
        this.shell.press('format', this.format === 'columns', this.format === 'columns' ? 'Columns' : 'Draco');
        this.shell.press('caves', this.showsCaves);
        this.connectControls();
        this.worker.onmessage = ({ data }: MessageEvent<FromWorker>) => this.receive(data);
        window.addEventListener('resize', () => {
            this.stage.resize();
            this.needsFrame = true;
        });
        window.addEventListener('hashchange', () => {
            const next = readPlace(location.hash);
            if (next !== undefined) {
                this.hasPlace = true;
                Object.assign(this.controls.position, { x: next.x, y: next.y, z: next.z });
                this.controls.yaw = next.yaw;
                this.controls.pitch = next.pitch;
            }
        });
        requestAnimationFrame(() => this.frame());
    }

    /** Goes to a place; without a height, some way over the ground. */
    async jump(x: number, y: number | undefined, z: number): Promise<void> {
        const { position } = this.controls;
        this.controls.stop();
        this.hasPlace ||= this.world !== undefined;
        if (this.controls.mode === 'walk') {
            this.controls.setMode('fly');
        }
        let height = y ?? position.y;
        if (y === undefined) {
            try {
                height = topOf(await this.queryColumn(Math.round(x), Math.round(z)), this.world!.hello) + 42;
            } catch {
                // The height stays; the stream says what is wrong.
            }
        }
        Object.assign(position, { x, y: height, z });
        this.needsFrame = true;
    }

    /** Goes to the place that was found for a URL without one; if none was, to the middle. */
    private async begin(place: Suggested | undefined): Promise<void> {
        if (this.hasPlace) {
            return;
        }
        if (place === undefined) {
            await this.jump(0, undefined, 0);
        } else {
            const { x, y, z, yaw, pitch } = place;
            Object.assign(this.controls.position, { x, y, z });
            this.controls.yaw = yaw;
            this.controls.pitch = pitch;
        }
        this.hasPlace = true;
        this.needsFrame = true;
        this.sendView();
    }

    queryColumn(x: number, z: number): Promise<Column> {
        return new Promise((resolve, reject) => {
            const id = this.nextQuery++;
            this.queries.set(id, { resolve, reject });
            this.send({ kind: 'column', id, x, z });
        });
    }

    setFormat(format: WireFormat): void {
        this.format = format;
        this.shell.press('format', format === 'columns', format === 'columns' ? 'Columns' : 'Draco');
        this.sendView();
    }

    toggleCut(): void {
        const cut = this.world?.cut;
        if (cut === undefined) {
            return;
        }
        if (cut.isOn) {
            cut.close();
            this.send({ kind: 'sectionOff' });
            this.materials.setClip([]);
        } else {
            // From high up the near ground is below the picture: the cut goes where the ground is seen.
            const { x, y, z } = this.controls.position;
            const over = y - (this.world?.ground.floorUnder(x, y, z, 1) ?? y);
            const seenAt = over / Math.tan(Math.max(CUT_BELOW_CENTER - this.controls.pitch, CUT_BELOW_CENTER));
            cut.open({ x, z }, this.controls.yaw, Math.min(Math.max(CUT_AHEAD_MIN, seenAt), CUT_AHEAD_MAX));
        }
        this.drawCaps();
        this.shell.press('cut', cut.isOn);
        this.shell.showTools(cut.isOn, cut.withFlow);
        this.stage.shadowsChanged();
        this.needsFrame = true;
    }

    /** The walls that close level 0's caves are in the way of who looks into the ground. */
    private drawCaps(): void {
        if (this.world !== undefined) {
            const { tiles, cut, xray } = this.world;
            tiles.setCaps(!cut.isOn && !xray.isOn);
        }
    }

    toggleXray(): void {
        const xray = this.world?.xray;
        if (xray !== undefined) {
            xray.toggle(!xray.isOn);
            this.materials.setGhost(xray.isOn ? 1 : 0);
            this.drawCaps();
            this.shell.press('xray', xray.isOn);
            this.needsFrame = true;
        }
    }

    toggleProbe(): void {
        this.isProbing = !this.isProbing;
        this.shell.press('probe', this.isProbing);
        if (!this.isProbing && this.world !== undefined) {
            this.world.probe.root.hidden = true;
        } else {
            void this.probeAt(window.innerWidth / 2, window.innerHeight / 2);
        }
    }

    /** The frame as a PNG. */
    picture(): Promise<Blob> {
        this.stage.render(0);
        return new Promise((resolve, reject) => {
            this.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error('no picture'))), 'image/png');
        });
    }

    /** What the scene holds, for the panel and for tests. */
    sceneFigures() {
        const tiles = this.world?.tiles.figures() ?? { tiles: 0, shown: 0, triangles: 0, bytes: 0, isFading: false };
        const { position } = this.controls;
        return {
            ...tiles,
            frameMs: this.frameMs,
            quality: this.quality.now.name,
            drawCalls: this.stage.renderer.info.render.calls,
            isUnderfootThere: this.world?.tiles.isCovered(position.x, position.z) ?? false,
            xray: this.world?.xray.triangles,
        };
    }

    private actions() {
        return {
            mode: () => this.controls.setMode(this.controls.mode === 'fly' ? 'walk' : 'fly'),
            cut: () => this.toggleCut(),
            flow: () => {
                const cut = this.world?.cut;
                cut?.setFlow(!cut.withFlow);
                this.shell.showTools(cut?.isOn ?? false, cut?.withFlow ?? false);
            },
            turnCut: (radians: number) => this.world?.cut.turn(radians),
            xray: () => this.toggleXray(),
            probe: () => this.toggleProbe(),
            format: () => this.setFormat(this.format === 'draco' ? 'columns' : 'draco'),
            hour: (hour: number) => {
                this.stage.setHour(hour);
                this.needsFrame = true;
            },
            picture: () => void this.download(),
            jump: (text: string) => {
                const place = parseCoordinates(text);
                if (place === undefined) {
                    return 'two or three numbers, please: x z, or x y z';
                }
                void this.jump(place.x, place.y, place.z);
                return undefined;
            },
            server: (address: string) => this.switchServer(address),
            token: (token: string) => this.useToken(token),
            caves: () => this.toggleCaves(),
        };
    }

    private connectControls(): void {
        const { controls } = this;
        controls.onMode = (mode) => {
            this.shell.press('mode', mode === 'walk', mode === 'walk' ? 'Walk' : 'Fly');
            this.shell.say(mode === 'walk' ? 'on foot: Space jumps, F flies' : 'flying: the wheel sets the speed');
        };
        controls.grab = (event) => {
            this.grabbed = this.cutHit(event.clientX, event.clientY);
            return this.grabbed !== undefined;
        };
        controls.onDrag = (event) => this.dragCut(event);
        controls.onDrop = () => (this.grabbed = undefined);
        controls.onTap = (x, y) => {
            if (this.isProbing) {
                void this.probeAt(x, y);
            }
        };
        this.canvas.addEventListener('pointermove', (event) => {
            if (event.buttons === 0) {
                this.canvas.classList.toggle('over-cut', this.cutHit(event.clientX, event.clientY) !== undefined);
            }
        });
    }

    private rayAt(x: number, y: number): THREE.Raycaster {
        const caster = new THREE.Raycaster();
        const at = new THREE.Vector2((x / window.innerWidth) * 2 - 1, 1 - (y / window.innerHeight) * 2);
        caster.setFromCamera(at, this.stage.camera);
        return caster;
    }

    private cutHit(x: number, y: number) {
        const { cut, tiles } = this.world ?? {};
        return cut?.isOn ? cut.hit(this.rayAt(x, y).ray, tiles!.origin) : undefined;
    }

    /** Dragging moves the face along its normal by as much as the pointer moves aside at its depth. */
    private dragCut(event: PointerEvent): void {
        if (this.grabbed === undefined) {
            return;
        }
        const { position } = this.controls;
        const distance = Math.hypot(this.grabbed.x - position.x, this.grabbed.z - position.z);
        const perPixel = (2 * distance * Math.tan(((this.stage.camera.fov / 2) * Math.PI) / 180)) / window.innerHeight;
        const { cut } = this.world!;
        cut.shift(-event.movementY * perPixel * 1.6);
        cut.slide(0);
        if (Math.abs(event.movementX) > Math.abs(event.movementY) * 1.5) {
            cut.turn(event.movementX * 0.002);
        }
        this.needsFrame = true;
    }

    private async probeAt(x: number, y: number): Promise<void> {
        const { tiles, probe } = this.world ?? {};
        if (tiles === undefined || probe === undefined) {
            return;
        }
        const caster = this.rayAt(x, y);
        const onCut = this.cutHit(x, y);
        let world = onCut;
        if (world === undefined) {
            const planes = this.materials.clip;
            const hit = caster.intersectObjects(tiles.shownMeshes(3), false)
                .find(({ point }) => planes.every((plane) => plane.distanceToPoint(point) >= 0));
            world = hit && { x: hit.point.x + tiles.origin.x, y: hit.point.y, z: hit.point.z + tiles.origin.z };
        }
        if (world === undefined) {
            return;
        }
        try {
            probe.show(await this.queryColumn(Math.round(world.x), Math.round(world.z)), '');
        } catch (error) {
            probe.show(null, (error as Error).message);
        }
        probe.root.hidden = !this.isProbing;
    }

    private async download(): Promise<void> {
        const link = document.createElement('a');
        link.href = URL.createObjectURL(await this.picture());
        const { x, y, z } = this.controls.position;
        link.download = `${this.world?.hello.worldName ?? 'terrane'}_${[x, y, z].map(Math.round).join('_')}.png`;
        link.click();
        setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    }

    private switchServer(address: string): void {
        try {
            this.url = webSocketUrl(address, location);
        } catch {
            this.shell.say(`“${address}” is no server address`, true);
            return;
        }
        const page = new URL(location.href);
        if (address === '') {
            page.searchParams.delete('server');
        } else {
            page.searchParams.set('server', address);
        }
        page.hash = '';
        history.replaceState(null, '', page);
        this.hasPlace = false;
        this.shell.setState(false, 'connecting…');
        this.connect();
    }

    private connect(): void {
        this.send({ kind: 'connect', url: this.url, token: this.token });
    }

    /** The token stays in the page: an address is copied and logged. */
    private useToken(token: string): void {
        this.token = token;
        this.shell.setState(false, 'connecting…');
        this.connect();
    }

    private toggleCaves(): void {
        this.showsCaves = !this.showsCaves;
        this.world?.tiles.setCaves(this.showsCaves);
        this.shell.press('caves', this.showsCaves);
        this.shell.say(this.showsCaves ? 'caves are drawn' : 'caves are left out: what is under much rock');
        this.stage.shadowsChanged();
        this.needsFrame = true;
    }

    /** Streams a field that nobody has seen in both formats and measures them. */
    compare(): void {
        if (this.world === undefined) {
            return;
        }
        // Somewhere that nobody has been: both formats are made anew.
        const far = () => Math.floor((Math.random() - 0.5) * 60_000);
        const [cx, cz] = [far(), far()];
        const squares = Array.from({ length: COMPARED_SIDE ** 2 }, (_, i) => ({
            lod: 0,
            x: cx + (i % COMPARED_SIDE),
            z: cz + Math.floor(i / COMPARED_SIDE),
        }));
        this.send({ kind: 'compare', squares });
    }

    private send(message: ToWorker): void {
        this.worker.postMessage(message);
    }

    private receive(message: FromWorker): void {
        switch (message.kind) {
            case 'hello':
                this.greet(message.hello, message.isNewWorld);
                break;
            case 'closed':
                this.shell.setState(false, `${message.reason}; trying again`);
                this.shell.say(`no connection: ${message.reason}`, true, 0);
                if (/token/i.test(message.reason)) {
                    this.shell.askToken();
                }
                break;
            case 'tile':
                this.times.firstTile ||= message.mesh === null ? 0 : performance.now();
                this.world?.tiles.add(message.square, message.mesh);
                this.stage.shadowsChanged();
                this.needsFrame = true;
                break;
            case 'ground':
                this.world?.ground.add(message.ground);
                break;
            case 'section':
                this.world?.cut.show(message.id, message.near, message.far, message.missing);
                this.stage.shadowsChanged();
                this.needsFrame = true;
                break;
            case 'xray':
                this.world?.xray.add(message.square, message.caves, message.veins);
                this.needsFrame = true;
                break;
            case 'column': {
                const query = this.queries.get(message.id);
                this.queries.delete(message.id);
                if (message.column !== null) {
                    query?.resolve(message.column);
                } else {
                    query?.reject(new Error(message.error));
                }
                break;
            }
            case 'suggested':
                void this.begin(message.place);
                break;
            case 'figures':
                this.showFigures(message.figures);
                break;
            case 'comparison':
                this.comparison = message.comparison;
                this.panel.compare(message.comparison, message.error);
                break;
        }
    }

    private greet(hello: ServerHello, isNewWorld: boolean): void {
        this.times.hello ||= performance.now();
        this.shell.say('');
        this.shell.setWorld(hello.worldName, `Terrane ${hello.serverVersion} · ${hello.materials.length} materials`);
        this.map.setWorld(`${httpBase(this.url)}/v1/w/${hello.contentId}/map`, this.token);
        if (isNewWorld || this.world === undefined) {
            this.openWorld(hello);
        }
        if (!this.hasPlace) {
            const { x, z } = this.stage.sunDirection;
            this.send({ kind: 'suggest', sunYaw: Math.atan2(x, z) });
        }
        this.groundAsked = '';
        this.sendView();
    }

    private openWorld(hello: ServerHello): void {
        const { scene } = this.stage;
        if (this.world !== undefined) {
            const { tiles, cut, xray, probe } = this.world;
            tiles.clear();
            scene.remove(tiles.group, cut.group, xray.group);
            probe.root.remove();
            this.materials.setClip([]);
            this.materials.setGhost(0);
            this.shell.press('cut', false);
            this.shell.press('xray', false);
            this.shell.showTools(false, false);
        }
        const tiles = new TileSet(this.materials, hello.chunkSide, (names) => this.send({ kind: 'dropped', names }));
        const ground = new GroundMap(hello.chunkSide);
        const cut = new Cut(hello, this.stage.textures, (id, request) => this.send({ kind: 'section', id, ...request }));
        const xray = new Xray(hello, (squares) => this.send({ kind: 'xray', squares }));
        const probe = new ProbePanel(hello.materials);
        this.shell.add(probe.root);
        scene.add(tiles.group, cut.group, xray.group);
        this.world = { hello, tiles, ground, cut, xray, probe };
        this.controls.ground = ground;
        tiles.setCaves(this.showsCaves);
    }

    private showFigures(figures: StreamFigures): void {
        this.figures = figures;
        if (figures.nearMissing === 0 && figures.tilesWanted > 0) {
            this.times.nearView ||= performance.now();
        }
        const scene = this.sceneFigures();
        this.panel.show(figures, {
            framesPerSecond: 1000 / this.frameMs,
            tiles: scene.shown,
            triangles: scene.triangles,
            drawCalls: scene.drawCalls,
            geometryBytes: scene.bytes,
            quality: scene.quality,
        });
    }

    private sendView(): void {
        if (this.world === undefined || !this.hasPlace) {
            return;
        }
        const { position } = this.controls;
        const { levels, limits } = this.world.hello;
        const most = limits.viewRadiusMax || Infinity;
        const radiusChunks = this.quality.now.radiusChunks.slice(0, levels).map((radius) => Math.min(radius, most));
        this.world.tiles.setView(position, radiusChunks);
        this.sendStream(radiusChunks);
        const squares = this.world.ground.squaresAround(position.x, position.z);
        const asked = `${squares[0]!.x} ${squares[0]!.z}`;
        if (asked !== this.groundAsked) {
            this.groundAsked = asked;
            this.send({ kind: 'ground', squares });
        }
    }

    /** Tells the stream where the viewer is. */
    private sendStream(radiusChunks: number[]): void {
        const { position, velocity } = this.controls;
        const vector = ({ x, y, z }: { x: number; y: number; z: number }) => ({ x, y, z });
        this.send({
            kind: 'view',
            view: {
                position: vector(position),
                direction: vector(this.controls.direction()),
                velocity: vector(velocity),
                fieldOfView: (FIELD_OF_VIEW_DEGREES * Math.PI) / 180 * Math.max(window.innerWidth / window.innerHeight, 1),
                radiusChunks,
                format: this.format,
            },
        });
    }

    private frame(): void {
        requestAnimationFrame(() => this.frame());
        const now = performance.now();
        const elapsed = now - this.lastFrameMs;
        this.lastFrameMs = now;
        const seconds = Math.min(elapsed / 1000, FRAME_SECONDS_MAX);
        this.controls.update(seconds);
        const { position } = this.controls;
        const { camera } = this.stage;
        const world = this.world;
        const direction = this.controls.direction();
        const pose = `${position.x.toFixed(3)} ${position.y.toFixed(3)} ${position.z.toFixed(3)} ${direction.x.toFixed(4)} ${direction.y.toFixed(4)}`;
        const hasMoved = pose !== this.lastPose;
        this.lastPose = pose;
        if (world !== undefined) {
            const isNew = world.tiles.update(Math.min(elapsed / 1000, 1), position);
            const { origin } = world.tiles;
            camera.position.set(position.x - origin.x, position.y, position.z - origin.z);
            world.xray.update(position, origin);
            if (world.cut.isOn) {
                this.materials.setClip(world.cut.update(origin, position));
            }
            this.needsFrame ||= isNew;
        }
        camera.up.set(0, 1, 0);
        camera.lookAt(camera.position.x + direction.x, camera.position.y + direction.y, camera.position.z + direction.z);
        const sinceMs = now - this.lastDrawMs;
        // Where the processor draws, it must also decode: while tiles are due it gets time for that.
        const isPaced = this.stage.isSoftware && (this.figures?.tilesMissing ?? 1) > 0 && sinceMs < this.drawMs * 2.5;
        const isDue = hasMoved || this.needsFrame || sinceMs > Math.max(IDLE_FRAME_MS, this.drawMs * 8) || this.quality.level >= 3;
        if (isDue && !isPaced) {
            // Frames one after another tell what one costs; after a pause they do not.
            const isSteady = sinceMs < elapsed + 8;
            this.needsFrame = false;
            this.lastDrawMs = now;
            this.stage.render(seconds);
            ++this.framesDrawn;
            // Calls return before the picture is there; the next frame's delay tells the rest.
            this.drawMs += (Math.max(performance.now() - now, isSteady ? elapsed : 0) - this.drawMs) * 0.25;
            if (isSteady) {
                this.frameMs += (elapsed - this.frameMs) * 0.1;
                if (this.quality.frame(elapsed)) {
                    this.stage.setQuality(this.quality.now);
                    this.materials.setDetail(this.quality.now.detail);
                    this.sendView();
                }
            }
        }
        this.timed(now, hasMoved);
    }

    private timed(now: number, hasMoved: boolean): void {
        const { position, yaw, pitch } = this.controls;
        if (now - this.lastViewMs > VIEW_PERIOD_MS && (hasMoved || now - this.lastViewMs > 2000)) {
            this.lastViewMs = now;
            this.sendView();
        }
        if (now - this.lastPlaceMs > PLACE_PERIOD_MS && this.world !== undefined && this.hasPlace) {
            this.lastPlaceMs = now;
            const hash = writePlace({ ...position, yaw, pitch });
            if (hash !== location.hash) {
                history.replaceState(null, '', hash);
            }
        }
        if (now - this.lastMapMs > MAP_PERIOD_MS) {
            this.lastMapMs = now;
            this.map.update(position.x, position.y, position.z, yaw);
        }
    }
}

/** The highest solid limit of a column, in voxels. */
function topOf(column: Column, hello: ServerHello): number {
    const isSolid = ({ material }: { material: number }) => hello.materials[material]?.solid ?? true;
    const solid = column.limits.filter(({ composition }) => composition.some(isSolid));
    return (solid.at(-1)?.y256 ?? 0) / 256;
}
