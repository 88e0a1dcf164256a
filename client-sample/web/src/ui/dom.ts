// A little help with elements.

export function element<K extends keyof HTMLElementTagNameMap>(
    tag: K, className = '', text = '',
): HTMLElementTagNameMap[K] {
    const made = document.createElement(tag);
    made.className = className;
    made.textContent = text;
    return made;
}

export function icon(paths: string): string {
    return `<svg viewBox="0 0 20 20" aria-hidden="true">${paths}</svg>`;
}

export function button(label: string, paths: string, key: string, action: () => void): HTMLButtonElement {
    const made = element('button', 'button');
    made.type = 'button';
    made.title = key === '' ? label : `${label} (${key})`;
    made.innerHTML = `${icon(paths)}<span></span>${key === '' ? '' : '<kbd></kbd>'}`;
    made.querySelector('span')!.textContent = label;
    if (key !== '') {
        made.querySelector('kbd')!.textContent = key;
    }
    made.addEventListener('click', () => {
        action();
        made.blur();
    });
    return made;
}

export function number(value: number, digits = 0): string {
    return value.toLocaleString('en', { maximumFractionDigits: digits, minimumFractionDigits: digits });
}

export function bytes(value: number): string {
    const units = ['B', 'KB', 'MB', 'GB'];
    let i = 0;
    for (; value >= 1000 && i < units.length - 1; ++i) {
        value /= 1000;
    }
    return `${number(value, i === 0 || value >= 100 ? 0 : 1)} ${units[i]}`;
}

export function short(value: number): string {
    return value >= 1e6 ? `${number(value / 1e6, 2)} M` : value >= 1e4 ? `${number(value / 1e3)} k` : number(value);
}
