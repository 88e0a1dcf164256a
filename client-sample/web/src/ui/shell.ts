// The frame of the page: brand, tool bar, side panels, notes. It knows no terrain: it calls back.
import { button, element } from './dom';

export interface ShellActions {
    mode(): void;
    cut(): void;
    flow(): void;
    turnCut(radians: number): void;
    xray(): void;
    probe(): void;
    format(): void;
    hour(hour: number): void;
    picture(): void;
    jump(text: string): string | undefined;
    server(address: string): void;
    token(token: string): void;
    caves(): void;
}

/** What stands in the fields at the start. */
export interface ShellValues {
    hour: number;
    address: string;
    token: string;
}

const ICONS = {
    fly: '<path d="M2 11l16-7-5 13-3-5z"/>',
    cut: '<path d="M3 6l7-3 7 3v8l-7 3-7-3z"/><path d="M10 3v14"/><path d="M10 8l7-2M10 12l7-2"/>',
    xray: '<circle cx="10" cy="10" r="7"/><path d="M6 12c2-3 3 0 5-3s2-1 3-2"/>',
    probe: '<path d="M10 2v16"/><path d="M6 5h8v10H6z"/><path d="M6 8h8M6 11h8"/>',
    caves: '<path d="M2 16c1-7 4-12 8-12s7 5 8 12M7 16c0-4 1-6 3-6s3 2 3 6"/>',
    format: '<path d="M3 6h11l-3-3M17 14H6l3 3"/>',
    picture: '<rect x="2.5" y="5" width="15" height="11" rx="2"/><circle cx="10" cy="10.5" r="3"/><path d="M7 5l1-2h4l1 2"/>',
    panel: '<path d="M3 16V9M8 16V4M13 16v-5M18 16V7"/>',
    help: '<circle cx="10" cy="10" r="7"/><path d="M8 8a2 2 0 1 1 2.6 2c-.5.2-.6.6-.6 1M10 13.6v.1"/>',
};

const LOGO = `<svg viewBox="0 0 32 32" aria-hidden="true"><rect width="32" height="32" rx="8" fill="#101820"/><path d="M4 13c6-5 10-4 14-1s7 3 10 0v5c-4 3-7 2-11 0s-8-2-13 2z" fill="#7c9447"/><path d="M4 19c5-4 9-4 13-2s7 3 11 0v5c-4 3-8 2-12 0s-8-1-12 2z" fill="#d39b4a"/><path d="M4 24c4-3 8-4 12-2s8 3 12 0v3a4 4 0 0 1-4 4H8a4 4 0 0 1-4-4z" fill="#a3492f"/></svg>`;

export class Shell {
    readonly side = element('div', 'side');
    readonly fields = element('section', 'glass panel places');
    private readonly root: HTMLElement;
    private readonly title = element('h1', '', 'Terrane');
    private readonly subtitle = element('p', '', 'connecting…');
    private readonly dot = element('span', 'dot');
    private readonly note = element('div', 'glass note');
    private readonly tools = element('div', 'glass tools');
    private readonly flow: HTMLButtonElement;
    private readonly buttons: Record<'mode' | 'cut' | 'xray' | 'probe' | 'caves' | 'format', HTMLButtonElement>;
    private readonly cross = element('div', 'cross');
    private token: HTMLInputElement | undefined;
    private noteTimer: ReturnType<typeof setTimeout> | undefined;

    constructor(root: HTMLElement, actions: ShellActions, values: ShellValues) {
        this.root = root;
        const brand = element('header', 'glass brand');
        brand.innerHTML = LOGO;
        const words = element('div');
        words.append(this.title, this.subtitle);
        brand.append(words);

        const help = this.help();
        const bar = element('nav', 'glass bar');
        this.buttons = {
            mode: button('Fly', ICONS.fly, 'F', actions.mode),
            cut: button('Cut', ICONS.cut, 'X', actions.cut),
            xray: button('X-ray', ICONS.xray, 'R', actions.xray),
            probe: button('Probe', ICONS.probe, 'P', actions.probe),
            caves: button('Caves', ICONS.caves, 'V', actions.caves),
            format: button('Draco', ICONS.format, 'T', actions.format),
        };
        const split = () => element('div', 'split');
        const toggle = (target: HTMLElement) => () => (target.hidden = !target.hidden);
        bar.append(
            this.buttons.mode, split(),
            this.buttons.cut, this.buttons.xray, this.buttons.probe, this.buttons.caves, split(),
            this.buttons.format,
            button('Picture', ICONS.picture, 'O', actions.picture),
            button('Figures', ICONS.panel, 'G', toggle(this.side)),
            button('Help', ICONS.help, 'H', toggle(help)),
        );
        this.flow = button('Flow', '<path d="M2 12c4-6 7 4 11-2l4-3M14 6l3 1-1 3"/>', '', actions.flow);
        const turn = element('label', '', 'turn');
        const turnBy = element('input');
        turnBy.type = 'range';
        turnBy.min = '-90';
        turnBy.max = '90';
        turnBy.value = '0';
        let turned = 0;
        turnBy.addEventListener('input', () => {
            const next = (Number(turnBy.value) * Math.PI) / 180;
            actions.turnCut(next - turned);
            turned = next;
        });
        turn.append(turnBy);
        this.tools.append(element('span', '', 'drag the face to move the cut'), turn, this.flow);
        this.tools.hidden = true;
        this.note.hidden = true;
        this.fill(actions, values);
        root.append(brand, this.side, bar, this.tools, this.note, help, this.cross);
        window.addEventListener('keydown', (event) => {
            const isTyping = (event.target as HTMLElement).tagName === 'INPUT';
            const action = {
                KeyX: actions.cut, KeyR: actions.xray, KeyP: actions.probe, KeyT: actions.format,
                KeyO: actions.picture, KeyG: toggle(this.side), KeyH: toggle(help), KeyV: actions.caves,
            }[event.code];
            if (!isTyping && !event.repeat && !event.ctrlKey && !event.metaKey) {
                action?.();
            }
        });
    }

