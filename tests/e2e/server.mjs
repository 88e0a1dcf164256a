// Starts a real `terrane serve` on free ports, and a plain file server for the pages.
import { spawn } from 'node:child_process';
import { createServer } from 'node:http';
import { readFile } from 'node:fs/promises';
import { extname, join, normalize } from 'node:path';

const TYPES = {
    '.html': 'text/html', '.js': 'text/javascript', '.mjs': 'text/javascript',
    '.json': 'application/json', '.wasm': 'application/wasm', '.css': 'text/css',
    '.png': 'image/png', '.svg': 'image/svg+xml',
};

/** Resolves with {origin, stop} once it listens. */
export async function startTerrane(program, world) {
    const child = spawn(program, ['serve', '--world', world, '--store', 'memory', '--tcp',
        '127.0.0.1:0', '--http', '127.0.0.1:0', '--log-level', 'warning'],
        { stdio: ['ignore', 'pipe', 'inherit'] });
    // Whatever ends this program ends the server.
    const end = () => child.kill('SIGKILL');
    process.once('exit', end);
    for (const signal of ['SIGINT', 'SIGTERM']) {
        process.once(signal, () => process.exit(1));
    }
    const ended = new Promise((resolve) => child.once('exit', (code) => resolve(code)));
    let text = '';
    const origin = await new Promise((resolve, reject) => {
        const timer = setTimeout(() => reject(new Error(`terrane said only: ${text}`)), 60000);
        child.stdout.on('data', (bytes) => {
            text += bytes;
            const found = text.match(/listening on http ([0-9.]+:[0-9]+)/);
            if (found) {
                clearTimeout(timer);
                resolve(`http://${found[1]}`);
            }
        });
        ended.then((code) => reject(new Error(`terrane ended with ${code}: ${text}`)));
    });
    const description = await (await fetch(`${origin}/v1/world`)).json();
    return {
        origin,
        world: description,
        content: origin + description.links.content,
        async stop() {
            child.kill('SIGTERM');
            const code = await ended;
            process.off('exit', end);
            if (code !== 0) {
                throw new Error(`terrane ended with ${code}`);
            }
        },
    };
}

/** Serves `mounts` {"/prefix/": folder} on a free port. */
export async function startPages(mounts) {
    const server = createServer(async (request, response) => {
        const path = decodeURIComponent(new URL(request.url, 'http://x').pathname);
        for (const [prefix, folder] of Object.entries(mounts)) {
            if (path.startsWith(prefix)) {
                const file = normalize(join(folder, path.slice(prefix.length)));
                try {
                    if (!file.startsWith(normalize(folder))) {
                        break;
                    }
                    const bytes = await readFile(file);
                    response.writeHead(200, {
                        'content-type': TYPES[extname(file)] ?? 'application/octet-stream',
                    });
                    response.end(bytes);
                    return;
                } catch {
                    break;
                }
            }
        }
        response.writeHead(404).end();
    });
    await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
    return {
        origin: `http://127.0.0.1:${server.address().port}`,
        stop: () => new Promise((resolve) => {
            server.closeAllConnections();
            server.close(resolve);
        }),
    };
}
