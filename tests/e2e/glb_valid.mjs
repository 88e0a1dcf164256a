// Every kind of tile through Khronos' gltf-validator: 0 errors, 0 warnings.
import validator from 'gltf-validator';

/** Gives the URLs checked; throws what is wrong. */
export async function validateTiles(terrane, kinds) {
    const seen = [];
    for (const [kind, path] of kinds) {
        const url = terrane.content + path;
        const reply = await fetch(url);
        const bytes = new Uint8Array(await reply.arrayBuffer());
        if (reply.status !== 200) {
            throw new Error(`${kind}: ${url} gave ${reply.status}`);
        }
        const report = await validator.validateBytes(bytes, { uri: url, maxIssues: 20 });
        const { numErrors, numWarnings } = report.issues;
        if (numErrors > 0 || numWarnings > 0) {
            throw new Error(`${kind}: ${url}: ${JSON.stringify(report.issues.messages, null, 1)}`);
        }
        const triangles = report.info.totalTriangleCount;
        // A chunk without a surface is a file of no triangles; its status says what it is.
        const status = reply.headers.get('terrane-status') ?? 'full';
        if (/^(empty|uniform)/.test(status) !== (triangles === 0)) {
            throw new Error(`${kind}: ${url} has ${triangles} triangles and status "${status}"`);
        }
        seen.push(`${kind}: ${bytes.length} bytes, ${triangles} triangles, ${status}`);
    }
    return seen;
}
