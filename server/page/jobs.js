// The list of jobs: names, states, how many frames are finished, errors.

import { get, make, setText } from './dom.js';
import { ago } from './format.js';

const WORDS = { Queued: 'waiting', Running: 'rendering', Succeeded: 'finished', Failed: 'failed', Cancelled: 'cancelled' };

/** Whether nothing will change any more. */
export const ended = (job) => ['Succeeded', 'Failed', 'Cancelled'].includes(job.state);

export class JobList {
  constructor() {
    this.list = get('job-list');
    this.empty = get('no-jobs');
    this.items = new Map();
    this.jobs = [];
    setInterval(() => this.refreshTimes(), 30000);
  }

  /** Shows the jobs in the order given; elements of jobs that were there before stay, so focus is kept. */
  show(jobs, selected) {
    this.jobs = jobs;
    const gone = new Set(this.items.keys());
    jobs.forEach((job, index) => {
      gone.delete(job.id);
      const item = this.items.get(job.id) ?? this.add(job.id);
      fill(item, job, job.id === selected);
      if (this.list.children[index] !== item.element) this.list.insertBefore(item.element, this.list.children[index] ?? null);
    });
    for (const id of gone) {
      this.items.get(id).element.remove();
      this.items.delete(id);
    }
    this.empty.hidden = jobs.length > 0;
    setText(get('job-count'), jobs.length > 0 ? String(jobs.length) : '');
  }

  add(id) {
    const item = {
      name: make('span', { class: 'job-name' }),
      state: make('span', { class: 'job-state' }),
      frames: make('span', { class: 'job-frames' }),
      time: make('span', { class: 'job-time' }),
      bar: make('progress', { class: 'thin', max: 1, value: 0, 'aria-label': 'frames finished' }),
      error: make('span', { class: 'job-error' }),
    };
    const line = make('span', { class: 'job-line' }, item.state, item.frames, item.time);
    item.link = make('a', { class: 'job', href: `#job=${encodeURIComponent(id)}` }, item.name, line, item.bar, item.error);
    item.element = make('li', {}, item.link);
    this.items.set(id, item);
    return item;
  }

  refreshTimes() {
    for (const job of this.jobs) setText(this.items.get(job.id).time, ago(job.submitted_at));
  }
}

function fill(item, job, selected) {
  setText(item.name, job.name || job.id);
  setText(item.state, WORDS[job.state] ?? job.state);
  setText(item.frames, job.frames_total === 1 ? '' : `${job.frames_finished} of ${job.frames_total}`);
  setText(item.time, ago(job.submitted_at));
  setText(item.error, job.error ?? '');
  item.error.hidden = !job.error;
  item.bar.value = job.frames_total > 0 ? job.frames_finished / job.frames_total : 0;
  item.bar.hidden = ended(job) && !job.error;
  item.link.dataset.state = job.state;
  item.link.title = `${job.name || job.id} (${job.id}), ${job.frames_finished} of ${job.frames_total} frames finished`;
  if (selected) item.link.setAttribute('aria-current', 'true');
  else item.link.removeAttribute('aria-current');
}
