// Wires the page together: what is watched, what the server said about it, and what the controls change.

import { Controls } from './controls.js';
import { get, setText } from './dom.js';
import { JobList } from './jobs.js';
import { listen } from './keys.js';
import { Login } from './login.js';
import { Messages } from './messages.js';
import * as permalink from './permalink.js';
import { COARSEST, Picture } from './picture.js';
import { Probe } from './probe.js';
import { Selection } from './selection.js';
import { Socket, logout, session } from './socket.js';
import { Stage } from './stage.js';
import { showStatus } from './status.js';
import { Strip } from './strip.js';

const EXPOSURE_STEP = 0.5;
const LEVEL_DELAY_MS = 200;
/** How long the picture of another frame may stay while the first tile of the new one is on its way. */
const HOLD_MS = 200;

class Page {
  constructor() {
    this.wish = { layer: 'Color', exposure: null, view: null };
    this.info = null;
    this.progress = null;
    this.ended = false;
    this.watch = { number: 0, level: 0 };
    this.changed = false;
    /** For scripts: figures about what was drawn. */
    this.script = { firstTileAt: null, tiles: 0, refused: 0, bytes: 0, draws: 0, state: () => this.describe() };
    window.karst = this.script;

    this.picture = new Picture(get('picture'));
    this.picture.onrestored = () => this.redraw();
    this.stage = new Stage(get('picture'), {
      placed: () => this.placed(),
      hover: (pixel) => this.hover(pixel),
      pick: (pixel) => this.probe.pin(pixel),
    });
    this.controls = new Controls({
      layer: (layer) => this.change({ layer }),
      exposure: (exposure) => this.change({ exposure }),
      view: (view) => this.change({ view }),
      zoom: (kind) => this.zoom(kind),
    });
    this.list = new JobList();
    this.strip = new Strip((frame) => this.selection.chooseFrame(frame));
    this.messages = new Messages(() => this.socket.hurry());
    this.probe = new Probe((probe, { x, y }) => {
      const { job, frame } = this.selection;
      this.socket.send({ type: 'probe', probe, job, frame, x, y });
    });
    this.probe.onclear = () => this.redraw();
    this.selection = new Selection({
      job: () => this.jobChosen(),
      frame: () => this.startWatch(),
      follow: () => this.redraw(),
    });
    this.login = new Login(() => this.enter());
    this.socket = new Socket(this.socketEvents());
    this.buttons();
  }

  async start() {
    const wish = permalink.parse(location.hash);
    this.take(wish);
    // The event's own address: the page may have written another one since.
    addEventListener('hashchange', ({ newURL }) => this.take(permalink.parse(new URL(newURL).hash)));
    if (wish.token) {
      // The token must not stay in the address bar, nor in the history.
      this.showAddress(true);
      await this.login.enter(wish.token);
      return;
    }
    try {
      if (await session()) this.enter();
      else this.login.show();
    } catch {
      this.login.show('the server cannot be reached', 'is karst-server running?');
    }
  }

  async enter() {
    this.login.hide();
    this.socket.open();
    const found = await session().catch(() => null);
    setText(get('server'), found?.server ?? '');
  }

  /** Follows a permalink. */
  take(wish) {
    const layer = this.wish.layer;
    if (wish.layer) this.wish.layer = wish.layer;
    const watch = this.watch.number;
    if (wish.job) this.selection.chooseJob(wish.job, wish.frame ?? null, wish.follow ?? wish.frame === undefined);
    if (layer !== this.wish.layer && watch === this.watch.number) this.startWatch();
    for (const name of ['exposure', 'view']) if (wish[name] !== undefined) this.wish[name] = wish[name];
    this.look();
  }

  socketEvents() {
    return {
      trying: () => this.messages.connection('trying'),
      open: () => {
        this.messages.connection('open');
        // A new connection knows nothing: everything is asked for again.
        if (this.selection.job) this.socket.send({ type: 'frames', job: this.selection.job });
        this.startWatch();
        this.probe.renew();
      },
      lost: (seconds) => this.messages.connection('lost', seconds),
      login: () => {
        this.messages.connection('closed');
        this.login.show('log in again', 'the session has ended');
      },
      message: (message) => this.message(message),
      tile: (tile) => this.tile(tile),
    };
  }

  message(message) {
    const ofWatch = message.watch === this.watch.number;
    if (message.type === 'jobs') this.jobs(message.jobs);
    else if (message.type === 'frames') this.frames(message);
    else if (message.type === 'frame' && ofWatch) this.frameKnown(message);
    else if (message.type === 'progress') this.progressed(message);
    else if (message.type === 'probe') this.probe.take((this.script.probe = message));
    else if (message.type === 'end' && ofWatch) this.ended = true;
    else if (message.type === 'error' && (ofWatch || message.watch == null)) this.messages.problem(message);
    this.redraw();
  }

