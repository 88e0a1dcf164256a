// Puts the compiled column reader into dist: TERRANE_COLUMNS_WASM names one that is built already,
// otherwise it is built here (clang 19 for wasm32-wasi).
import { execFileSync } from 'node:child_process';
import { copyFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = dirname(dirname(fileURLToPath(import.meta.url)));
const out = join(here, 'dist/columns.wasm');
const built = process.env.TERRANE_COLUMNS_WASM;
if (built) {
    copyFileSync(built, out);
} else {
    execFileSync(join(here, 'wasm/build'), [out], { stdio: 'inherit' });
}
