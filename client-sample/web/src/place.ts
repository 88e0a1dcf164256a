// The place in the URL: #x,y,z,yaw,pitch in the fragment, the server in ?server=.

export interface Place {
    x: number;
    y: number;
    z: number;
    yaw: number;
    pitch: number;
}

export function readPlace(hash: string): Place | undefined {
    const parts = hash.replace(/^#/, '').split(',').map(Number);
    if (parts.length < 3 || parts.some((part) => !Number.isFinite(part))) {
        return undefined;
    }
    const [x, y, z, yaw = 0, pitch = -0.2] = parts;
    return { x: x!, y: y!, z: z!, yaw, pitch };
}

export function writePlace({ x, y, z, yaw, pitch }: Place): string {
    return `#${[x, y, z].map((value) => value.toFixed(1)).join(',')},${yaw.toFixed(3)},${pitch.toFixed(3)}`;
}

/** "x z" or "x y z", by commas or blanks. */
export function parseCoordinates(text: string): { x: number; y?: number; z: number } | undefined {
    const parts = text.trim().split(/[\s,;]+/).map(Number);
    if (parts.some((part) => !Number.isFinite(part) || Math.abs(part) >= 2 ** 36)) {
        return undefined;
    }
    return parts.length === 2
        ? { x: parts[0]!, z: parts[1]! }
        : parts.length === 3
          ? { x: parts[0]!, y: parts[1]!, z: parts[2]! }
          : undefined;
}

/** What the address field takes: host:port, or a whole ws: or http: URL. */
export function webSocketUrl(address: string, page: Location): string {
    const secure = page.protocol === 'https:' ? 'wss' : 'ws';
    if (address === '') {
        return new URL('ws', `${secure}://${page.host}/`).href;
    }
    const url = new URL(/^[a-z]+:\/\//.test(address) ? address : `${secure}://${address}`);
    url.protocol = { 'http:': 'ws:', 'https:': 'wss:' }[url.protocol] ?? url.protocol;
    if (url.pathname === '/') {
        url.pathname = '/ws';
    }
    return url.href;
}

/** Where the same server answers HTTP. */
export function httpBase(socketUrl: string): string {
    const url = new URL(socketUrl);
    return `${url.protocol === 'wss:' ? 'https' : 'http'}://${url.host}`;
}
