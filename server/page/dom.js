// Small helpers to find, build and change elements.

/** The element with this id; a missing one is a mistake in index.html. */
export function get(id) {
  const found = document.getElementById(id);
  if (!found) throw new Error(`index.html has no #${id}`);
  return found;
}

/** Sets a text only where it differs: the browser need not lay out again, nor a screen reader speak again. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** A new element. Texts go in as texts, never as HTML. */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name === 'class') element.className = value;
    else if (name in element) element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}
