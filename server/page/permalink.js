// What the address bar says: which frame of which job is seen, and how.

export const LAYERS = ['Color', 'Albedo', 'Normal'];
export const VIEWS = ['standard', 'filmic', 'false'];
export const EXPOSURE_LIMIT = 64;

/** What a fragment asks for; whatever makes no sense is left out. */
export function parse(fragment) {
  const fields = new URLSearchParams(fragment.replace(/^#/, ''));
  const number = (name) => (fields.has(name) && fields.get(name).trim() !== '' ? Number(fields.get(name)) : NaN);
  const wish = {};
  if (fields.get('token')) wish.token = fields.get('token');
  if (/^[a-z0-9-]{1,64}$/i.test(fields.get('job') ?? '')) wish.job = fields.get('job');
  if (Number.isInteger(number('frame'))) wish.frame = number('frame');
  if (LAYERS.includes(fields.get('layer'))) wish.layer = fields.get('layer');
  if (VIEWS.includes(fields.get('view'))) wish.view = fields.get('view');
  if (Math.abs(number('exposure')) <= EXPOSURE_LIMIT) wish.exposure = number('exposure');
  if (fields.has('follow')) wish.follow = fields.get('follow') === 'jobs' ? 'jobs' : fields.get('follow') === '1';
  return wish;
}

/** The fragment for what is seen. Exposure and view only where they are not the scene's own. */
export function write({ job, frame, layer, exposure, view, follow }) {
  const fields = new URLSearchParams();
  if (job) fields.set('job', job);
  if (job && frame !== null) fields.set('frame', frame);
  if (job && follow) fields.set('follow', follow === 'jobs' ? 'jobs' : '1');
  if (layer !== 'Color') fields.set('layer', layer);
  if (exposure !== null) fields.set('exposure', Number(exposure.toFixed(3)));
  if (view !== null) fields.set('view', view);
  return fields.size > 0 ? `#${fields}` : '';
}

let latest = '';
let timer = 0;

/** Shows a fragment in the address bar without a new entry in the history; a few times a second, as browsers demand. */
export function show(fragment) {
  if (fragment === latest) return;
  latest = fragment;
  timer ||= setTimeout(() => {
    timer = 0;
    replace(latest);
  }, 200);
}

/** The same at once. */
export function replace(fragment) {
  latest = fragment;
  if (location.hash !== fragment) history.replaceState(null, '', location.pathname + location.search + fragment);
}
