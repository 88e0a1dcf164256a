// The stream worker: one session at a time, renewed when it breaks, and all that decodes.
import {
    ColumnRoom,
    TerraneClient,
    compileColumns,
    squareName,
    type ServerHello,
    type Square,
} from 'terrane-client';
import columnsUrl from 'terrane-client/columns.wasm?url';

import type { Surface } from '../scene/surfaces';
import { ColumnLoads } from './column_loads';
import { DracoPool } from './draco_pool';
import { Meter } from './figures';
import { compareFormats, groundOf, squaresAlong, withoutCover } from './inside';
import type { FromWorker, SectionImage, ToWorker, ViewState } from './messages';
import { bestPlace, heightsAround, type Suggested } from './suggest';
import { buffersOf, joinPieces, surfacesOf } from './tile_mesh';
import { TileStream } from './tile_stream';

const FIGURES_PERIOD_MS = 400;
const PING_PERIOD_MS = 2000;
const RETRY_FIRST_MS = 250;
const RETRY_MAX_MS = 4000;
const SECTION_PERIOD_MS = 140;
/** The level that the far part of a cut is drawn from. */
const FAR_SECTION_LOD = 3;

type SectionAsked = Extract<ToWorker, { kind: 'section' }>;

interface Session {
    client: TerraneClient;
    room: ColumnRoom;
    loads: ColumnLoads;
    tiles: TileStream;
    surfaces: Surface[];
}

const cores = navigator.hardwareConcurrency || 2;
const pool = new DracoPool(Math.min(Math.max(cores - 1, 1), 4));
const columnsModule = compileColumns(fetch(columnsUrl));
const meter = new Meter();
const shown = new Set<string>();

let session: Session | undefined;
let view: ViewState | undefined;
let world = '';
let attempt = 0;
let pingMs = 0;
const pins = { ground: new Set<string>(), section: new Set<string>(), xray: new Set<string>() };
let groundWanted: Square[] = [];
let xrayWanted: Square[] = [];
let section: SectionAsked | undefined;
let sectionTimer: ReturnType<typeof setTimeout> | undefined;

function post(message: FromWorker, transfer: Transferable[] = []): void {
    self.postMessage(message, { transfer });
}

function isPinned(name: string): boolean {
    return pins.ground.has(name) || pins.section.has(name) || pins.xray.has(name);
}

async function open(url: string, token: string): Promise<void> {
    const mine = ++attempt;
    closeSession();
    let retryMs = RETRY_FIRST_MS;
    while (mine === attempt) {
        let reason: string;
        try {
            reason = await run(url, token, mine, () => (retryMs = RETRY_FIRST_MS));
        } catch (error) {
            reason = (error as Error).message;
        }
        if (mine !== attempt) {
            return;
        }
        closeSession();
        post({ kind: 'closed', reason, retryMs });
        await new Promise((resolve) => setTimeout(resolve, retryMs));
        retryMs = Math.min(retryMs * 2, RETRY_MAX_MS);
    }
}

function closeSession(): void {
    session?.tiles.close();
    session?.client.close();
    session = undefined;
}

/** One session from greeting to end; gives the reason why it ended. */
async function run(url: string, token: string, mine: number, opened: () => void): Promise<string> {
    const client = await TerraneClient.connect(url, { name: 'terrane viewer', token });
    if (mine !== attempt) {
        client.close();
        return '';
    }
    const ended = new Promise<string>((resolve) => (client.onClose = (reason) => resolve(reason ?? '')));
    const { hello } = client;
    const isNewWorld = hello.contentId !== world;
    if (isNewWorld) {
        shown.clear();
        world = hello.contentId;
    }
    const surfaces = surfacesOf(hello.materials);
    const room = await ColumnRoom.open(await columnsModule, hello);
    const loads = new ColumnLoads(client, room, (square) => arrived(square));
    const tiles = new TileStream(client, room, loads.flowless, pool, meter, surfaces, shown, {
        show: (square, mesh, format) => post({ kind: 'tile', square, mesh, format }, buffersOf(mesh)),
        isPinned,
    });
    session = { client, room, loads, tiles, surfaces };
    opened();
    post({ kind: 'hello', hello: hello satisfies ServerHello, isNewWorld });
    if (view !== undefined) {
        tiles.setView(view);
    }
    loadInside();
    return ended;
}

/** What looks inside, most urgent first: the ground, the cut, caves and veins. */
function loadInside(): void {
    if (session === undefined) {
        return;
    }
    const { hello } = session.client;
    const cut = section === undefined
        ? []
        : [
              ...squaresAlong(section.near, 0, hello.chunkSide),
              ...squaresAlong(section.far, Math.min(FAR_SECTION_LOD, hello.levels - 1), hello.chunkSide),
          ];
    pins.ground = new Set(groundWanted.map(squareName));
    pins.section = new Set(cut.map(squareName));
    pins.xray = new Set(xrayWanted.map(squareName));
    session.loads.want(xrayWanted, false, false);
    session.loads.want(cut, section?.withFlow ?? false, true);
    session.loads.want(groundWanted, false, true);
}

