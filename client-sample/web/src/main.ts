// The viewer: joins the stream worker, the scene and the page.
import './ui/style.css';

import { Viewer } from './viewer';

const canvas = document.getElementById('view') as HTMLCanvasElement;
const ui = document.getElementById('ui')!;

try {
    const viewer = new Viewer(canvas, ui);
    // For scripts and tests: what the page knows of itself.
    (window as unknown as { terrane: Viewer }).terrane = viewer;
} catch (error) {
    ui.textContent = `The picture cannot be drawn here: ${(error as Error).message}. WebGL 2 is needed.`;
    ui.style.padding = '40px';
    throw error;
}
