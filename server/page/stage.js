// Owns where the picture lies on the screen: fit, zoom and pan, and which pixel the pointer means.

const LARGEST_SCALE = 64;
const MARGIN = 12;
const CLICK_SLOP = 4;
const HOLD_MS = 350;

/** Maps pixels of the frame to device pixels of the canvas. `place` is {x, y, scale}. */
export class Stage {
  /** `on`: placed(), hover(pixel or null), pick(pixel), where a pixel is {x, y} of the frame. */
  constructor(canvas, on) {
    this.canvas = canvas;
    this.on = on;
    this.size = { width: 0, height: 0 };
    /** The pixels of the frame that are rendered. */
    this.window = null;
    this.place = { x: 0, y: 0, scale: 1 };
    this.fitted = true;
    /** Where the pointer hovers, if it does. */
    this.pointer = null;
    this.pointers = new Map();
    this.gesture = null;
    this.observe();
    this.listen();
  }

  /** Device pixels per CSS pixel. */
  get density() {
    return this.canvas.width / Math.max(this.canvas.clientWidth, 1);
  }

  observe() {
    const observer = new ResizeObserver(([entry]) => {
      const exact = entry.devicePixelContentBoxSize?.[0];
      this.canvas.width = exact?.inlineSize ?? Math.round(entry.contentRect.width * devicePixelRatio);
      this.canvas.height = exact?.blockSize ?? Math.round(entry.contentRect.height * devicePixelRatio);
      if (this.fitted) this.fit();
      else this.move(this.place.x, this.place.y, this.place.scale);
    });
    try {
      observer.observe(this.canvas, { box: 'device-pixel-content-box' });
    } catch {
      observer.observe(this.canvas);
    }
  }

  /** A frame of another shape is fitted; one of the same shape stays where the last one was. */
  setSize(width, height, window) {
    const same = width === this.size.width && height === this.size.height && String(window) === String(this.window);
    if (same) return;
    this.size = { width, height };
    this.window = window;
    this.fit();
  }

  /** All that is rendered; enlarged only by whole numbers, so that every pixel stays a square. */
  fit() {
    if (!this.window || !this.canvas.width) return;
    const [x0, y0, x1, y1] = this.window;
    const [width, height] = [x1 - x0, y1 - y0];
    this.fitted = true;
    const free = MARGIN * 2 * this.density;
    const most = Math.min((this.canvas.width - free) / width, (this.canvas.height - free) / height);
    const scale = most >= 1 ? Math.min(Math.floor(most), LARGEST_SCALE) : Math.max(most, 0.01);
    this.move((this.canvas.width - (x0 + x1) * scale) / 2, (this.canvas.height - (y0 + y1) * scale) / 2, scale);
  }

  /** Zooms so that a point of the canvas (device pixels; by default the pointer's, or the middle) stays where it is. */
  zoomTo(scale, point = this.pointer ?? { x: this.canvas.width / 2, y: this.canvas.height / 2 }) {
    if (!this.size.width) return;
    this.fitted = false;
    const next = Math.min(Math.max(scale, 0.01), LARGEST_SCALE);
    const factor = next / this.place.scale;
    this.move(point.x - (point.x - this.place.x) * factor, point.y - (point.y - this.place.y) * factor, next);
  }

  /** One notch of the zoom keys: the next power of the square root of two. */
  zoomStep(direction) {
    const notch = 2 * Math.log2(this.place.scale);
    const next = direction > 0 ? Math.floor(notch + 1.001) : Math.ceil(notch - 1.001);
    this.zoomTo(2 ** (next / 2));
  }

  move(x, y, scale) {
    const { width, height } = this.size;
    // At least a corner stays in view, and pixels stay aligned to the screen's.
    const keep = 48 * this.density;
    const clamp = (value, extent, room) => Math.min(Math.max(value, keep - extent * scale), room - keep);
    this.place = {
      x: Math.round(clamp(x, width, this.canvas.width)),
      y: Math.round(clamp(y, height, this.canvas.height)),
      scale,
    };
    this.on.placed();
  }

