// Which job and which frame are looked at: by choice, or by following what is being rendered.

import { ended } from './jobs.js';

const BUSY = ['Rendering', 'Finishing'];

export class Selection {
  /** `on`: job() after another job was taken, frame() after another frame was, follow() after that was switched. */
  constructor(on) {
    this.on = on;
    this.jobs = [];
    this.job = null;
    /** Whether somebody chose the job; else the page goes on to the next one that is submitted. */
    this.byUser = false;
    this.frames = new Map();
    /** Whether the list of frames has arrived. */
    this.known = false;
    this.frame = null;
    this.follow = true;
  }

  /** The list of jobs, newest first. */
  takeJobs(jobs) {
    this.jobs = jobs;
    const current = jobs.find((job) => job.id === this.job);
    if (this.byUser || current?.state === 'Running' || jobs.length === 0) return;
    const running = jobs.find((job) => job.state === 'Running');
    // A job that was just submitted is worth waiting for: its first tile is then not late. An older one is not.
    const newer = (job) => !ended(job) && job.submitted_at > (current?.submitted_at ?? 0);
    const waiting = !current || ended(current) ? jobs.find(newer) : null;
    const next = running ?? waiting ?? current ?? jobs[0];
    if (next.id !== this.job) this.setJob(next.id, null, true);
  }

  /** Somebody wants this job, perhaps this frame of it. `follow`: false, true, or 'jobs' to go on to the next job. */
  chooseJob(id, frame, follow) {
    this.byUser = follow !== 'jobs';
    follow = Boolean(follow);
    if (id !== this.job) this.setJob(id, frame, follow);
    else {
      this.setFollow(follow);
      if (frame !== null) this.setFrame(frame);
    }
  }

  setJob(id, frame, follow) {
    this.job = id;
    this.frames = new Map();
    this.known = false;
    this.frame = null;
    this.follow = follow;
    this.on.job();
    if (frame !== null) this.setFrame(frame);
  }

  /** Frames that are new or have changed. */
  takeFrames(changed) {
    for (const frame of changed) this.frames.set(frame.frame, frame);
    this.known = true;
    const next = this.wanted();
    if (next !== null) this.setFrame(next);
  }

  /** The frame to show next, or null to stay. */
  wanted() {
    const list = [...this.frames.values()].sort((a, b) => a.frame - b.frame);
    const now = this.frames.get(this.frame);
    if (this.frame !== null && (!this.follow || (now && BUSY.includes(now.state)))) return null;
    const busy = list.find((frame) => BUSY.includes(frame.state));
    if (busy) return busy.frame;
    if (now || list.length === 0) return null;
    const done = list.filter((frame) => frame.state !== 'Pending');
    return (done[done.length - 1] ?? list[0]).frame;
  }

  /** Somebody wants this frame: following ends. */
  chooseFrame(number) {
    this.setFollow(false);
    this.setFrame(number);
  }

  /** What a permalink needs. */
  link() {
    const { job, frame, follow, byUser } = this;
    return { job, frame, follow: follow && !byUser ? 'jobs' : follow };
  }

  /** The frame so many places on; beyond the ends it is the first or the last. */
  step(places) {
    const numbers = [...this.frames.keys()].sort((a, b) => a - b);
    if (numbers.length === 0) return;
    const place = numbers.indexOf(this.frame) + places;
    this.chooseFrame(numbers[Math.min(Math.max(place, 0), numbers.length - 1)]);
  }

  setFollow(follow) {
    if (follow === this.follow) return;
    this.follow = follow;
    // Whoever wants to stay with a frame wants to stay with its job.
    if (!follow) this.byUser = true;
    const next = this.wanted();
    if (next !== null) this.setFrame(next);
    this.on.follow();
  }

  setFrame(number) {
    if (number === this.frame) return;
    this.frame = number;
    this.on.frame();
  }
}
