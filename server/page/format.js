// How figures look on the page: half floats as numbers, and numbers as short texts for people.

/** Every half float as a number; index it with the 16 bits. */
export const HALF = new Float32Array(65536).map((_, bits) => decodeHalf(bits));

function decodeHalf(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  return sign * (1024 + fraction) * 2 ** (exponent - 25);
}

/** A number that the server sent, digit by digit: what it sends is already the shortest text of its 32-bit float. */
export function exact(value) {
  if (value === null || value === undefined) return 'not finite';
  return Object.is(value, -0) ? '-0' : String(value);
}

/** A half float has eleven bits: more than four digits would be invented. */
export function rough(value) {
  if (!Number.isFinite(value)) return Number.isNaN(value) ? 'NaN' : value > 0 ? 'inf' : '-inf';
  if (value === 0) return '0';
  const size = Math.abs(value);
  return size < 0.001 || size >= 100000 ? value.toExponential(3) : value.toPrecision(4);
}

/** Samples per pixel: whole where it is whole. */
export function spp(value) {
  if (!Number.isFinite(value)) return '–';
  return value >= 100 || Math.abs(value - Math.round(value)) < 0.005
    ? Math.round(value).toLocaleString('en')
    : value.toFixed(1);
}

/** relMSE as people compare it: its root as a percentage, as the command line prints it. */
export function errorPercent(relMse) {
  return Number.isFinite(relMse) && relMse >= 0 ? percent(Math.sqrt(relMse)) : 'not known yet';
}

/** A fraction as a percentage. */
export function percent(fraction) {
  return `${(fraction * 100).toFixed(fraction < 0.001 ? 3 : 2)} %`;
}

/** A rate or a count with a unit prefix: 3.21 M. */
export function count(value) {
  if (!Number.isFinite(value)) return '–';
  for (const [size, unit] of [[1e12, 'T'], [1e9, 'G'], [1e6, 'M'], [1e3, 'k']]) {
    if (value >= size) return `${(value / size).toPrecision(3)} ${unit}`;
  }
  return value < 10 ? value.toPrecision(2) : value.toFixed(0);
}

/** Seconds as a length of time, two units at most. */
export function duration(seconds) {
  if (!Number.isFinite(seconds) || seconds < 0) return '–';
  if (seconds < 9.95) return `${seconds.toFixed(1)} s`;
  if (seconds < 59.5) return `${Math.round(seconds)} s`;
  const minutes = Math.floor(Math.round(seconds) / 60);
  if (minutes < 60) return `${minutes} min ${Math.round(seconds) % 60} s`;
  const hours = Math.floor(minutes / 60);
  if (hours < 48) return `${hours} h ${minutes % 60} min`;
  return `${Math.floor(hours / 24)} d ${hours % 24} h`;
}

/** How long ago a Unix time was, as a label that need not be renewed often. */
export function ago(unixSeconds, now = Date.now() / 1000) {
  const seconds = now - unixSeconds;
  if (!Number.isFinite(seconds)) return '';
  if (seconds < 60) return 'just now';
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ago`;
  if (seconds < 86400) return `${Math.floor(seconds / 3600)} h ago`;
  return `${Math.floor(seconds / 86400)} d ago`;
}

/** Stops with a sign, as on a camera. */
export function stops(value) {
  const text = Math.abs(value).toFixed(2).replace(/\.?0+$/, '');
  return text === '0' ? '0' : `${value < 0 ? '−' : '+'}${text}`;
}
