// The pages in headless Chromium: what they say about themselves, and what they look like.
import { build } from 'esbuild';
import { chromium } from 'playwright-core';
import { copyFile, cp, mkdir, writeFile } from 'node:fs/promises';
import { join } from 'node:path';

const CHROMIUM = process.env.CHROMIUM ?? '/usr/bin/chromium';
const FLAGS = ['--headless', '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
    '--disable-background-networking', '--disable-component-update', '--disable-sync',
    '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];

const html = (title, body) => `<!doctype html><meta charset="utf-8"><title>${title}</title>
<link rel="icon" href="data:,"><style>body{margin:0}canvas{display:block}</style>${body}\n`;

/** Bundles the pages into `out`, with what they load beside them. */
export async function makePages(here, out) {
    await mkdir(join(out, 'draco'), { recursive: true });
    await build({
        entryPoints: [join(here, 'three_page.js')], bundle: true, format: 'esm',
        outfile: join(out, 'three_page.js'), logLevel: 'error',
    });
    await copyFile(join(here, 'cesium_page.js'), join(out, 'cesium_page.js'));
    await cp(join(here, 'node_modules/three/examples/jsm/libs/draco/gltf'), join(out, 'draco'),
        { recursive: true });
    await writeFile(join(out, 'three.html'),
        html('three', '<script type="module" src="three_page.js"></script>'));
    await writeFile(join(out, 'cesium.html'), html('cesium',
        '<style>#scene,#scene *{width:800px;height:600px}</style><div id="scene"></div>'
        + '<script>window.CESIUM_BASE_URL="/cesium/"</script>'
        + '<script src="/cesium/Cesium.js"></script><script src="cesium_page.js"></script>'));
}

export async function openBrowser() {
    return chromium.launch({ executablePath: CHROMIUM, args: FLAGS, headless: true });
}

/** Opens a page and waits until it says that it is done; gives its state. */
export async function see(browser, url, screenshot, timeoutMs = 120000) {
    const page = await browser.newPage({ viewport: { width: 800, height: 600 } });
    const errors = [];
    page.on('pageerror', (error) => errors.push(String(error)));
    page.on('console', (message) => {
        if (message.type() === 'error') {
            errors.push(message.text());
        }
    });
    page.on('requestfailed', (request) => {
        // What a page no longer wants it may take back.
        if (request.failure()?.errorText !== 'net::ERR_ABORTED') {
            errors.push(`${request.url()}: ${request.failure()?.errorText}`);
        }
    });
    page.on('response', (response) => {
        if (response.status() >= 400) {
            errors.push(`${response.url()}: ${response.status()}`);
        }
    });
    try {
        await page.goto(url);
        await page.waitForFunction(
            () => window.state && (window.state.done || window.state.errors.length > 0), null,
            { timeout: timeoutMs });
    } catch (error) {
        errors.push(String(error));
    }
    await page.screenshot({ path: screenshot });
    const state = (await page.evaluate(() => window.state)) ?? { errors: [] };
    await page.close();
    return { ...state, errors: [...errors, ...state.errors] };
}
