// The controls above the picture: layer, exposure, view transform, zoom.

import { get, make, setText } from './dom.js';
import { stops } from './format.js';
import { EXPOSURE_LIMIT, LAYERS, VIEWS } from './permalink.js';
import { BANDS } from './shader.js';

const SLIDER_LIMIT = 10;

export class Controls {
  /** `on`: layer(name), exposure(stops or null for the scene's), view(name), zoom('in' | 'out' | 'full' | 'fit'). */
  constructor(on) {
    this.slider = get('exposure');
    this.number = get('exposure-number');
    this.view = get('view');
    this.layers = Object.fromEntries(LAYERS.map((name) => [name, get(`layer-${name}`)]));
    this.slider.addEventListener('input', () => on.exposure(Number(this.slider.value)));
    this.number.addEventListener('input', () => {
      const value = this.number.valueAsNumber;
      if (Math.abs(value) <= EXPOSURE_LIMIT) on.exposure(value);
    });
    this.number.addEventListener('keydown', (event) => {
      if (event.key === 'Enter' || event.key === 'Escape') this.number.blur();
    });
    get('exposure-reset').addEventListener('click', () => on.exposure(null));
    this.view.addEventListener('change', () => on.view(this.view.value));
    for (const name of LAYERS) this.layers[name].addEventListener('change', () => on.layer(name));
    for (const zoom of ['in', 'out', 'full', 'fit']) get(`zoom-${zoom}`).addEventListener('click', () => on.zoom(zoom));
    legend();
  }

  /** Shows `look` {exposure, view, layer}, and whether exposure is the scene's own. */
  show(look, ownExposure) {
    const inSlider = Math.min(Math.max(look.exposure, -SLIDER_LIMIT), SLIDER_LIMIT);
    this.slider.value = inSlider;
    this.slider.setAttribute('aria-valuetext', `${stops(look.exposure)} stops`);
    if (document.activeElement !== this.number) this.number.value = Number(look.exposure.toFixed(3));
    get('exposure-reset').disabled = !ownExposure;
    this.view.value = VIEWS.includes(look.view) ? look.view : 'standard';
    this.layers[look.layer].checked = true;
    // Albedo is a reflectance and a normal a direction: both are shown as they are.
    const color = look.layer === 'Color';
    for (const control of [this.slider, this.number, this.view]) control.disabled = !color;
    get('exposure-group').classList.toggle('off', !color);
    get('legend').hidden = !(color && look.view === 'false');
  }

  showZoom(scale) {
    setText(get('zoom-value'), `${scale < 0.0995 ? (scale * 100).toFixed(1) : Math.round(scale * 100)} %`);
  }
}

/** The colours of the false-colour view; texts in stops from middle grey. */
function legend() {
  const cells = BANDS.map((hex, i) => {
    const cell = make('span', {}, i === 7 ? '0' : stops(i - 7));
    cell.style.backgroundColor = hex;
    cell.classList.toggle('light', [6, 7, 8, 9, 10, 11, 13].includes(i));
    return cell;
  });
  get('legend').replaceChildren(...cells);
}
