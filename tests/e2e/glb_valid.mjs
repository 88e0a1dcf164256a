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
        if (bytes.length === 0) {
            // A chunk without a surface has no body; its status says what it is.
            const status = reply.headers.get('terrane-status') ?? '';
            if (!/^(empty|uniform)/.test(status)) {
                throw new Error(`${kind}: ${url} has no body and status "${status}"`);
            }
            seen.push(`${kind}: ${status}`);
            continue;
        }
        const report = await validator.validateBytes(bytes, { uri: url, maxIssues: 20 });
        const { numErrors, numWarnings } = report.issues;
        if (numErrors > 0 || numWarnings > 0) {
            throw new Error(`${kind}: ${url}: ${JSON.stringify(report.issues.messages, null, 1)}`);
        }
        seen.push(`${kind}: ${bytes.length} bytes, ${report.info.totalTriangleCount} triangles`);
    }
    return seen;
}
