// The probe: one column as a labelled bar, with compositions and heights.
import { MaterialKind, type Column, type ColumnLimit, type Material, type Share } from 'terrane-client';

import { element, number } from './dom';

const BAR_X = 34;
const BAR_WIDTH = 46;
const LABEL_X = BAR_X + BAR_WIDTH + 12;
const SWATCH = 8;
const NAME_HEIGHT = 15;
const MIX_HEIGHT = 12;
const MIX_LINES_MAX = 3;
/** Between two labels, and between two heights. */
const LABEL_GAP = 3;
const HEIGHT_GAP = 12;
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
            const isHollow = low.composition.every(({ material }) =>
                materials[material]?.solid === false && materials[material]?.kind !== MaterialKind.Water);
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

const FAMILY = getComputedStyle(document.documentElement).fontFamily;
const NAME_FONT = `11px ${FAMILY}`;
const MIX_FONT = `10px ${FAMILY}`;
const pen = document.createElement('canvas').getContext('2d')!;

function widthOf(text: string, font: string): number {
    pen.font = font;
    return pen.measureText(text).width;
}

/** The text, or as much of it as fits and three points. */
function fitted(text: string, width: number, font: string): string {
    if (widthOf(text, font) <= width) {
        return text;
    }
    let kept = text.replace(/[ …]+$/, '');
    while (kept.length > 1 && widthOf(`${kept}…`, font) > width) {
        kept = kept.slice(0, -1).trimEnd();
    }
    return `${kept}…`;
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
        const shown = layers.filter(({ isHollow }) => !isHollow);
        const isWater = ({ shares }: Layer) => this.materials[shares[0]?.material ?? -1]?.kind === MaterialKind.Water;
        const ground = Math.max(...shown.filter((layer) => !isWater(layer)).map(({ high }) => high), 0);
        const top = Math.max(...shown.map(({ high }) => high), 1);
        this.title.textContent = `Column ${column.x}, ${column.z}`;
        const depth = top > ground ? `, ${number(top - ground, 1)} of water` : '';
        this.title.append(element('small', '', `${number(ground, 1)} high${depth}`));
        this.frame.replaceChildren(this.draw(layers, top));
    }

    private draw(layers: Layer[], top: number): SVGSVGElement {
        const height = Math.max(this.frame.clientHeight, 260);
        const width = Math.max(this.frame.clientWidth, 180);
        const root = svg('svg', { viewBox: `0 0 ${width} ${height}`, role: 'img' });
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
        this.label(root, visible, y, { width, height });
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
    private label(root: SVGElement, layers: Layer[], y: (voxels: number) => number, size: { width: number; height: number }): void {
        const chosen: { layer: Layer; lines: string[]; tall: number }[] = [];
        let room = size.height;
        for (const layer of [...layers].sort((a, b) => b.high - b.low - (a.high - a.low))) {
            const lines = this.linesOf(layer, size.width - LABEL_X - SWATCH - 6);
            const tall = NAME_HEIGHT + MIX_HEIGHT * (lines.length - 1) + LABEL_GAP;
            if (tall > room) {
                break;
            }
            room -= tall;
            chosen.push({ layer, lines, tall });
        }
        chosen.sort((a, b) => b.layer.low - a.layer.low);
        // Tops of the labels: each as near to its layer's middle as the others let it.
        const tops = chosen.map(({ layer, tall }) => (y(layer.low) + y(layer.high) - tall) / 2);
        for (let round = 0; round < 60; ++round) {
            tops.forEach((top, i) => (tops[i] = Math.max(top, i === 0 ? 0 : tops[i - 1]! + chosen[i - 1]!.tall)));
            for (let i = tops.length - 1; i >= 0; --i) {
                tops[i] = Math.min(tops[i]!, (i === tops.length - 1 ? size.height : tops[i + 1]!) - chosen[i]!.tall);
            }
        }
        let lastHeight = -Infinity;
        chosen.forEach(({ layer, lines }, i) => {
            const at = tops[i]! + NAME_HEIGHT - 4;
            const middle = (y(layer.low) + y(layer.high)) / 2;
            root.append(svg('path', { d: `M${BAR_X + BAR_WIDTH} ${middle} L${LABEL_X - 3} ${at - 4}`, stroke: 'rgba(255,255,255,0.25)', fill: 'none' }));
            lines.forEach((line, at_line) =>
                root.append(svg('text', { x: LABEL_X, y: at + MIX_HEIGHT * at_line, ...(at_line > 0 && { class: 'mix' }) }, line)),
            );
            const main = layer.shares[0];
            if (main !== undefined) {
                // A swatch of each main material, so that the bar reads as a key too.
                root.append(svg('rect', { x: size.width - SWATCH - 1, y: at - SWATCH, width: SWATCH, height: SWATCH, rx: 2, fill: css(this.materials[main.material]?.color ?? 0) }));
            }
            const heightAt = y(layer.high) + 4;
            if (heightAt - lastHeight >= HEIGHT_GAP) {
                lastHeight = heightAt;
                root.append(svg('text', { x: BAR_X - 6, y: Math.max(heightAt, 9), class: 'height', 'text-anchor': 'end' }, number(layer.high)));
            }
        });
    }

    /** The name, and under it the shares in as many lines as they take; what does not fit is shortened. */
    private linesOf({ shares }: Layer, width: number): string[] {
        const names = shares.map(({ material }) => this.materials[material]?.name ?? '?');
        const lines = [fitted(names[0] ?? '', width, NAME_FONT)];
        if (shares.length > 1) {
            const parts = shares.map(({ concentration }, i) => `${Math.round(concentration * 100)} %${i === 0 ? '' : ` ${names[i]}`}`);
            for (const part of parts) {
                const longer = `${lines.at(-1)} · ${part}`;
                if (lines.length > 1 && widthOf(longer, MIX_FONT) <= width) {
                    lines[lines.length - 1] = longer;
                } else if (lines.length <= MIX_LINES_MAX) {
                    lines.push(fitted(part, width, MIX_FONT));
                } else {
                    lines[lines.length - 1] = fitted(`${longer} …`, width, MIX_FONT);
                    break;
                }
            }
        }
        return lines;
    }
}
