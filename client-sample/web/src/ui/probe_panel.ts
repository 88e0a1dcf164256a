// The probe: one column as a labelled bar, with compositions and heights.
import type { Column, ColumnLimit, Material, Share } from 'terrane-client';

import { element, number } from './dom';

const WIDTH = 232;
const BAR_X = 34;
const BAR_WIDTH = 46;
const LABEL_X = BAR_X + BAR_WIDTH + 12;
const LABEL_GAP = 24;
const SVG = 'http://www.w3.org/2000/svg';

interface Layer {
    low: number;
    high: number;
    shares: Share[];
    isHollow: boolean;
}

/** Limits to layers: what two neighbouring limits share is a layer, what differs between is a blend. */
export function layersOf({ limits }: Column, materials: Material[]): Layer[] {
    const layers: Layer[] = [];
    const same = (a: ColumnLimit, b: ColumnLimit) =>
        JSON.stringify(a.composition) === JSON.stringify(b.composition);
    for (let i = 0; i + 1 < limits.length; ++i) {
        const low = limits[i]!;
        const high = limits[i + 1]!;
        if (low.y256 === high.y256) {
            continue;
        }
        if (same(low, high)) {
            const isHollow = low.composition.every(({ material }) => materials[material]?.solid === false);
            layers.push({ low: low.y256 / 256, high: high.y256 / 256, shares: low.composition, isHollow });
        }
    }
    return layers;
}

function css(color: number): string {
    return `#${color.toString(16).padStart(6, '0')}`;
}

function mixed(shares: Share[], materials: Material[]): string {
    const total = [0, 0, 0];
    for (const { material, concentration } of shares) {
        const color = materials[material]?.color ?? 0;
        [color >> 16, (color >> 8) & 255, color & 255].forEach((channel, i) => (total[i]! += concentration * channel ** 2.2));
    }
    return `rgb(${total.map((channel) => Math.round(channel ** (1 / 2.2))).join(' ')})`;
}

function svg<K extends keyof SVGElementTagNameMap>(tag: K, attributes: Record<string, string | number>, text = ''): SVGElementTagNameMap[K] {
    const made = document.createElementNS(SVG, tag);
    Object.entries(attributes).forEach(([name, value]) => made.setAttribute(name, String(value)));
    made.textContent = text;
    return made;
}

export class ProbePanel {
    readonly root = element('aside', 'glass probe');
    /** What is shown, for tests and for copying. */
    column: Column | null = null;
    private readonly title = element('h2');
    private readonly frame = element('div', 'column');

    constructor(private readonly materials: Material[]) {
        this.root.hidden = true;
        this.root.append(this.title, this.frame);
    }

    show(column: Column | null, error: string): void {
        this.column = column;
        this.root.hidden = false;
        if (column === null) {
            this.title.textContent = error;
            this.frame.replaceChildren();
            return;
        }
        const layers = layersOf(column, this.materials);
        const top = Math.max(...layers.filter(({ isHollow }) => !isHollow).map(({ high }) => high), 1);
        this.title.textContent = `Column ${column.x}, ${column.z}`;
        this.title.append(element('small', '', `${number(top, 1)} high`));
        this.frame.replaceChildren(this.draw(layers, top));
    }

    private draw(layers: Layer[], top: number): SVGSVGElement {
        const height = Math.max(this.frame.clientHeight, 260);
        const root = svg('svg', { viewBox: `0 0 ${WIDTH} ${height}`, role: 'img' });
        const y = (voxels: number) => height - 8 - (voxels / top) * (height - 16);
        const clip = svg('clipPath', { id: 'probe-bar' });
        clip.append(svg('rect', { x: BAR_X, y: 8, width: BAR_WIDTH, height: height - 16, rx: 6 }));
        root.append(clip);
        const bar = svg('g', { 'clip-path': 'url(#probe-bar)' });
        const visible = layers.filter(({ low, high }) => high > 0 && low < top);
        visible.forEach((layer, i) => {
            const color = layer.isHollow ? '#0a0d11' : mixed(layer.shares, this.materials);
            bar.append(svg('rect', { x: BAR_X, y: y(layer.high), width: BAR_WIDTH, height: Math.max(y(layer.low) - y(layer.high), 0.5), fill: color }));
            const above = visible[i + 1];
            if (above !== undefined && above.low > layer.high && !above.isHollow && !layer.isHollow) {
                this.drawBlend(bar, `blend-${i}`, layer, above, y);
            }
        });
        root.append(bar);
        this.label(root, visible, y, height);
        return root;
    }

    /** Between two layers that blend, their colours run into one another. */
    private drawBlend(bar: SVGElement, id: string, low: Layer, high: Layer, y: (voxels: number) => number): void {
        const gradient = svg('linearGradient', { id, x1: 0, y1: 1, x2: 0, y2: 0 });
        gradient.append(
            svg('stop', { offset: 0, 'stop-color': mixed(low.shares, this.materials) }),
            svg('stop', { offset: 1, 'stop-color': mixed(high.shares, this.materials) }),
        );
        bar.append(gradient, svg('rect', { x: BAR_X, y: y(high.low), width: BAR_WIDTH, height: y(low.high) - y(high.low), fill: `url(#${id})` }));
    }

    /** Names beside the bar, thick layers first, kept apart by moving those in the way. */
    private label(root: SVGElement, layers: Layer[], y: (voxels: number) => number, height: number): void {
        const most = Math.floor((height - 16) / LABEL_GAP);
        const chosen = [...layers]
            .sort((a, b) => b.high - b.low - (a.high - a.low))
            .slice(0, most)
            .sort((a, b) => b.low - a.low);
        const places = chosen.map(({ low, high }) => (y(low) + y(high)) / 2);
        for (let round = 0; round < 60; ++round) {
            for (let i = 0; i < places.length; ++i) {
                const before = i === 0 ? 14 : places[i - 1]! + LABEL_GAP;
                places[i] = Math.max(places[i]!, before);
            }
            for (let i = places.length - 1; i >= 0; --i) {
                const after = i === places.length - 1 ? height - 14 : places[i + 1]! - LABEL_GAP;
                places[i] = Math.min(places[i]!, after);
            }
        }
        chosen.forEach((layer, i) => {
            const middle = (y(layer.low) + y(layer.high)) / 2;
            const at = places[i]!;
            root.append(svg('path', { d: `M${BAR_X + BAR_WIDTH} ${middle} L${LABEL_X - 3} ${at}`, stroke: 'rgba(255,255,255,0.25)', fill: 'none' }));
            const names = layer.shares.map(({ material }) => this.materials[material]?.name ?? '?');
            root.append(svg('text', { x: LABEL_X, y: layer.shares.length > 1 ? at : at + 4 }, names[0]));
            if (layer.shares.length > 1) {
                const parts = layer.shares.map(({ concentration }, part) => `${Math.round(concentration * 100)} % ${part === 0 ? '' : names[part]}`.trim());
                root.append(svg('text', { x: LABEL_X, y: at + 11, class: 'mix' }, parts.join(' · ').slice(0, 34)));
            }
            root.append(svg('text', { x: BAR_X - 6, y: y(layer.high) + 4, class: 'height', 'text-anchor': 'end' }, number(layer.high)));
        });
        // A swatch of each main material, so that the bar reads as a key too.
        chosen.forEach((layer, i) => {
            const main = layer.shares[0];
            if (main !== undefined) {
                root.append(svg('rect', { x: WIDTH - 9, y: places[i]! - 4, width: 8, height: 8, rx: 2, fill: css(this.materials[main.material]?.color ?? 0) }));
            }
        });
    }
}
