// A server that serves the built viewer, and headless Chromium on it.
import { spawn } from 'node:child_process';
import { existsSync, mkdirSync } from 'node:fs';
import { join } from 'node:path';
import { inflateSync } from 'node:zlib';

import { chromium } from 'playwright-core';

/** tests/e2e/web/run says where the repository is: the tests run from a copy beside their packages. */
export const root = process.env.TERRANE_ROOT ?? process.cwd();
export const terrane = process.env.TERRANE_BIN ?? join(root, 'build/release/bin/terrane');
export const demo = join(root, 'generator/worlds/canyon.toml');
const shots = join(root, 'build/e2e-web/screenshots');
mkdirSync(shots, { recursive: true });

/** A machine that builds something else meanwhile is given this long for anything. */
const PATIENCE_MS = Number(process.env.TERRANE_PATIENCE_MS ?? 90_000);

if (!existsSync(terrane)) {
    throw new Error(`${terrane} is not built; name it in TERRANE_BIN`);
}

/** Resolves with its HTTP and TCP ports once it listens. `port` 0 takes a free one. The viewer is found without a flag. */
export function startServer({ port = 0, world = demo, options = ['--store', 'memory'] } = {}) {
    const server = spawn(
        terrane,
        ['serve', '--world', world, ...options, '--tcp', '127.0.0.1:0', '--http', `127.0.0.1:${port}`],
        { stdio: ['ignore', 'pipe', 'pipe'] },
    );
    const end = () => server.kill('SIGKILL');
    process.once('exit', end);
    return new Promise((resolve, reject) => {
        let log = '';
        const read = (text) => {
            log += text;
            const tcp = /listening on tcp [0-9.]*:(\d+)/.exec(log);
            const found = /listening on http [0-9.]*:(\d+)/.exec(log);
            if (tcp && found) {
                const stop = () =>
                    new Promise((done) => {
                        server.on('exit', () => {
                            process.off('exit', end);
                            done();
                        });
                        server.kill('SIGTERM');
                    });
                resolve({ port: Number(found[1]), tcpPort: Number(tcp[1]), stop });
            }
        };
        server.stdout.on('data', read);
        server.stderr.on('data', read);
        server.on('exit', (code) => reject(new Error(`the server ended (${code}):\n${log}`)));
    });
}

export function startBrowser() {
    return chromium.launch({
        executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
        headless: true,
        timeout: PATIENCE_MS,
        args: [
            '--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking',
            '--disable-component-update', '--disable-sync', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
        ],
    });
}

/** A page on the viewer that notes all that goes wrong in `faults`. */
export async function openViewer(browser, port, { query = '', place = '', width = 840, height = 480 } = {}) {
    const page = await browser.newPage({ viewport: { width, height } });
    page.setDefaultTimeout(PATIENCE_MS);
    const faults = [];
    page.on('pageerror', (error) => faults.push(`page: ${error.message}`));
    page.on('console', (message) => {
        if (message.type() === 'error') {
            faults.push(`console: ${message.text()} ${message.location().url}`);
        }
    });
    await page.goto(`http://127.0.0.1:${port}/${query}${place}`);
    return { page, faults };
}

/** Waits until a condition holds in the page. */
export function until(page, condition, argument) {
    return page.waitForFunction(condition, argument, { timeout: PATIENCE_MS, polling: 100 });
}

/** Puts the viewer somewhere and waits until its view is whole, at rest, and drawn. */
export async function go(page, place) {
    await page.evaluate((hash) => {
        location.hash = hash;
        window.terrane.figures = undefined;
    }, place);
    await settle(page);
}

/** Waits until all that is wanted is there and two pictures have been drawn since. */
export async function settle(page) {
    await until(page, () => {
        const { figures } = window.terrane;
        return figures?.tilesWanted > 0 && figures.tilesMissing === 0 && !window.terrane.sceneFigures().isFading;
    });
    const drawn = await page.evaluate(() => window.terrane.framesDrawn);
    await until(page, (before) => window.terrane.framesDrawn > before + 1, drawn);
}

/** Takes a picture for whoever wants to look, and gives its pixels. */
export async function look(page, name) {
    const png = await page.screenshot({ path: join(shots, `${name}.png`), timeout: PATIENCE_MS });
    return readPng(png);
}

/** Eight-bit RGB or RGBA without interlace, which is what Chromium writes. */
function readPng(png) {
    const width = png.readUInt32BE(16);
    const height = png.readUInt32BE(20);
    const channels = png[25] === 6 ? 4 : 3;
    const parts = [];
    for (let at = 8; at < png.length; ) {
        const length = png.readUInt32BE(at);
        if (png.toString('latin1', at + 4, at + 8) === 'IDAT') {
            parts.push(png.subarray(at + 8, at + 8 + length));
        }
        at += 12 + length;
    }
    const raw = inflateSync(Buffer.concat(parts));
    const row = width * channels;
    const pixels = Buffer.alloc(height * row);
    for (let y = 0; y < height; ++y) {
        const filter = raw[y * (row + 1)];
        for (let i = 0; i < row; ++i) {
            const left = i >= channels ? pixels[y * row + i - channels] : 0;
            const up = y > 0 ? pixels[(y - 1) * row + i] : 0;
            const corner = y > 0 && i >= channels ? pixels[(y - 1) * row + i - channels] : 0;
            const p = left + up - corner;
            const distances = [Math.abs(p - left), Math.abs(p - up), Math.abs(p - corner)];
            const paeth = distances[0] <= distances[1] && distances[0] <= distances[2] ? left : distances[1] <= distances[2] ? up : corner;
            const predicted = [0, left, up, (left + up) >> 1, paeth][filter];
            pixels[y * row + i] = raw[y * (row + 1) + 1 + i] + predicted;
        }
    }
    return { width, height, at: (x, y) => [...pixels.subarray(y * row + x * channels, y * row + x * channels + 3)] };
}
