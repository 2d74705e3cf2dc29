// The words and figures about the frame that is seen: what it is, how good it is, how long it will take.

import { get, setText } from './dom.js';
import { count, duration, errorPercent, percent, spp } from './format.js';
import { stateWord } from './strip.js';

/** What the picture on screen honestly is: its samples, whether it will still change, and that nothing smoothed it. */
export function label({ frame, info, shown, ended, step }) {
  if (!info || !frame) return '';
  const parts = [];
  const goal = info.spp_goal;
  const finished = frame.state === 'Finished';
  if (shown.spp > 0 && goal && !finished) parts.push(`${spp(shown.spp)} of ${spp(goal)} spp`);
  else if (shown.spp > 0) parts.push(`${spp(shown.spp)} spp`);
  if (finished) parts.push(ended ? 'finished' : 'finished, loading');
  else if (frame.state === 'Failed') parts.push('stopped by an error');
  else if (frame.state === 'Cancelled') parts.push('cancelled');
  else if (shown.spp > 0) parts.push('preview');
  else parts.push(stateWord(frame.state));
  if (shown.spp > 0) parts.push('not denoised');
  if (shown.spp > 0 && step > 1) parts.push(`means of ${step}×${step} pixels`);
  return parts.join(', ');
}

/** Fills the panel and the bar under the picture from `seen` {frame, info, progress, shown, ended, step}. */
export function showStatus(seen) {
  const { frame, info, progress, shown } = seen;
  setText(get('label'), label(seen));
  const running = frame && ['Rendering', 'Finishing'].includes(frame.state);
  const done = part(seen);
  const bar = get('bar');
  bar.hidden = !running;
  if (done !== null) bar.value = done;
  else bar.removeAttribute('value');
  const lively = running && progress ? progress : null;
  setText(get('percent'), running && done !== null ? `${Math.floor(done * 100)} %` : '');
  setText(get('speed'), lively ? `${count(lively.samples_per_second)} samples/s` : '');
  const left = lively?.seconds_left;
  setText(get('left'), Number.isFinite(left) ? `${duration(left)} left` : '');
  const error = lively?.rel_mse ?? frame?.rel_mse;
  const target = info?.target_error;
  const rows = {
    state: frame ? stateWord(frame.state) : '–',
    spp: shown.spp > 0 ? `${spp(shown.spp)}${info?.spp_goal && frame?.state !== 'Finished' ? ` of ${spp(info.spp_goal)}` : ''} spp` : '–',
    error: frame && (frame.rounds > 0 || lively) ? errorPercent(error ?? NaN) : '–',
    target: target ? percent(target) : 'none',
    rounds: frame ? String(frame.rounds ?? 0) : '–',
    time: frame?.seconds > 0 ? duration(frame.seconds) : '–',
    size: info ? sizeText(info) : '–',
  };
  for (const [name, text] of Object.entries(rows)) setText(get(`fact-${name}`), text);
  get('fact-error').classList.toggle('reached', Boolean(target && Number.isFinite(error) && error <= target * target));
}

/** The part of the planned samples that is done, from 0 to 1. */
function part({ frame, progress }) {
  if (frame?.state === 'Finishing') return 1;
  if (!progress || !(progress.samples_planned > 0)) return null;
  return Math.min(progress.samples_done / progress.samples_planned, 1);
}

function sizeText({ width, height, window: [x0, y0, x1, y1] }) {
  const whole = x0 === 0 && y0 === 0 && x1 === width && y1 === height;
  return whole ? `${width} × ${height}` : `${x1 - x0} × ${y1 - y0} of ${width} × ${height}`;
}
