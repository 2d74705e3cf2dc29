// Owns the pixels: half-float tiles in a texture (and a copy in memory), and drawing them with WebGL2.

import { HALF } from './format.js';
import { BANDS, FRAGMENT, VERTEX, roundingPoints } from './shader.js';

const UNIFORMS = [
  'uOffset', 'uScale', 'uHeight', 'uWindow', 'uPicture', 'uGrid', 'uSmooth', 'uOld', 'uOldGrid', 'uSteps', 'uGain',
  'uView', 'uLayer', 'uBands',
];
const ONE = 0x3c00;

/** Elements that one picture may have: 8 bytes each in memory and again on the graphics card. */
const MOST_ELEMENTS = 1 << 25;

/** Beyond this many changed tiles everything is drawn again. */
const MOST_REGIONS = 256;

/** Coarsest level that is used: tiles are multiples of 16 pixels, so elements of 16 never straddle two. */
export const COARSEST = 4;

/** Draws one frame of one layer, of which tiles arrive in any order. */
export class Picture {
  constructor(canvas) {
    this.canvas = canvas;
    this.sheet = null;
    this.old = null;
    this.broken = false;
    /** Regions of the frame that changed since they were drawn, and how everything else was drawn. */
    this.changed = [];
    this.painted = '';
    this.start();
    canvas.addEventListener('webglcontextlost', (event) => {
      event.preventDefault();
      this.broken = true;
    });
    canvas.addEventListener('webglcontextrestored', () => {
      this.broken = false;
      this.start();
      for (const sheet of [this.sheet, this.old]) if (sheet) this.upload(sheet);
      this.onrestored?.();
    });
  }

