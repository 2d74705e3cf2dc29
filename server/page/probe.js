// The pixel probe: half floats of what is on screen at once, and the server's exact floats of all layers on a click.

import { get, make, setText } from './dom.js';
import { exact, rough } from './format.js';

const ORDER = ['Color', 'Albedo', 'Normal', 'Depth', 'Samples', 'Error'];
const CHANNELS = { Color: ['R', 'G', 'B'], Albedo: ['R', 'G', 'B'], Normal: ['X', 'Y', 'Z'] };
const ASK_EVERY_MS = 120;
const RENEW_EVERY_MS = 1000;

export class Probe {
  /** `ask(number, pixel)` sends the question. */
  constructor(ask) {
    this.ask = ask;
    this.number = 0;
    this.pinned = null;
    this.answer = null;
    this.askedAt = -Infinity;
    this.timer = 0;
    get('probe-clear').addEventListener('click', () => this.clear());
  }

  /** What lies under the pointer. */
  hover(pixel, sample, layer) {
    setText(get('hover-at'), pixel ? `${pixel.x}, ${pixel.y}` : '–');
    setText(get('hover-what'), sample && sample.step > 1 ? `${layer}, mean of ${sample.step}×${sample.step}` : layer);
    const names = CHANNELS[layer];
    sample = sample?.values ?? null;
    ['r', 'g', 'b'].forEach((id, i) => {
      setText(get(`hover-name-${id}`), names[i]);
      setText(get(`hover-${id}`), sample ? rough(sample[i]) : '–');
    });
  }

  /** Asks for a pixel; a pointer that is dragged asks a few times a second. */
  pin(pixel) {
    this.pinned = pixel;
    this.answer = null;
    this.render();
    this.schedule(ASK_EVERY_MS);
  }

  /** The pinned pixel may have changed, or there is a new connection. */
  renew() {
    if (this.pinned && !this.timer) this.schedule(RENEW_EVERY_MS);
  }

  clear() {
    this.pinned = this.answer = null;
    clearTimeout(this.timer);
    this.timer = 0;
    this.render();
    this.onclear?.();
  }

  schedule(every) {
    clearTimeout(this.timer);
    const wait = Math.max(0, this.askedAt + every - performance.now());
    this.timer = setTimeout(() => {
      this.timer = 0;
      this.askedAt = performance.now();
      if (this.pinned) this.ask(++this.number, this.pinned);
    }, wait);
  }

  /** An answer of the server; only the one to the last question counts. */
  take(message) {
    if (message.probe !== this.number || !this.pinned) return;
    this.answer = message;
    this.render();
  }

  render() {
    const { pinned, answer } = this;
    get('probe-pinned').hidden = !pinned;
    get('probe-hint').hidden = Boolean(pinned);
    setText(get('probe-at'), pinned ? `${pinned.x}, ${pinned.y}` : '');
    if (!pinned) return;
    setText(get('probe-error'), answer?.error ?? '');
    get('probe-error').hidden = !answer?.error;
    // While the next answer is on its way the table keeps its shape.
    if (answer?.values) get('probe-values').replaceChildren(...rows(answer.values));
    get('probe-values').classList.toggle('stale', !answer);
  }
}

function rows(values) {
  const names = [...ORDER.filter((name) => name in values), ...Object.keys(values).filter((name) => !ORDER.includes(name))];
  return names.flatMap((name) =>
    values[name].map((value, i) => {
      const head = make('th', { scope: 'row' }, i === 0 ? name : '');
      const channel = make('td', { class: 'channel' }, CHANNELS[name]?.[i] ?? '');
      const number = make('td', { class: value === null ? 'number odd' : 'number' }, exact(value));
      number.dataset.layer = name;
      return make('tr', { class: i === 0 ? 'first' : '' }, head, channel, number);
    }),
  );
}