  /** The pixel of the frame under a point of the canvas in device pixels; null outside. */
  pixelAt(point) {
    const x = Math.floor((point.x - this.place.x) / this.place.scale);
    const y = Math.floor((point.y - this.place.y) / this.place.scale);
    return x >= 0 && y >= 0 && x < this.size.width && y < this.size.height ? { x, y } : null;
  }

  /** Where a pixel is on the canvas, in CSS pixels. */
  boxOf(pixel) {
    const unit = this.place.scale / this.density;
    return { left: this.place.x / this.density + pixel.x * unit, top: this.place.y / this.density + pixel.y * unit, size: unit };
  }

  pointOf(event) {
    const box = this.canvas.getBoundingClientRect();
    return { x: (event.clientX - box.left) * this.density, y: (event.clientY - box.top) * this.density };
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener('wheel', (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 30 : 1;
      this.zoomTo(this.place.scale * 2 ** (-event.deltaY * lines * (event.ctrlKey ? 0.01 : 0.002)), this.pointOf(event));
    }, { passive: false });
    canvas.addEventListener('pointerdown', (event) => this.down(event));
    canvas.addEventListener('pointermove', (event) => this.moved(event));
    canvas.addEventListener('pointerup', (event) => this.up(event));
    canvas.addEventListener('pointercancel', (event) => this.up(event, true));
    canvas.addEventListener('pointerleave', () => {
      this.pointer = null;
      this.on.hover(null);
    });
  }

  down(event) {
    if (event.button !== 0 && event.button !== 1) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, this.pointOf(event));
    clearTimeout(this.gesture?.timer);
    if (this.pointers.size === 2) {
      this.gesture = { kind: 'pinch', ...this.spread(), scale: this.place.scale };
      return;
    }
    const gesture = { kind: 'press', from: this.pointOf(event), place: this.place, timer: 0 };
    // Holding still turns the drag into a probe that goes along with the pointer.
    gesture.timer = setTimeout(() => {
      gesture.kind = 'probe';
      this.pick(gesture.from);
    }, HOLD_MS);
    this.gesture = gesture;
  }

  moved(event) {
    const point = this.pointOf(event);
    this.pointer = point;
    this.on.hover(this.pixelAt(point));
    if (!this.pointers.has(event.pointerId)) return;
    this.pointers.set(event.pointerId, point);
    const gesture = this.gesture;
    if (gesture?.kind === 'pinch') {
      const now = this.spread();
      this.zoomTo((gesture.scale * now.distance) / Math.max(gesture.distance, 1), now.middle);
    } else if (gesture?.kind === 'probe') {
      this.pick(point);
    } else if (gesture) {
      const [dx, dy] = [point.x - gesture.from.x, point.y - gesture.from.y];
      if (gesture.kind === 'press' && Math.hypot(dx, dy) < CLICK_SLOP * this.density) return;
      clearTimeout(gesture.timer);
      gesture.kind = 'drag';
      this.canvas.classList.add('dragging');
      this.fitted = false;
      this.move(gesture.place.x + dx, gesture.place.y + dy, this.place.scale);
    }
  }

  up(event, cancelled = false) {
    const gesture = this.gesture;
    this.pointers.delete(event.pointerId);
    clearTimeout(gesture?.timer);
    this.canvas.classList.remove('dragging');
    if (gesture?.kind === 'press' && !cancelled) this.pick(gesture.from);
    this.gesture = null;
  }

  pick(point) {
    const pixel = this.pixelAt(point);
    if (pixel) this.on.pick(pixel);
  }

  /** Middle and distance of two fingers. */
  spread() {
    const [a, b] = [...this.pointers.values()];
    return { middle: { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 }, distance: Math.hypot(a.x - b.x, a.y - b.y) };
  }
}