  start() {
    // What was drawn stays, so that a new tile costs only its own pixels: without a graphics card that matters.
    const gl = this.canvas.getContext('webgl2', { antialias: false, depth: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error('this browser has no WebGL2');
    this.gl = gl;
    this.painted = '';
    this.program = compile(gl);
    gl.useProgram(this.program);
    this.at = Object.fromEntries(UNIFORMS.map((name) => [name, gl.getUniformLocation(this.program, name)]));
    gl.bindVertexArray(gl.createVertexArray());
    this.largest = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 2);
    this.steps = texture(gl, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, 255, 1, 0, gl.RED, gl.FLOAT, roundingPoints());
    this.nothing = texture(gl, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    gl.uniform3fv(this.at.uBands, BANDS.flatMap((hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255)));
  }

  /** The finest level at which a frame of this size fits. */
  finest(width, height) {
    for (let level = 0; level < COARSEST; level++) {
      const [columns, rows] = [Math.ceil(width / 2 ** level), Math.ceil(height / 2 ** level)];
      if (Math.max(columns, rows) <= this.largest && columns * rows <= MOST_ELEMENTS) return level;
    }
    return COARSEST;
  }

  /** Starts an empty picture. `key` names frame and layer: the same picture at another level stays until replaced. */
  begin(key, window, level) {
    if (this.sheet && this.sheet.key === key) {
      // A fresh sheet without tiles has nothing to keep; what lies under it may have.
      const keep = this.sheet.tiles.size > 0 ? this.sheet : this.old;
      const drop = keep === this.sheet ? this.old : this.sheet;
      if (drop) this.gl.deleteTexture(drop.texture);
      this.old = keep;
    } else {
      for (const sheet of [this.sheet, this.old]) if (sheet) this.gl.deleteTexture(sheet.texture);
      this.old = null;
    }
    this.sheet = newSheet(key, window, level);
    this.upload(this.sheet);
    this.painted = '';
  }

  clear() {
    for (const sheet of [this.sheet, this.old]) if (sheet) this.gl.deleteTexture(sheet.texture);
    this.sheet = this.old = null;
    this.painted = '';
  }

  /** Puts a tile into the picture; false when it does not fit what was announced. */
  put(tile) {
    const sheet = this.sheet;
    if (!sheet || !fits(tile, sheet)) return false;
    const { columns, rows, rgb } = tile;
    const rgba = new Uint16Array(columns * rows * 4);
    for (let i = 0, o = 0; i < rgb.length; i += 3, o += 4) {
      rgba[o] = rgb[i];
      rgba[o + 1] = rgb[i + 1];
      rgba[o + 2] = rgb[i + 2];
      rgba[o + 3] = ONE;
    }
    const x = Math.floor(tile.x0 / sheet.step) - sheet.x;
    const y = Math.floor(tile.y0 / sheet.step) - sheet.y;
    for (let row = 0; row < rows; row++) {
      sheet.elements.set(rgba.subarray(row * columns * 4, (row + 1) * columns * 4), ((y + row) * sheet.columns + x) * 4);
    }
    sheet.tiles.set(`${tile.x0} ${tile.y0}`, { spp: tile.spp, area: (tile.x1 - tile.x0) * (tile.y1 - tile.y0) });
    this.changed.push({ x0: tile.x0, y0: tile.y0, x1: tile.x1, y1: tile.y1 });
    // A tab that nobody sees is not drawn: what has changed must not grow meanwhile.
    if (this.changed.length > MOST_REGIONS) {
      this.changed = [];
      this.painted = '';
    }
    if (this.old && this.shown().covered >= 1) {
      this.gl.deleteTexture(this.old.texture);
      this.old = null;
    }
    if (!this.broken) {
      const gl = this.gl;
      gl.bindTexture(gl.TEXTURE_2D, sheet.texture);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, x, y, columns, rows, gl.RGBA, gl.HALF_FLOAT, rgba);
    }
    return true;
  }

  upload(sheet) {
    const gl = this.gl;
    sheet.texture = texture(gl, gl.LINEAR);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA16F, sheet.columns, sheet.rows);
    if (sheet.tiles.size === 0) return; // texStorage2D gives zeros
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, sheet.columns, sheet.rows, gl.RGBA, gl.HALF_FLOAT, sheet.elements);
  }

  /** Linear values at a pixel of the frame, as they were sent; null where nothing is known. */
  sample(x, y) {
    for (const sheet of [this.sheet, this.old]) {
      if (!sheet) continue;
      const [x0, y0, x1, y1] = sheet.window;
      if (x < x0 || y < y0 || x >= x1 || y >= y1) return null;
      const column = Math.floor(x / sheet.step) - sheet.x;
      const row = Math.floor(y / sheet.step) - sheet.y;
      const at = (row * sheet.columns + column) * 4;
      if (sheet.elements[at + 3] === 0) continue;
      return { values: [0, 1, 2].map((channel) => HALF[sheet.elements[at + channel]]), step: sheet.step };
    }
    return null;
  }

  /** Mean samples per pixel of the tiles that are shown, and the part of the window they cover. */
  shown() {
    let [area, samples] = [0, 0];
    for (const tile of this.sheet?.tiles.values() ?? []) {
      area += tile.area;
      samples += tile.area * tile.spp;
    }
    const [x0, y0, x1, y1] = this.sheet?.window ?? [0, 0, 1, 1];
    return { spp: area > 0 ? samples / area : 0, covered: area / ((x1 - x0) * (y1 - y0)) };
  }

  /** Draws what changed, with `place` {x, y, scale} in device pixels and `look` {exposure, view, layer}. */
  draw(place, look) {
    if (this.broken) return;
    const { gl, canvas, sheet } = this;
    const how = JSON.stringify([place, look, canvas.width, canvas.height]);
    const whole = how !== this.painted;
    if (!whole && this.changed.length === 0) return;
    this.painted = how;
    const regions = this.changed;
    this.changed = [];
    if (whole) {
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.disable(gl.SCISSOR_TEST);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT);
    }
    if (!sheet) return;
    this.prepare(place, look);
    gl.enable(gl.SCISSOR_TEST);
    const [x0, y0, x1, y1] = sheet.window;
    for (const region of whole ? [{ x0, y0, x1, y1 }] : regions) this.paint(region, place);
  }

  /** Draws a region of the frame, and as much around it as a smooth picture mixes in. */
  paint(region, { x, y, scale }) {
    const { gl, canvas } = this;
    const more = 1 + Math.ceil(2 * this.sheet.step * Math.min(scale, 1));
    const left = Math.max(Math.floor(x + region.x0 * scale) - more, 0);
    const top = Math.max(Math.floor(y + region.y0 * scale) - more, 0);
    const right = Math.min(Math.ceil(x + region.x1 * scale) + more, canvas.width);
    const bottom = Math.min(Math.ceil(y + region.y1 * scale) + more, canvas.height);
    if (right <= left || bottom <= top) return;
    gl.scissor(left, canvas.height - bottom, right - left, bottom - top);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  prepare(place, look) {
    const { gl, at, sheet, old, canvas } = this;
    this.bind(0, at.uPicture, sheet.texture);
    this.bind(1, at.uOld, old ? old.texture : this.nothing);
    this.bind(2, at.uSteps, this.steps);
    gl.activeTexture(gl.TEXTURE0);
    gl.uniform3f(at.uGrid, sheet.step, sheet.x, sheet.y);
    gl.uniform3f(at.uOldGrid, old?.step ?? 1, old?.x ?? 0, old?.y ?? 0);
    gl.uniform1i(at.uSmooth, place.scale * sheet.step < 1 ? 1 : 0);
    gl.uniform2f(at.uOffset, place.x, place.y);
    gl.uniform1f(at.uScale, place.scale);
    gl.uniform1f(at.uHeight, canvas.height);
    gl.uniform4f(at.uWindow, ...sheet.window);
    gl.uniform1f(at.uGain, Math.fround(2 ** look.exposure));
    gl.uniform1i(at.uView, Math.max(['standard', 'filmic', 'false'].indexOf(look.view), 0));
    gl.uniform1i(at.uLayer, Math.max(['Color', 'Albedo', 'Normal'].indexOf(look.layer), 0));
  }

  bind(unit, uniform, name) {
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(this.gl.TEXTURE_2D, name);
    this.gl.uniform1i(uniform, unit);
  }
}

function newSheet(key, window, level) {
  const step = 2 ** level;
  const [x, y] = [Math.floor(window[0] / step), Math.floor(window[1] / step)];
  const [columns, rows] = [Math.ceil(window[2] / step) - x, Math.ceil(window[3] / step) - y];
  return { key, window, level, step, x, y, columns, rows, elements: new Uint16Array(columns * rows * 4), tiles: new Map() };
}

function fits(tile, sheet) {
  const [x0, y0, x1, y1] = sheet.window;
  return tile.x0 >= x0 && tile.y0 >= y0 && tile.x1 <= x1 && tile.y1 <= y1 && tile.x0 < tile.x1 && tile.y0 < tile.y1 &&
    tile.columns === Math.ceil((tile.x1 - tile.x0) / sheet.step) &&
    tile.rows === Math.ceil((tile.y1 - tile.y0) / sheet.step);
}

function texture(gl, filter) {
  const name = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, name);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, filter);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, filter);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  return name;
}

function compile(gl) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(`shader: ${gl.getShaderInfoLog(shader)}`);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(`shader: ${gl.getProgramInfoLog(program)}`);
  return program;
}
