// A server of the shipped demo world on a free port, for tests: `terrane` of the release build, or
// TERRANE_BIN.
import { spawn } from 'node:child_process';
import { existsSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

export const root = join(dirname(fileURLToPath(import.meta.url)), '../../..');
export const terrane = process.env.TERRANE_BIN ?? join(root, 'build/release/bin/terrane');
export const terraneClient = join(dirname(terrane), 'terrane-client');
export const basin = join(root, 'generator/worlds/basin.toml');
export const canyon = join(root, 'generator/worlds/canyon.toml');

if (!existsSync(terrane)) {
    throw new Error(`${terrane} is not built; name it in TERRANE_BIN`);
}

/** Resolves with its TCP port once it listens. */
export function startServer(world = basin) {
    const server = spawn(
        terrane,
        ['serve', '--world', world, '--store', 'memory', '--tcp', '127.0.0.1:0', '--http', 'none'],
        { stdio: ['ignore', 'pipe', 'pipe'] },
    );
    return new Promise((resolve, reject) => {
        let log = '';
        const read = (text) => {
            log += text;
            const found = /listening on tcp [0-9.]*:(\d+)/.exec(log);
            if (found) {
                const stop = () =>
                    new Promise((done) => {
                        server.on('exit', done);
                        server.kill('SIGTERM');
                    });
                resolve({ port: Number(found[1]), stop, log: () => log });
            }
        };
        server.stdout.on('data', read);
        server.stderr.on('data', read);
        server.on('exit', (code) => reject(new Error(`the server ended (${code}):\n${log}`)));
    });
}
