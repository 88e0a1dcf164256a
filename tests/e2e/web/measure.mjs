// Measures in the page: how long a start takes on a cold and on a warm server, and columns against
// Draco over stacks that nobody has asked for. Prints medians with least and most.
import { openViewer, startBrowser, startServer, until } from './harness.mjs';

const STARTS = 3;
const COMPARISONS = 5;

function spread(values, digits = 0) {
    const sorted = [...values].sort((a, b) => a - b);
    const [median, least, most] = [sorted[sorted.length >> 1], sorted[0], sorted.at(-1)].map((value) => value.toFixed(digits));
    return `${median} (${least} to ${most})`;
}

const browser = await startBrowser();
const starts = { cold: [], warm: [] };
let server;
let page;
for (let i = 0; i < STARTS; ++i) {
    await server?.stop();
    server = await startServer();
    for (const kind of ['cold', 'warm']) {
        await page?.close();
        ({ page } = await openViewer(browser, server.port, { width: 1280, height: 720 }));
        await until(page, () => window.terrane?.times.nearView > 0);
        starts[kind].push(await page.evaluate(() => window.terrane.times));
    }
}
for (const [kind, times] of Object.entries(starts)) {
    console.log(`${kind} start, ms: greeting ${spread(times.map(({ hello }) => hello))}, ` +
        `first terrain ${spread(times.map(({ firstTile }) => firstTile))}, ` +
        `whole near view ${spread(times.map(({ nearView }) => nearView))}`);
}
const comparisons = [];
for (let i = 0; i < COMPARISONS; ++i) {
    await page.evaluate(() => {
        window.terrane.comparison = null;
        window.terrane.compare();
    });
    await until(page, () => window.terrane.comparison !== null);
    comparisons.push(await page.evaluate(() => window.terrane.comparison));
}
for (const format of ['draco', 'columns']) {
    const each = (value, digits) => spread(comparisons.map((one) => value(one) / one.tiles), digits);
    console.log(`${format}, a stack: ${each((one) => one.bytes[format] / 1000, 1)} kB, ` +
        `${each((one) => one.triangles[format])} triangles, client ${each((one) => one.clientMs[format], 2)} ms, ` +
        `server after generating ${each((one) => one.serverMs[format].mesh + one.serverMs[format].encode, 2)} ms`);
}
const ratio = (value) => spread(comparisons.map((one) => value(one).columns / value(one).draco), 2);
console.log(`columns over Draco: bytes ${ratio(({ bytes }) => bytes)}, client time ${ratio(({ clientMs }) => clientMs)}, ` +
    `server time ${ratio(({ serverMs }) => ({
        draco: serverMs.draco.mesh + serverMs.draco.encode, columns: serverMs.columns.mesh + serverMs.columns.encode,
    }))}`);
await browser.close();
await server.stop();
