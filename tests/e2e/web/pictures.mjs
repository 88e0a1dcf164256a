// Takes the pictures of client-sample/web, or those that are named: node pictures.mjs OUT [NAME]...
import { mkdirSync } from 'node:fs';
import { join } from 'node:path';

import { openViewer, settle, startBrowser, startServer, until } from './harness.mjs';

const [, , out, ...names] = process.argv;
mkdirSync(out, { recursive: true });

const PICTURES = [
    { name: 'flight', place: '#-480.0,150.0,330.0,-1.7,-0.22', hour: 16 },
    { name: 'cut', place: '#-300.0,190.0,420.0,-0.6,-0.42', hour: 15, act: () => window.terrane.toggleCut() },
    { name: 'xray', place: '#20.0,135.0,-60.0,0.6,-0.4', hour: 15, act: () => window.terrane.toggleXray() },
];

const server = await startServer();
const browser = await startBrowser();
try {
    for (const { name, place, hour, act } of PICTURES.filter((one) => names.length === 0 || names.includes(one.name))) {
        const { page } = await openViewer(browser, server.port, {
            query: `?quality=2&hour=${hour}`, place, width: 1280, height: 720,
        });
        await until(page, () => window.terrane?.world !== undefined && window.terrane.figures?.nearMissing === 0);
        await settle(page);
        if (act !== undefined) {
            await page.evaluate(act);
            // The fine picture of a cut, or all that is looked for around, comes a moment later.
            await until(page, () => {
                const { cut, xray } = window.terrane.world;
                return (!cut.isOn || (cut.missing === 0 && cut.near.image?.line.width > 1000)) &&
                    (!xray.isOn || xray.shown.size >= xray.wanted.size - 1);
            });
            await settle(page);
        }
        await page.screenshot({ path: join(out, `${name}.jpg`), type: 'jpeg', quality: 86, timeout: 120_000 });
        await page.close();
        console.log(`${name}.jpg`);
    }
} finally {
    await browser.close();
    await server.stop();
}
