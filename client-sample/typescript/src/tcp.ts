// The native protocol's own transport, for Node: import it from "terrane-client/tcp".
import { connect } from 'node:net';

import { FrameSplitter } from './frame.js';
import type { Transport } from './transport.js';

const CONNECT_TIMEOUT_MS = 10_000;

export interface TcpAddress {
    host?: string;
    port?: number;
}

/** Resolves once connected. */
export function connectTcp({ host = '127.0.0.1', port = 7777 }: TcpAddress = {}): Promise<Transport> {
    return new Promise((resolve, reject) => {
        const socket = connect({ host, port, noDelay: true });
        const splitter = new FrameSplitter();
        let isOpen = false;
        let reason: string | undefined;
        const transport: Transport = {
            send: (frame) => void socket.write(frame),
            close: () => void socket.end(),
            onFrame: undefined,
            onClose: undefined,
        };
        socket.setTimeout(CONNECT_TIMEOUT_MS, () => socket.destroy(new Error('no answer in time')));
        socket.on('connect', () => {
            isOpen = true;
            socket.setTimeout(0);
            resolve(transport);
        });
        socket.on('data', (bytes) => {
            try {
                for (const frame of splitter.push(bytes)) {
                    transport.onFrame?.(frame);
                }
            } catch (error) {
                socket.destroy(error as Error);
            }
        });
        socket.on('error', (error) => (reason = `${host}:${port}: ${error.message}`));
        socket.on('close', () => {
            if (isOpen) {
                transport.onClose?.(reason ?? 'the connection ended');
            } else {
                reject(new Error(reason ?? `cannot connect to ${host}:${port}`));
            }
        });
    });
}
