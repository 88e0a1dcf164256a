// The panel of figures: the stream, the picture, and Draco beside columns.
import type { Comparison, StreamFigures } from '../stream/messages';
import { bytes, element, number, short } from './dom';

export interface PictureFigures {
    framesPerSecond: number;
    tiles: number;
    triangles: number;
    drawCalls: number;
    geometryBytes: number;
    quality: string;
}

export class FiguresPanel {
    readonly root = element('section', 'glass panel figures');
    private readonly rows = new Map<string, HTMLTableCellElement>();
    private readonly pairRows = new Map<string, [HTMLTableCellElement, HTMLTableCellElement]>();
    private readonly caption: HTMLTableCaptionElement;
    private compared: Comparison | null = null;

    constructor(onCompare: () => void) {
        const head = element('h2', '', 'Stream');
        this.root.append(head);
        const table = element('table');
        for (const name of ['chunks', 'received', 'waiting', 'wait p50 / p99', 'ping', 'picture', 'triangles', 'memory', 'columns held']) {
            const row = table.insertRow();
            row.insertCell().textContent = name;
            this.rows.set(name, row.insertCell());
        }
        const pair = element('table', 'pair');
        const titles = pair.createTHead().insertRow();
        for (const title of ['', 'Draco', 'columns']) {
            const cell = document.createElement('th');
            cell.textContent = title;
            titles.append(cell);
        }
        const body = pair.createTBody();
        for (const name of ['bytes', 'triangles', 'client', 'server mesh', 'server encode']) {
            const row = body.insertRow();
            row.insertCell().textContent = name;
            this.pairRows.set(name, [row.insertCell(), row.insertCell()]);
        }
        this.caption = pair.createCaption();
        const compare = element('button', '', 'compare');
        compare.title = 'Ask for the same fresh stacks in both formats';
        compare.addEventListener('click', () => {
            this.caption.textContent = 'asking for both…';
            onCompare();
        });
        const pairHead = element('h2', '', 'Formats');
        pairHead.append(compare);
        pairHead.style.marginTop = '12px';
        this.root.append(table, pairHead, pair);
    }

    show(stream: StreamFigures, picture: PictureFigures): void {
        const set = (name: string, text: string) => (this.rows.get(name)!.textContent = text);
        set('chunks', `${short(stream.chunks)} · ${number(stream.chunksPerSecond)}/s`);
        set('received', `${bytes(stream.bytes)} · ${bytes(stream.bytesPerSecond)}/s`);
        set('waiting', `${number(stream.tilesMissing)} of ${number(stream.tilesWanted)} · decoding ${stream.decodeQueue}`);
        set('wait p50 / p99', `${number(stream.waitP50Ms)} / ${number(stream.waitP99Ms)} ms`);
        set('ping', `${number(stream.pingMs, 1)} ms · ${stream.usesViews ? 'views' : 'requests'}`);
        set('picture', `${number(picture.framesPerSecond)} fps · ${picture.quality}`);
        set('triangles', `${short(picture.triangles)} · ${picture.drawCalls} calls`);
        set('memory', `${bytes(picture.geometryBytes)} + ${bytes(stream.wasmBytes)}`);
        set('columns held', `${stream.columnStacks} stacks · ${bytes(stream.columnBytes)}`);
        if (this.compared === null) {
            this.showStream(stream);
        }
    }

    compare(comparison: Comparison | null, error: string): void {
        this.compared = comparison;
        if (comparison === null) {
            this.caption.textContent = `could not compare: ${error}`;
            return;
        }
        const { tiles } = comparison;
        const each = (pair: Record<'draco' | 'columns', number>, unit: (value: number) => string): [string, string] => [
            unit(pair.draco / tiles),
            unit(pair.columns / tiles),
        ];
        const ms = (value: number) => `${number(value, 2)} ms`;
        this.set('bytes', each(comparison.bytes, bytes));
        this.set('triangles', each(comparison.triangles, (value) => number(value)));
        this.set('client', each(comparison.clientMs, ms));
        const server = comparison.serverMs;
        this.set('server mesh', [ms(server.draco.mesh / tiles), ms(server.columns.mesh / tiles)]);
        this.set('server encode', [ms(server.draco.encode / tiles), ms(server.columns.encode / tiles)]);
        this.caption.textContent = `each stack, over the same ${tiles} fresh ones; client: decode, and for columns mesh`;
    }

    private showStream({ formats }: StreamFigures): void {
        const { draco, columns } = formats;
        const each = (value: (figures: typeof draco) => number, count: (figures: typeof draco) => number, unit: (mean: number) => string): [string, string] => {
            const mean = (figures: typeof draco) => (count(figures) === 0 ? '–' : unit(value(figures) / count(figures)));
            return [mean(draco), mean(columns)];
        };
        const ms = (us: number) => `${number(us / 1000, 2)} ms`;
        this.set('bytes', each((f) => f.bytes, (f) => f.chunks, bytes));
        this.set('triangles', each((f) => f.triangles, (f) => f.chunks, (value) => number(value)));
        this.set('client', each((f) => f.clientMs * 1000, (f) => f.chunks, ms));
        this.set('server mesh', each((f) => f.meshUs, (f) => f.made, ms));
        this.set('server encode', each((f) => f.encodeUs, (f) => f.made, ms));
        this.caption.textContent = 'each chunk that came; “compare” asks for the same ones in both';
    }

    private set(name: string, [draco, columns]: [string, string]): void {
        const cells = this.pairRows.get(name)!;
        cells[0].textContent = draco;
        cells[1].textContent = columns;
    }
}
