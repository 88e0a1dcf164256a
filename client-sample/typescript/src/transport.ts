// A connection that carries whole frames. A WebSocket message is one frame; TCP is in tcp.ts.

export interface Transport {
    send(frame: Uint8Array): void;
    /** Ends it; `onClose` follows. */
    close(): void;
    onFrame: ((frame: Uint8Array) => void) | undefined;
    /** Once. Without a reason it was closed on purpose. */
    onClose: ((reason?: string) => void) | undefined;
}

/** The part of the browser's WebSocket that is used; the `ws` package of npm has it too. */
export interface WebSocketLike {
    binaryType: string;
    onopen: ((event: any) => void) | null;
    onmessage: ((event: any) => void) | null;
    onclose: ((event: any) => void) | null;
    onerror: ((event: any) => void) | null;
    send(data: Uint8Array): void;
    close(): void;
}

const CONNECT_TIMEOUT_MS = 10_000;

/** Resolves once the socket is open. `make`: how to, where there is no WebSocket (Node below 22). */
export function connectWebSocket(
    url: string,
    make: (url: string) => WebSocketLike = (to) => new WebSocket(to) as WebSocketLike,
): Promise<Transport> {
    return new Promise((resolve, reject) => {
        const socket = make(url);
        socket.binaryType = 'arraybuffer';
        let isOpen = false;
        let isClosed = false;
        const transport: Transport = {
            send: (frame) => socket.send(frame),
            close: () => socket.close(),
            onFrame: undefined,
            onClose: undefined,
        };
        const timer = setTimeout(() => {
            end(`no answer from ${url} in ${CONNECT_TIMEOUT_MS / 1000} s`);
            socket.close();
        }, CONNECT_TIMEOUT_MS);
        const end = (reason?: string) => {
            clearTimeout(timer);
            if (isClosed) {
                return;
            }
            isClosed = true;
            if (isOpen) {
                transport.onClose?.(reason);
            } else {
                reject(new Error(reason ?? `cannot connect to ${url}`));
            }
        };
        socket.onopen = () => {
            clearTimeout(timer);
            isOpen = true;
            resolve(transport);
        };
        socket.onmessage = (event) => {
            if (event.data instanceof ArrayBuffer) {
                transport.onFrame?.(new Uint8Array(event.data));
            } else {
                end('the server sent text where frames are due');
                socket.close();
            }
        };
        socket.onclose = (event) => end(event.reason || (isOpen ? 'the connection ended' : undefined));
        socket.onerror = () => end(isOpen ? 'the connection failed' : `cannot connect to ${url}`);
    });
}
