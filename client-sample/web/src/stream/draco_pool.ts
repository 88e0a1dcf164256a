// A few Draco workers; each gets the next job when it is done with its last.
import type { DracoAnswer, DracoMesh } from './draco.worker';

interface Waiting {
    payload: Uint8Array;
    resolve: (decoded: { mesh: DracoMesh; ms: number }) => void;
    reject: (error: Error) => void;
}

export class DracoPool {
    private readonly idle: Worker[] = [];
    private readonly queue: Waiting[] = [];
    private readonly running = new Map<number, { job: Waiting; worker: Worker }>();
    private nextId = 1;

    constructor(workers: number) {
        for (let i = 0; i < workers; ++i) {
            const worker = new Worker(new URL('./draco.worker.ts', import.meta.url), { type: 'module' });
            worker.onmessage = ({ data }: MessageEvent<DracoAnswer>) => this.finish(data);
            this.idle.push(worker);
        }
    }

    get length(): number {
        return this.queue.length + this.running.size;
    }

    decode(payload: Uint8Array): Promise<{ mesh: DracoMesh; ms: number }> {
        return new Promise((resolve, reject) => {
            this.queue.push({ payload, resolve, reject });
            this.next();
        });
    }

    private next(): void {
        while (this.idle.length > 0 && this.queue.length > 0) {
            const worker = this.idle.pop()!;
            const job = this.queue.shift()!;
            const id = this.nextId++;
            this.running.set(id, { job, worker });
            worker.postMessage({ id, payload: job.payload });
        }
    }

    private finish(answer: DracoAnswer): void {
        const { job, worker } = this.running.get(answer.id)!;
        this.running.delete(answer.id);
        this.idle.push(worker);
        if ('error' in answer) {
            job.reject(new Error(answer.error));
        } else {
            job.resolve(answer);
        }
        this.next();
    }
}
