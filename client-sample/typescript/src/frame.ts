// Frames: u32 length of what follows, size-prefixed FlatBuffer head, payload. WIRE_FORMAT.md.
import { ByteBuffer } from 'flatbuffers';

/** "TRNE", at bytes 8..11 of the size-prefixed head's 4-byte prefix and root offset. */
const IDENTIFIER = [0x54, 0x52, 0x4e, 0x45];
const LENGTH_BYTES = 4;
const FRAME_BYTES_MIN = 12;
const HEAD_BYTES_MIN = 8;
/** The largest frame that is taken from a server: 66 MiB and its length. */
export const FRAME_BYTES_MAX = 66 * 1024 * 1024 + 4;

export interface Frame {
    /** Positioned behind the size prefix: what getRootAsMessage takes. */
    head: ByteBuffer;
    payload: Uint8Array;
}

/** A whole frame, its length included. Throws on anything that is none. */
export function parseFrame(bytes: Uint8Array): Frame {
    if (bytes.byteLength < LENGTH_BYTES + FRAME_BYTES_MIN) {
        throw new Error(`frame: ${bytes.byteLength} bytes are too few`);
    }
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const length = view.getUint32(0, true);
    if (length !== bytes.byteLength - LENGTH_BYTES) {
        throw new Error(`frame: says ${length} bytes, has ${bytes.byteLength - LENGTH_BYTES}`);
    }
    const headBytes = view.getUint32(LENGTH_BYTES, true);
    if (headBytes < HEAD_BYTES_MIN || headBytes > length - 4) {
        throw new Error(`frame: a head of ${headBytes} bytes in ${length}`);
    }
    const begin = LENGTH_BYTES + 4;
    if (IDENTIFIER.some((value, i) => bytes[begin + 4 + i] !== value)) {
        throw new Error('frame: the head is not a Terrane message');
    }
    // A copy of its own: payloads are handed on while heads are read.
    const head = new ByteBuffer(bytes.slice(begin, begin + headBytes));
    return { head, payload: bytes.subarray(begin + headBytes) };
}

/** A size-prefixed head, as FlatBuffers' finishSizePrefixed makes it, becomes a frame. */
export function makeFrame(head: Uint8Array): Uint8Array {
    const frame = new Uint8Array(LENGTH_BYTES + head.byteLength);
    new DataView(frame.buffer).setUint32(0, head.byteLength, true);
    frame.set(head, LENGTH_BYTES);
    return frame;
}

/** Cuts a stream of bytes into frames. */
export class FrameSplitter {
    private parts: Uint8Array[] = [];
    private held = 0;
    private wanted = LENGTH_BYTES;

    /** Frames that are whole now. Throws on a length that no frame has. */
    push(bytes: Uint8Array): Uint8Array[] {
        this.parts.push(bytes);
        this.held += bytes.byteLength;
        const frames: Uint8Array[] = [];
        while (this.held >= this.wanted) {
            const joined = this.join();
            const length = new DataView(joined.buffer, joined.byteOffset).getUint32(0, true);
            if (length < FRAME_BYTES_MIN || length > FRAME_BYTES_MAX) {
                throw new Error(`frame: a length of ${length} bytes`);
            }
            this.wanted = LENGTH_BYTES + length;
            if (this.held < this.wanted) {
                break;
            }
            frames.push(joined.slice(0, this.wanted));
            this.parts = [joined.subarray(this.wanted)];
            this.held -= this.wanted;
            this.wanted = LENGTH_BYTES;
        }
        return frames;
    }

    private join(): Uint8Array {
        if (this.parts.length > 1) {
            const all = new Uint8Array(this.held);
            let at = 0;
            for (const part of this.parts) {
                all.set(part, at);
                at += part.byteLength;
            }
            this.parts = [all];
        }
        return this.parts[0]!;
    }
}
