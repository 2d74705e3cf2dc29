// Owns the connection to the server: login, the WebSocket, and coming back after it breaks.

const SUBPROTOCOL = 'karst.page.v1';
const LOGIN_AGAIN = 4401;
const HEADER_BYTES = 32;

/** Exchanges a token for a session cookie; throws an error with a `hint` where the server gave one. */
export async function login(token) {
  const answer = await fetch('/api/login', {
    method: 'POST',
    headers: { 'X-Karst': '1', 'Content-Type': 'text/plain' },
    body: token,
  });
  if (answer.ok) return;
  const { error, hint } = await answer.json().catch(() => ({}));
  throw Object.assign(new Error(error ?? `the server answered ${answer.status}`), { hint });
}

export async function logout() {
  await fetch('/api/logout', { method: 'POST', headers: { 'X-Karst': '1' } });
}

/** Server and role of the session, or null without one. Throws where the server cannot be reached. */
export async function session() {
  const answer = await fetch('/api/session');
  if (answer.status === 401) return null;
  if (!answer.ok) throw new Error(`the server answered ${answer.status}`);
  return answer.json();
}

/** A tile of the binary protocol, or null when the message is not one. */
export function parseTile(buffer) {
  if (buffer.byteLength < HEADER_BYTES) return null;
  const header = new DataView(buffer);
  const [watch, x0, y0, x1, y1, columns, rows] = Array.from({ length: 7 }, (_, i) => header.getUint32(4 * i, true));
  if (buffer.byteLength !== HEADER_BYTES + columns * rows * 6) return null;
  // The halves are little endian, as is every machine that has a browser.
  const rgb = new Uint16Array(buffer, HEADER_BYTES);
  return { watch, x0, y0, x1, y1, columns, rows, spp: header.getFloat32(28, true), rgb };
}

/**
 * A WebSocket that comes back. Calls `on.open()`, `on.message(object)`, `on.tile(tile)`, `on.lost(secondsToNextTry)`,
 * `on.trying()` and `on.login()`.
 */
export class Socket {
  constructor(on) {
    this.on = on;
    this.failures = 0;
    this.timer = 0;
    this.wanted = false;
    this.web = null;
    addEventListener('online', () => this.hurry());
    document.addEventListener('visibilitychange', () => document.hidden || this.hurry());
  }

  open() {
    this.wanted = true;
    this.failures = 0;
    this.connect();
  }

  close() {
    this.wanted = false;
    clearTimeout(this.timer);
    this.web?.close(1000);
    this.web = null;
  }

  /** Sends when there is a connection; whoever wants something says it again in `on.open`. */
  send(message) {
    if (this.web?.readyState === WebSocket.OPEN) this.web.send(JSON.stringify(message));
  }

  /** Does not wait for the next try. */
  hurry() {
    if (!this.wanted || this.web) return;
    clearTimeout(this.timer);
    this.connect();
  }

  connect() {
    clearTimeout(this.timer);
    this.on.trying();
    const web = new WebSocket(`${location.protocol === 'https:' ? 'wss:' : 'ws:'}//${location.host}/api/socket`, SUBPROTOCOL);
    web.binaryType = 'arraybuffer';
    this.web = web;
    web.onopen = () => {
      this.failures = 0;
      this.on.open();
    };
    web.onmessage = ({ data }) => {
      if (this.web !== web) return;
      if (typeof data === 'string') this.on.message(JSON.parse(data));
      else this.on.tile(parseTile(data));
    };
    web.onclose = ({ code }) => {
      if (this.web !== web) return;
      this.web = null;
      this.closed(code);
    };
  }

  async closed(code) {
    if (!this.wanted) return;
    // A refused handshake does not say why: the session does.
    const expired = code === LOGIN_AGAIN || (await session().then((found) => found === null, () => false));
    if (!this.wanted || this.web) return;
    if (expired) {
      this.wanted = false;
      this.on.login();
      return;
    }
    // Jitter, so that a hundred pages do not return to a restarted server in the same instant.
    const longest = Math.min(15, 0.5 * 2 ** this.failures);
    const seconds = longest * (0.5 + 0.5 * Math.random());
    this.failures++;
    this.timer = setTimeout(() => this.connect(), seconds * 1000);
    this.on.lost(seconds);
  }
}
