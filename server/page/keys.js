// Keys: one letter each, never with Ctrl, Alt or Meta, and never while somebody writes into a field.

/** Key (with Shift where it matters) and the action it runs. */
const ACTIONS = {
  e: 'brighter', E: 'darker', 0: 'resetExposure', f: 'fit', F: 'fit', 1: 'full', '+': 'zoomIn', '=': 'zoomIn',
  '-': 'zoomOut', _: 'zoomOut', l: 'nextLayer', L: 'nextLayer', v: 'nextView', V: 'nextView', ' ': 'follow',
  ArrowLeft: 'previousFrame', ArrowRight: 'nextFrame', Home: 'firstFrame', End: 'lastFrame', '?': 'help',
  Escape: 'escape',
};

/** Whether a key belongs to the element that has the focus. */
function taken(target, key) {
  if (target.closest('dialog')) return true;
  if (target.matches('input[type=range], input[type=radio], select')) return /^(Arrow|Home|End| |Escape)/.test(key);
  if (target.matches('input, textarea')) return true;
  return target.matches('button, a') && (key === ' ' || key === 'Enter');
}

/** Calls `actions.NAME()` for the keys of the table. */
export function listen(actions, enabled) {
  addEventListener('keydown', (event) => {
    if (!enabled() || event.ctrlKey || event.altKey || event.metaKey || taken(event.target, event.key)) return;
    const action = ACTIONS[event.key];
    if (!action) return;
    event.preventDefault();
    actions[action]();
  });
}
