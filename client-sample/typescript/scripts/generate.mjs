// Generates the readers of the wire schema into src/generated with flatc (2.0.8). flatc writes import
// paths without an extension, which Node's module loader refuses: they get theirs here.
import { execFileSync } from 'node:child_process';
import { mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = dirname(dirname(fileURLToPath(import.meta.url)));
const schema = join(here, '../../protocol/wire/terrane.fbs');
const out = join(here, 'src/generated');
rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });
execFileSync(process.env.FLATC ?? 'flatc', ['--ts', '-o', out, schema], { stdio: 'inherit' });

function addExtensions(folder) {
    for (const entry of readdirSync(folder, { withFileTypes: true })) {
        const path = join(folder, entry.name);
        if (entry.isDirectory()) {
            addExtensions(path);
        } else {
            const text = readFileSync(path, 'utf8');
            writeFileSync(path, text.replaceAll(/from '(\.[^']*)'/g, "from '$1.js'"));
        }
    }
}
addExtensions(out);
