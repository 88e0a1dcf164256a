import { defineConfig } from 'vite';

// TERRANE_SERVER=127.0.0.1:8080 npm run dev: a running server's /ws and /v1 behind Vite's own pages.
const server = process.env.TERRANE_SERVER ?? '127.0.0.1:8080';

export default defineConfig({
    base: './',
    build: {
        target: 'es2022',
        outDir: process.env.TERRANE_VIEWER_OUT ?? 'dist',
        emptyOutDir: true,
        assetsInlineLimit: 0,
        chunkSizeWarningLimit: 1200,
    },
    worker: { format: 'es' },
    server: { proxy: { '/ws': { target: `ws://${server}`, ws: true }, '/v1': `http://${server}` } },
});