    setWorld(name: string, detail: string): void {
        this.title.textContent = name;
        document.title = `${name} · Terrane`;
        this.setState(true, detail);
    }

    setState(isOn: boolean, text: string): void {
        this.dot.className = `dot ${isOn ? 'on' : 'off'}`;
        this.subtitle.replaceChildren(this.dot, text);
    }

    press(which: keyof Shell['buttons'], isOn: boolean, label?: string): void {
        this.buttons[which].setAttribute('aria-pressed', String(isOn));
        if (label !== undefined) {
            this.buttons[which].querySelector('span')!.textContent = label;
        }
    }

    showTools(isOn: boolean, withFlow: boolean): void {
        this.tools.hidden = !isOn;
        this.flow.setAttribute('aria-pressed', String(withFlow));
    }

    say(text: string, isBad = false, forMs = 3500): void {
        clearTimeout(this.noteTimer);
        this.note.textContent = text;
        this.note.className = `glass note${isBad ? ' bad' : ''}`;
        this.note.hidden = text === '';
        if (forMs > 0) {
            this.noteTimer = setTimeout(() => (this.note.hidden = true), forMs);
        }
    }

    add(part: HTMLElement): void {
        this.root.append(part);
    }

    /** The server wants a token: shows where it goes. */
    askToken(): void {
        this.side.hidden = false;
        this.token?.focus();
    }

    private fill(actions: ShellActions, { hour, address, token }: ShellValues): void {
        const field = (
            label: string, placeholder: string, value: string, enter: (text: string) => string | undefined, type = 'text',
        ) => {
            const input = element('input');
            input.type = type;
            input.autocomplete = 'off';
            input.placeholder = placeholder;
            input.value = value;
            input.spellcheck = false;
            input.setAttribute('aria-label', label);
            input.addEventListener('keydown', (event) => {
                if (event.key === 'Enter') {
                    const fault = enter(input.value.trim());
                    if (fault === undefined) {
                        input.blur();
                    } else {
                        this.say(fault, true);
                    }
                }
            });
            fields.append(element('span', '', label), input);
            return input;
        };
        const fields = element('div', 'fields');
        field('go to', 'x z, or x y z', '', (text) => actions.jump(text));
        field('server', 'this one', address, (text) => {
            actions.server(text);
            return undefined;
        });
        this.token = field('token', 'none', token, (text) => {
            actions.token(text);
            return undefined;
        }, 'password');
        const time = element('input');
        time.type = 'range';
        time.min = '5.4';
        time.max = '18.6';
        time.step = '0.05';
        time.value = String(hour);
        time.style.width = '100%';
        time.setAttribute('aria-label', 'time of day');
        time.addEventListener('input', () => actions.hour(Number(time.value)));
        fields.append(element('span', '', 'hour'), time);
        this.fields.append(fields);
    }

    private help(): HTMLElement {
        const help = element('section', 'glass help');
        help.innerHTML = `<b>Look</b> by dragging, <b>move</b> by keys or the left thumb.
            <dl><dt>W A S D</dt><dd>move; Shift is faster</dd><dt>Space, C</dt><dd>up and down; on foot Space jumps</dd>
            <dt>wheel</dt><dd>speed of flight</dd><dt>F</dt><dd>walk or fly</dd><dt>X</dt><dd>cut the world open</dd>
            <dt>R</dt><dd>X-ray: caves and veins</dd><dt>P</dt><dd>probe the column you click</dd>
            <dt>V</dt><dd>draw caves or leave them out</dd><dt>T</dt><dd>columns or Draco meshes</dd>
            <dt>O</dt><dd>a picture as a file</dd><dt>G</dt><dd>map, fields and figures</dd><dt>H</dt><dd>this help</dd></dl>`;
        help.hidden = true;
        return help;
    }
}