function arrived(square: Square): void {
    const name = squareName(square);
    session?.tiles.columnsArrived(square);
    if (pins.ground.has(name)) {
        sendGround(square);
    }
    if (pins.section.has(name)) {
        drawSectionSoon();
    }
    if (pins.xray.has(name)) {
        sendXray(square);
    }
}

function sendGround(square: Square): void {
    if (session?.room.has(square)) {
        const ground = groundOf(session.room, square);
        post({ kind: 'ground', ground }, [ground.offsets.buffer as ArrayBuffer, ground.spans.buffer as ArrayBuffer]);
    }
}

function sendXray(square: Square): void {
    if (session === undefined || !session.room.has(square)) {
        return;
    }
    const { room, surfaces, client } = session;
    // The world's floor counts as solid for the mesher; what is asked for begins above it.
    const heights = { first: 1, last: Math.ceil(client.hello.heightBoundVoxels) + 1 };
    const [caves, veins] = (['caves', 'veins'] as const).map((what) => {
        const mesh = room.mesh(square, what, heights);
        const indices = what === 'veins' ? withoutCover(mesh, surfaces) : mesh.indices;
        return joinPieces([{ ...mesh, indices, y: heights.first }], surfaces);
    });
    post({ kind: 'xray', square, caves: caves!, veins: veins! }, [...buffersOf(caves!), ...buffersOf(veins!)]);
}

function drawSectionSoon(): void {
    sectionTimer ??= setTimeout(() => {
        sectionTimer = undefined;
        drawSection();
    }, SECTION_PERIOD_MS);
}

function drawSection(): void {
    if (section === undefined || session === undefined) {
        return;
    }
    const { room, loads } = session;
    const draw = (line: SectionAsked['near']): SectionImage => ({ line, ...room.section(line) });
    const near = draw(section.near);
    const far = draw(section.far);
    const { chunkSide } = session.client.hello;
    const missing = squaresAlong(section.near, 0, chunkSide).filter((square) => !loads.has(square, false)).length;
    post(
        { kind: 'section', id: section.id, near, far, missing },
        [near, far].flatMap(({ colors, contents }) => [colors.buffer as ArrayBuffer, contents.buffer as ArrayBuffer]),
    );
}

async function sendColumn(id: number, x: number, z: number): Promise<void> {
    try {
        const column = await session!.client.queryColumn(x, z);
        post({ kind: 'column', id, column, error: '' });
    } catch (error) {
        post({ kind: 'column', id, column: null, error: session ? (error as Error).message : 'not connected' });
    }
}

async function suggest(sunYaw: number): Promise<void> {
    let place: Suggested | undefined;
    try {
        place = bestPlace(await heightsAround(session!.client, await columnsModule), sunYaw);
    } catch {
        // The page begins somewhere else.
    }
    post({ kind: 'suggested', place });
}

async function compare(squares: Square[]): Promise<void> {
    try {
        const { client } = session!;
        const comparison = await compareFormats(client, await columnsModule, pool, squares);
        post({ kind: 'comparison', comparison, error: '' });
    } catch (error) {
        post({ kind: 'comparison', comparison: null, error: session ? (error as Error).message : 'not connected' });
    }
}

self.onmessage = ({ data }: MessageEvent<ToWorker>) => {
    switch (data.kind) {
        case 'connect':
            void open(data.url, data.token);
            break;
        case 'view':
            view = data.view;
            session?.tiles.setView(view);
            break;
        case 'dropped':
            session?.tiles.dropped(data.names);
            data.names.forEach((name) => shown.delete(name));
            break;
        case 'ground': {
            const known = pins.ground;
            groundWanted = data.squares;
            loadInside();
            data.squares.filter((square) => !known.has(squareName(square))).forEach(sendGround);
            break;
        }
        case 'section':
            section = data;
            loadInside();
            drawSection();
            break;
        case 'sectionOff':
            section = undefined;
            loadInside();
            break;
        case 'xray': {
            const known = pins.xray;
            xrayWanted = data.squares;
            loadInside();
            data.squares.filter((square) => !known.has(squareName(square))).forEach(sendXray);
            break;
        }
        case 'column':
            void sendColumn(data.id, data.x, data.z);
            break;
        case 'suggest':
            void suggest(data.sunYaw);
            break;
        case 'compare':
            void compare(data.squares);
            break;
    }
};

setInterval(() => {
    session?.client.ping().then((ms) => (pingMs = ms)).catch(() => {});
}, PING_PERIOD_MS);

setInterval(() => {
    if (session !== undefined) {
        const { room, client, tiles } = session;
        post({
            kind: 'figures',
            figures: {
                ...meter.figures(),
                ...tiles.figures(),
                pingMs,
                columnStacks: room.stacks,
                columnBytes: room.bytes,
                wasmBytes: room.memoryBytes,
                usesViews: client.hasViews,
            },
        });
    }
}, FIGURES_PERIOD_MS);
