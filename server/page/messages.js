// What the page says in words: the connection, and why there is no picture.

import { get, setText } from './dom.js';

const LAMPS = { trying: 'connecting', open: 'connected', lost: 'connection lost', closed: 'not connected' };

export class Messages {
  /** `hurry()` tries to connect at once. */
  constructor(hurry) {
    this.lostAt = null;
    this.nextTry = 0;
    this.error = null;
    this.timer = 0;
    get('retry').addEventListener('click', hurry);
  }

  /** The lamp, and the banner while the connection is away. */
  connection(state, seconds = 0) {
    if (state === 'lost') this.lostAt ??= new Date();
    if (state === 'open' || state === 'closed') this.lostAt = null;
    this.nextTry = performance.now() + seconds * 1000;
    const lamp = get('lamp');
    lamp.dataset.state = state;
    setText(get('lamp-text'), LAMPS[state]);
    get('banner').hidden = this.lostAt === null;
    clearInterval(this.timer);
    if (this.lostAt === null) return;
    // One sentence for screen readers; the seconds that count down are not read out.
    setText(get('banner-text'), `Connection lost at ${this.lostAt.toLocaleTimeString()}. The picture may be older than the server's.`);
    const tick = () => {
      const left = Math.ceil((this.nextTry - performance.now()) / 1000);
      setText(get('banner-next'), state === 'trying' || left <= 0 ? 'Trying now' : `Next try in ${left} s`);
    };
    tick();
    this.timer = setInterval(tick, 250);
  }

  /** An error that the server sent about the watch; null when another watch began. */
  problem(message) {
    this.error = message;
  }

  /** The words in the middle of the stage, where there is no picture or something is wrong with it. */
  stage({ job, jobs, wanted, frame, shown, known }) {
    const [title, text, kind, code] = this.reason({ job, jobs, wanted, frame, shown, known });
    const box = get('message');
    box.hidden = !title;
    box.dataset.kind = kind ?? 'quiet';
    // Where there is a picture the words go below it, not over it.
    box.classList.toggle('aside', shown.spp > 0);
    setText(get('message-title'), title ?? '');
    setText(get('message-text'), text ?? '');
    setText(get('message-code'), code ?? '');
  }

  reason({ job, jobs, wanted, frame, shown, known }) {
    if (this.error) return [this.error.error, this.error.hint ?? '', 'bad'];
    if (frame?.state === 'Failed') return [`Frame ${frame.frame} failed`, frame.error ?? job?.error ?? '', 'bad'];
    if (job?.state === 'Failed' && shown.spp === 0) return ['This job failed', job.error ?? '', 'bad'];
    if (shown.spp > 0) return [];
    if (!wanted) return jobs.length === 0 ? ['No jobs yet', 'Submit one, and its picture appears here.', 'quiet', 'karst submit scene.json'] : [];
    if (!known) return [];
    if (frame?.state === 'Cancelled') return [`Frame ${frame.frame} was cancelled`, 'before its first tile'];
    if (frame?.state === 'Pending' || job?.state === 'Queued') return ['Waiting for a worker', ''];
    return [];
  }
}
