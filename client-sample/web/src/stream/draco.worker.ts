// Decodes Draco chunks: three's decoder in WebAssembly, one instance a worker.
import wasmUrl from 'three/examples/jsm/libs/draco/gltf/draco_decoder.wasm?url';
import wrapper from 'three/examples/jsm/libs/draco/gltf/draco_wasm_wrapper.js?raw';

export interface DracoJob {
    id: number;
    payload: Uint8Array;
}

export interface DracoMesh {
    positions: Float32Array;
    normals: Float32Array;
    colors: Uint8Array;
    materials: Uint8Array;
    /** What each vertex is of (MeshPart); undefined: all ground. */
    parts: Uint8Array | undefined;
    indices: Uint32Array;
}

export type DracoAnswer =
    | { id: number; mesh: DracoMesh; ms: number }
    | { id: number; error: string };

// The decoder comes without types; this is all that is used of it.
interface Draco {
    POSITION: number;
    NORMAL: number;
    COLOR: number;
    GENERIC: number;
    DT_FLOAT32: number;
    DT_UINT8: number;
    HEAPF32: Float32Array;
    HEAPU8: Uint8Array;
    HEAPU32: Uint32Array;
    Decoder: new () => any;
    DecoderBuffer: new () => any;
    Mesh: new () => any;
    destroy(object: unknown): void;
    _malloc(bytes: number): number;
    _free(at: number): void;
}

const decoder: Promise<Draco> = (async () => {
    const wasmBinary = await (await fetch(wasmUrl)).arrayBuffer();
    const make = new Function(`${wrapper}\nreturn DracoDecoderModule;`)() as (options: object) => Promise<Draco>;
    return make({ wasmBinary });
})();

/** The mesh's attributes of a kind, in their order. */
function attributesOf(reader: any, mesh: any, kind: number): any[] {
    return Array.from({ length: mesh.num_attributes() as number }, (_, i) => reader.GetAttribute(mesh, i))
        .filter((one) => one.attribute_type() === kind);
}

function valuesOf<T extends Float32Array | Uint8Array>(
    draco: Draco, reader: any, mesh: any, attribute: any, components: number, make: new (length: number) => T,
): T {
    if (attribute === undefined) {
        throw new Error('draco: an attribute is missing');
    }
    const isFloat = (make as unknown) === Float32Array;
    const values = new make(mesh.num_points() * components);
    const at = draco._malloc(values.byteLength);
    try {
        const type = isFloat ? draco.DT_FLOAT32 : draco.DT_UINT8;
        if (!reader.GetAttributeDataArrayForAllPoints(mesh, attribute, type, values.byteLength, at)) {
            throw new Error('draco: an attribute cannot be read');
        }
        const heap = isFloat ? draco.HEAPF32 : draco.HEAPU8;
        const first = at / values.BYTES_PER_ELEMENT;
        values.set(heap.subarray(first, first + values.length));
    } finally {
        draco._free(at);
    }
    return values;
}

function decode(draco: Draco, payload: Uint8Array): DracoMesh {
    const reader = new draco.Decoder();
    const buffer = new draco.DecoderBuffer();
    const mesh = new draco.Mesh();
    try {
        buffer.Init(payload, payload.byteLength);
        const status = reader.DecodeBufferToMesh(buffer, mesh);
        if (!status.ok()) {
            throw new Error(`draco: ${status.error_msg()}`);
        }
        const count = mesh.num_faces() * 3;
        const at = draco._malloc(count * 4);
        const indices = new Uint32Array(count);
        reader.GetTrianglesUInt32Array(mesh, count * 4, at);
        indices.set(draco.HEAPU32.subarray(at / 4, at / 4 + count));
        draco._free(at);
        const [materials, parts] = attributesOf(reader, mesh, draco.GENERIC);
        const first = (kind: number) => attributesOf(reader, mesh, kind)[0];
        return {
            positions: valuesOf(draco, reader, mesh, first(draco.POSITION), 3, Float32Array),
            normals: valuesOf(draco, reader, mesh, first(draco.NORMAL), 3, Float32Array),
            colors: valuesOf(draco, reader, mesh, first(draco.COLOR), 3, Uint8Array),
            materials: valuesOf(draco, reader, mesh, materials, 1, Uint8Array),
            parts: parts && valuesOf(draco, reader, mesh, parts, 1, Uint8Array),
            indices,
        };
    } finally {
        draco.destroy(mesh);
        draco.destroy(buffer);
        draco.destroy(reader);
    }
}

self.onmessage = async ({ data }: MessageEvent<DracoJob>) => {
    const { id, payload } = data;
    try {
        const draco = await decoder;
        const begin = performance.now();
        const mesh = decode(draco, payload);
        const answer: DracoAnswer = { id, mesh, ms: performance.now() - begin };
        const moved = [mesh.positions, mesh.normals, mesh.colors, mesh.materials, mesh.indices];
        if (mesh.parts !== undefined) {
            moved.push(mesh.parts);
        }
        self.postMessage(answer, { transfer: moved.map(({ buffer }) => buffer as ArrayBuffer) });
    } catch (error) {
        self.postMessage({ id, error: (error as Error).message } satisfies DracoAnswer);
    }
};
