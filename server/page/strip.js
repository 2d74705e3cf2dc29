// The strip of all frames of a job: number and state of each, one of them selected.

import { get, make, setText } from './dom.js';
import { duration, errorPercent, spp } from './format.js';

const WORDS = {
  Pending: 'waiting', Rendering: 'rendering', Finishing: 'writing files', Finished: 'finished', Failed: 'failed',
  Cancelled: 'cancelled',
};

export const stateWord = (state) => WORDS[state] ?? state;

export class Strip {
  /** `choose(number)` is called when somebody takes a frame. */
  constructor(choose) {
    this.list = get('frame-list');
    this.cells = new Map();
    this.selected = null;
    this.list.addEventListener('click', (event) => {
      const cell = event.target.closest('button');
      if (cell) choose(Number(cell.dataset.frame));
    });
    // A wheel turns the strip sideways, as every film strip does.
    this.list.addEventListener('wheel', (event) => {
      if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) return;
      event.preventDefault();
      this.list.scrollLeft += event.deltaY;
    }, { passive: false });
  }

  clear() {
    this.list.replaceChildren();
    this.cells.clear();
    this.selected = null;
    setText(get('frame-count'), '');
  }

  /** Shows frames that are new or changed; `all` is every frame of the job. */
  update(changed, all) {
    let added = false;
    for (const frame of changed) {
      let cell = this.cells.get(frame.frame);
      if (!cell) {
        cell = make('button', { type: 'button', class: 'cell', tabIndex: -1 }, String(frame.frame));
        cell.dataset.frame = frame.frame;
        this.cells.set(frame.frame, cell);
        added = true;
      }
      cell.dataset.state = frame.state;
      cell.title = describe(frame);
      cell.setAttribute('aria-label', describe(frame));
    }
    if (added) this.list.replaceChildren(...[...this.cells].sort((a, b) => a[0] - b[0]).map(([, cell]) => cell));
    const finished = [...all.values()].filter((frame) => frame.state === 'Finished').length;
    setText(get('frame-count'), `${finished} of ${all.size} finished`);
  }

  select(number) {
    if (number === this.selected) return;
    const before = this.cells.get(this.selected);
    before?.removeAttribute('aria-current');
    if (before) before.tabIndex = -1;
    const cell = this.cells.get(number);
    this.selected = cell ? number : null;
    if (!cell) return;
    cell.setAttribute('aria-current', 'true');
    cell.tabIndex = 0;
    if (document.activeElement === before) cell.focus({ preventScroll: true });
    cell.scrollIntoView({ block: 'nearest', inline: 'nearest' });
  }
}

function describe(frame) {
  const parts = [`frame ${frame.frame}`, stateWord(frame.state)];
  if (frame.spp > 0) parts.push(`${spp(frame.spp)} spp`);
  if (frame.rel_mse !== null && frame.rel_mse !== undefined) parts.push(`error ${errorPercent(frame.rel_mse)}`);
  if (Number.isFinite(frame.denoised_rel_mse)) parts.push(`denoised ${errorPercent(frame.denoised_rel_mse)}`);
  if (frame.seconds > 0) parts.push(duration(frame.seconds));
  if (frame.error) parts.push(frame.error);
  return parts.join(', ');
}