  jobs(jobs) {
    this.selection.takeJobs(jobs);
    this.list.show(jobs, this.selection.job);
  }

  jobChosen() {
    this.strip.clear();
    // Another scene, another exposure: the one that was chosen for the last job means nothing here.
    if (this.watch.job) Object.assign(this.wish, { exposure: null, view: null });
    this.probe.clear();
    this.picture.clear();
    this.info = this.progress = this.script.firstTileAt = null;
    this.awaitFirst = false;
    this.list.show(this.selection.jobs, this.selection.job);
    this.messages.problem(null);
    this.socket.send({ type: 'unwatch' });
    this.socket.send({ type: 'frames', job: this.selection.job });
    get('app').classList.remove('jobs-open');
  }

  frames({ job, frames }) {
    if (job !== this.selection.job) return;
    this.selection.takeFrames(frames);
    this.strip.update(frames, this.selection.frames);
    this.strip.select(this.selection.frame);
  }

  /** Watches what is selected; does nothing when that is what is watched. */
  startWatch() {
    const { job, frame } = this.selection;
    this.strip.select(frame);
    if (!job || frame === null) return;
    const { layer } = this.wish;
    if (this.watch.job !== job || this.watch.frame !== frame) {
      this.progress = null;
      this.messages.problem(null);
      this.info = null;
      this.probe.renew();
    }
    this.ended = false;
    this.watch = { number: this.watch.number + 1, job, frame, layer, level: this.level() };
    this.socket.send({ type: 'watch', watch: this.watch.number, job, frame, layer, level: this.watch.level });
    this.begin = null;
    clearTimeout(this.holdTimer);
    this.holdTimer = setTimeout(() => this.release(), HOLD_MS);
    this.redraw();
  }

  /** The picture of another frame has stayed long enough, even if nothing of the new one has come. */
  release() {
    const { job, frame, layer } = this.watch;
    if (this.begin) this.begin();
    else if (this.picture.sheet && this.picture.sheet.key !== `${job} ${frame} ${layer}`) this.picture.clear();
    this.redraw();
  }

  /** The level at which elements are just not smaller than the screen's pixels. */
  level() {
    const { width, height } = this.stage.size;
    if (!width) return 0;
    const wanted = Math.floor(Math.log2(1 / this.stage.place.scale) + 1e-6);
    return Math.min(Math.max(wanted, this.picture.finest(width, height)), COARSEST);
  }

  frameKnown(message) {
    this.info = message;
    this.stage.setSize(message.width, message.height, message.window);
    if (this.level() !== this.watch.level) {
      // The size was not known when the watch began.
      this.startWatch();
      return;
    }
    const { job, frame, layer, level } = this.watch;
    const key = `${job} ${frame} ${layer}`;
    this.begin = () => {
      this.begin = null;
      this.picture.begin(key, message.window, level);
    };
    if (this.picture.sheet?.key === key) this.begin();
    this.look();
  }

  progressed(message) {
    if (message.job === this.selection.job && message.frame === this.selection.frame) this.progress = message;
  }

  tile(tile) {
    if (tile && tile.watch !== this.watch.number) return;
    if (tile && this.info) this.begin?.();
    if (!tile || !this.picture.put(tile)) {
      this.script.refused++;
      return;
    }
    this.script.tiles++;
    this.script.bytes += tile.rgb.byteLength;
    if (!this.script.firstTileAt && tile.rgb.some((half) => half & 0x7fff)) this.awaitFirst = true;
    const pin = this.probe.pinned;
    if (pin && pin.x >= tile.x0 && pin.x < tile.x1 && pin.y >= tile.y0 && pin.y < tile.y1) this.probe.renew();
    this.redraw();
  }

  /** What the controls change. */
  change(wish) {
    const layer = this.wish.layer;
    Object.assign(this.wish, wish);
    this.look();
    if (this.wish.layer !== layer) this.startWatch();
  }

  look() {
    this.shownLook = {
      exposure: this.wish.exposure ?? this.info?.exposure ?? 0,
      view: this.wish.view ?? this.info?.view ?? 'standard',
      layer: this.wish.layer,
    };
    this.controls.show(this.shownLook, this.wish.exposure !== null);
    this.redraw();
  }

  zoom(kind) {
    if (kind === 'fit') this.stage.fit();
    else if (kind === 'full') this.stage.zoomTo(1);
    else this.stage.zoomStep(kind === 'in' ? 1 : -1);
  }

  placed() {
    this.redraw();
    clearTimeout(this.levelTimer);
    this.levelTimer = setTimeout(() => {
      if (this.info && this.level() !== this.watch.level) this.startWatch();
    }, LEVEL_DELAY_MS);
  }

  hover(pixel) {
    this.hovered = pixel;
    this.redraw();
  }

