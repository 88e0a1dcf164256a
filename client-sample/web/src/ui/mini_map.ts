// The mini-map out of the server's map tiles (slippy-map numbers; one pixel a column at the deepest
// zoom), with the viewer in its middle. Where the server has no maps, the panel says so.
import { element, number } from './dom';

const TILE = 256;
const DEEPEST = 18;
const TILES_MAX = 160;

interface MapTile {
    image: HTMLImageElement;
    isReady: boolean;
    hasFailed: boolean;
}

export class MiniMap {
    readonly root = element('section', 'glass map');
    private readonly canvas = element('canvas');
    private readonly place = element('div', 'place');
    private readonly none = element('div', 'none', '');
    private readonly tiles = new Map<string, MapTile>();
    private base = '';
    private query = '';
    private zoom = DEEPEST - 2;
    private failed = 0;
    private ready = 0;
    private shown = '';

    constructor(onJump: (x: number, z: number) => void) {
        const zoom = element('div', 'zoom');
        for (const [text, step] of [['+', 1], ['−', -1]] as const) {
            const made = element('button', '', text);
            made.title = step > 0 ? 'nearer' : 'farther';
            made.addEventListener('click', () => {
                this.zoom = Math.min(DEEPEST, Math.max(DEEPEST - 8, this.zoom + step));
                this.shown = '';
            });
            zoom.append(made);
        }
        this.root.append(this.canvas, this.none, this.place, zoom);
        this.canvas.addEventListener('click', (event) => {
            const box = this.canvas.getBoundingClientRect();
            const columns = 2 ** (DEEPEST - this.zoom);
            onJump(
                this.at.x + (event.clientX - box.left - box.width / 2) * columns,
                this.at.z + (event.clientY - box.top - box.height / 2) * columns,
            );
        });
    }

    private at = { x: 0, z: 0 };

    /** `base`: where W's map tiles are, ending in /map. */
    setWorld(base: string, token: string): void {
        this.base = base;
        this.query = token === '' ? '' : `?token=${encodeURIComponent(token)}`;
        this.tiles.clear();
        this.failed = this.ready = 0;
        this.shown = '';
    }

    update(x: number, y: number, z: number, yaw: number): void {
        this.at = { x, z };
        const text = `${number(Math.round(x))}, ${number(Math.round(y))}, ${number(Math.round(z))}`;
        const state = `${text}${yaw.toFixed(2)}${this.zoom}${this.ready}${this.failed}`;
        if (state === this.shown || this.base === '') {
            return;
        }
        this.shown = state;
        this.place.textContent = text;
        this.none.textContent = this.ready === 0 && this.failed > 2 ? 'this server has no map tiles' : '';
        this.draw(yaw);
    }

    private draw(yaw: number): void {
        const ratio = Math.min(window.devicePixelRatio, 2);
        const width = this.canvas.clientWidth;
        const height = this.canvas.clientHeight;
        if (this.canvas.width !== Math.round(width * ratio)) {
            this.canvas.width = Math.round(width * ratio);
            this.canvas.height = Math.round(height * ratio);
        }
        const context = this.canvas.getContext('2d')!;
        context.setTransform(ratio, 0, 0, ratio, 0, 0);
        context.fillStyle = '#141c24';
        context.fillRect(0, 0, width, height);
        const columns = 2 ** (DEEPEST - this.zoom);
        const side = 2 ** this.zoom;
        const left = this.at.x / columns + (side / 2) * TILE - width / 2;
        const top = this.at.z / columns + (side / 2) * TILE - height / 2;
        for (let ty = Math.floor(top / TILE); ty * TILE < top + height; ++ty) {
            for (let tx = Math.floor(left / TILE); tx * TILE < left + width; ++tx) {
                const tile = this.tile(tx, ty);
                if (tile?.isReady) {
                    context.drawImage(tile.image, tx * TILE - left, ty * TILE - top, TILE, TILE);
                }
            }
        }
        context.translate(width / 2, height / 2);
        context.rotate(Math.atan2(Math.cos(yaw), Math.sin(yaw)));
        const view = context.createRadialGradient(0, 0, 4, 0, 0, 46);
        view.addColorStop(0, 'rgba(255,240,210,0.5)');
        view.addColorStop(1, 'rgba(255,240,210,0)');
        context.fillStyle = view;
        context.beginPath();
        context.moveTo(0, 0);
        context.arc(0, 0, 46, -0.55, 0.55);
        context.fill();
        context.fillStyle = '#fff';
        context.strokeStyle = 'rgba(0,0,0,0.65)';
        context.lineWidth = 2;
        context.beginPath();
        context.moveTo(9, 0);
        context.lineTo(-6, 6);
        context.lineTo(-3, 0);
        context.lineTo(-6, -6);
        context.closePath();
        context.stroke();
        context.fill();
    }

    private tile(x: number, y: number): MapTile | undefined {
        const side = 2 ** this.zoom;
        if (x < 0 || y < 0 || x >= side || y >= side || (this.ready === 0 && this.failed > 6)) {
            return undefined;
        }
        const name = `${this.zoom}/${x}/${y}`;
        const known = this.tiles.get(name);
        if (known !== undefined) {
            return known;
        }
        if (this.tiles.size >= TILES_MAX) {
            this.tiles.delete(this.tiles.keys().next().value!);
        }
        const tile: MapTile = { image: new Image(), isReady: false, hasFailed: false };
        this.tiles.set(name, tile);
        // fetch, not the image itself: a server without maps is no error of the page.
        fetch(`${this.base}/${name}.png${this.query}`)
            .then(async (answer) => {
                if (!answer.ok) {
                    throw new Error(`${answer.status}`);
                }
                tile.image.src = URL.createObjectURL(await answer.blob());
                await tile.image.decode();
                URL.revokeObjectURL(tile.image.src);
                tile.isReady = true;
                ++this.ready;
            })
            .catch(() => {
                tile.hasFailed = true;
                ++this.failed;
            });
        return tile;
    }
}
