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

class WebSocketTransport implements Transport {
    onFrame: ((frame: Uint8Array) => void) | undefined;
    onClose: ((reason?: string) => void) | undefined;
    private isOpen = false;
    private isClosed = false;

    constructor(
        private readonly socket: WebSocketLike,
        url: string,
        opened: (transport: Transport) => void,
        failed: (error: Error) => void,
    ) {
        socket.binaryType = 'arraybuffer';
        const end = (reason: string) => {
            clearTimeout(timer);
            if (this.isClosed) {
                return;
            }
            this.isClosed = true;
            if (this.isOpen) {
                this.onClose?.(reason);
            } else {
                failed(new Error(reason));
            }
        };
        const timer = setTimeout(() => {
            end(`no answer from ${url} in ${CONNECT_TIMEOUT_MS / 1000} s`);
            socket.close();
        }, CONNECT_TIMEOUT_MS);
        const broken = () => (this.isOpen ? 'the connection ended' : `cannot connect to ${url}`);
        socket.onopen = () => {
            clearTimeout(timer);
            this.isOpen = true;
            opened(this);
        };
        socket.onmessage = (event) => {
            if (event.data instanceof ArrayBuffer) {
                this.onFrame?.(new Uint8Array(event.data));
            } else {
                end('the server sent text where frames are due');
                socket.close();
            }
        };
        socket.onclose = (event) => end(event.reason || broken());
        socket.onerror = () => end(broken());
    }

    send(frame: Uint8Array): void {
        this.socket.send(frame);
    }

    close(): void {
        this.socket.close();
    }
}

/** Resolves once the socket is open. `make`: how to, where there is no WebSocket (Node below 22). */
export function connectWebSocket(
    url: string,
    make: (url: string) => WebSocketLike = (to) => new WebSocket(to) as WebSocketLike,
): Promise<Transport> {
    return new Promise((resolve, reject) => new WebSocketTransport(make(url), url, resolve, reject));
}