  /** Draws once before the next screen refresh, however much has changed. */
  redraw() {
    if (this.changed) return;
    this.changed = true;
    requestAnimationFrame(() => {
      this.changed = false;
      this.draw();
    });
  }

  draw() {
    const { job, frame, frames, follow } = this.selection;
    const shown = this.picture.shown();
    const entry = frames.get(frame);
    this.picture.draw(this.stage.place, this.shownLook);
    this.script.draws++;
    if (this.awaitFirst && !this.script.firstTileAt) this.script.firstTileAt = Date.now() / 1000;
    const jobEntry = this.selection.jobs.find((each) => each.id === job);
    showStatus({ frame: entry, info: this.info, progress: this.progress, shown, ended: this.ended, step: this.picture.sheet?.step ?? 1 });
    this.messages.stage({ job: jobEntry, jobs: this.selection.jobs, wanted: job, frame: entry, shown, known: this.selection.known });
    this.controls.showZoom(this.stage.place.scale);
    setText(get('title-job'), jobEntry ? jobEntry.name || jobEntry.id : '');
    setText(get('title-frame'), frame === null ? '' : `frame ${frame}`);
    document.title = jobEntry ? `${jobEntry.name || job} – karst` : 'karst';
    get('strip').hidden = frames.size === 0;
    get('follow').setAttribute('aria-pressed', String(follow));
    this.probe.hover(this.hovered, this.hovered && this.picture.sample(this.hovered.x, this.hovered.y), this.wish.layer);
    this.mark();
    this.showAddress();
    get('picture').setAttribute('aria-label', `picture: frame ${frame ?? 'none'}, ${this.wish.layer}, ${get('label').textContent}`);
  }

  /** The frame around the probed pixel. */
  mark() {
    const [mark, pin] = [get('mark'), this.probe.pinned];
    mark.hidden = !pin;
    if (!pin) return;
    const box = this.stage.boxOf(pin);
    const size = Math.max(box.size, 9);
    const shift = (size - box.size) / 2;
    Object.assign(mark.style, {
      left: `${box.left - shift}px`, top: `${box.top - shift}px`, width: `${size}px`, height: `${size}px`,
    });
  }

  showAddress(now = false) {
    const fragment = permalink.write({ ...this.selection.link(), ...this.wish });
    if (now) permalink.replace(fragment);
    else permalink.show(fragment);
  }

  buttons() {
    const help = get('help');
    get('help-button').addEventListener('click', () => help.showModal());
    get('help-close').addEventListener('click', () => help.close());
    get('follow').addEventListener('click', () => this.selection.setFollow(!this.selection.follow));
    get('previous').addEventListener('click', () => this.selection.step(-1));
    get('next').addEventListener('click', () => this.selection.step(1));
    get('jobs-button').addEventListener('click', () => get('app').classList.toggle('jobs-open'));
    get('logout').addEventListener('click', async () => {
      this.socket.close();
      await logout().catch(() => null);
      this.login.show();
    });
    listen(this.actions(help), () => !get('app').hidden);
  }

  actions(help) {
    const expose = (step) => {
      if (this.wish.layer === 'Color') this.change({ exposure: Math.min(Math.max(this.shownLook.exposure + step, -64), 64) });
    };
    const next = (names, name) => names[(names.indexOf(name) + 1) % names.length];
    return {
      brighter: () => expose(EXPOSURE_STEP),
      darker: () => expose(-EXPOSURE_STEP),
      resetExposure: () => this.change({ exposure: null }),
      fit: () => this.zoom('fit'),
      full: () => this.zoom('full'),
      zoomIn: () => this.zoom('in'),
      zoomOut: () => this.zoom('out'),
      nextLayer: () => this.change({ layer: next(permalink.LAYERS, this.wish.layer) }),
      nextView: () => this.change({ view: next(permalink.VIEWS, this.shownLook.view) }),
      follow: () => this.selection.setFollow(!this.selection.follow),
      previousFrame: () => this.selection.step(-1),
      nextFrame: () => this.selection.step(1),
      firstFrame: () => this.selection.step(-Infinity),
      lastFrame: () => this.selection.step(Infinity),
      help: () => help.showModal(),
      escape: () => {
        this.probe.clear();
        get('app').classList.remove('jobs-open');
      },
    };
  }

  /** The state as scripts read it. */
  describe() {
    const { job, frame, follow, frames } = this.selection;
    return {
      job, frame, follow, frameState: frames.get(frame)?.state ?? null, info: this.info, ended: this.ended,
      watch: { ...this.watch }, look: { ...this.shownLook }, place: { ...this.stage.place }, shown: this.picture.shown(),
      canvas: { width: this.picture.canvas.width, height: this.picture.canvas.height },
    };
  }
}

try {
  new Page().start();
} catch (error) {
  get('login').hidden = true;
  get('app').hidden = true;
  get('unfit').hidden = false;
  setText(get('unfit-reason'), error.message);
}
