// @ts-check
/**
 * The connection for pictures, one a page: `/camera`. Each picture is answered when it is drawn,
 * and only then the server sends the next: nothing old ever waits for a slow browser.
 */

const FIRST_WAIT_MS = 200;
const LONGEST_WAIT_MS = 1500;
const CLOCK_MS = 5000;
const REVOKED = 4401;
const DECODER = new TextDecoder();

/**
 * Take a frame apart: the length of its header (4 bytes, little-endian), the header, the rest.
 * @param {ArrayBuffer} buffer
 * @returns {{header: Object, payload: Uint8Array}}
 * @throws {Error} it is none
 */
export function decodeFrame(buffer) {
  const length = buffer.byteLength >= 4 ? new DataView(buffer).getUint32(0, true) : Infinity;
  if (4 + length > buffer.byteLength) {
    throw new Error(`a frame of ${buffer.byteLength} bytes`);
  }
  const header = JSON.parse(DECODER.decode(new Uint8Array(buffer, 4, length)));
  return {header, payload: new Uint8Array(buffer, 4 + length)};
}

export class Cameras extends EventTarget {
  /** @param {string} path such as '/camera' */
  constructor(path) {
    super();
    this.path = path;
    this.socket = null;
    this.looks = new Map();
    this.waitMs = FIRST_WAIT_MS;
    this.timer = 0;
    this.offsetMs = null;
    this.bestRttMs = Infinity;
    this.onVisible = () => this.arrange();
    document.addEventListener('visibilitychange', this.onVisible);
    addEventListener('online', this.onVisible);
  }

  /**
   * Look through a camera.
   * @param {{robot: string, camera: string, rateHz: number}} what
   * @param {{picture: function(Object, Uint8Array): Promise, gone: function(Object): void}} eyes
   * @returns {function(): void} look away
   */
  look(what, eyes) {
    const look = {...what, eyes};
    const key = keyOf(what.robot, what.camera);
    const together = this.looks.get(key) || new Set();
    this.looks.set(key, together.add(look));
    this.arrange();
    this.ask(key);
    return () => {
      together.delete(look);
      if (!together.size && this.looks.get(key) === together) {
        this.looks.delete(key);
        this.say({kind: 'leave', robot: what.robot, camera: what.camera});
      } else {
        this.ask(key);
      }
      this.arrange();
    };
  }

  get isOpen() {
    return this.socket !== null && this.socket.readyState === WebSocket.OPEN;
  }

  /** How old something is, in ms, by the server's clock; null while that is not known. */
  ageMs(utcNs) {
    return this.offsetMs === null ? null
      : Math.max(0, performance.now() + this.offsetMs - utcNs / 1e6);
  }

  /** Be connected while somebody looks and the page can be seen, and only then. */
  arrange() {
    const wanted = this.looks.size > 0 && !document.hidden;
    if (wanted && !this.socket) {
      this.connect();
    } else if (!wanted && (this.socket || this.timer)) {
      clearTimeout(this.timer);
      this.timer = 0;
      this.end(1000);
    }
  }

  connect() {
    clearTimeout(this.timer);
    this.timer = 0;
    const address = new URL(this.path, location.href);
    address.protocol = address.protocol.replace('http', 'ws');
    const socket = new WebSocket(address);
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    socket.onopen = () => this.opened();
    socket.onmessage = (event) => this.heard(event.data);
    socket.onclose = (event) => this.closed(event.code);
  }

  opened() {
    this.waitMs = FIRST_WAIT_MS;
    this.bestRttMs = Infinity;
    [...this.looks.keys()].forEach((key) => this.ask(key));
    this.askClock();
    this.ticker = setInterval(() => this.askClock(), CLOCK_MS);
    this.dispatchEvent(new Event('connection'));
  }

  askClock() {
    this.say({kind: 'clock', t: performance.now()});
  }

  ask(key) {
    const together = this.looks.get(key);
    if (together && together.size) {
      const [{robot, camera}] = together;
      const rateHz = Math.max(...[...together].map((each) => each.rateHz));
      this.say({kind: 'look', robot, camera, rate_hz: rateHz});
    }
  }

  say(message) {
    if (this.isOpen) {
      this.socket.send(JSON.stringify(message));
    }
  }

  heard(data) {
    if (typeof data !== 'string') {
      this.show(data);
      return;
    }
    const message = JSON.parse(data);
    if (message.kind === 'clock') {
      this.measure(message);
    } else if (message.kind === 'gone') {
      this.each(message, (look) => look.eyes.gone(message));
    }
  }

  measure({t, utc_ns: utcNs}) {
    const now = performance.now();
    const rttMs = now - t;
    if (rttMs <= this.bestRttMs + 2) {
      this.bestRttMs = Math.min(rttMs, this.bestRttMs);
      this.offsetMs = utcNs / 1e6 - (t + now) / 2;
    }
  }

  async show(data) {
    const socket = this.socket;
    const {header, payload} = decodeFrame(data);
    const drawn = [];
    this.each(header, (look) => drawn.push(look.eyes.picture(header, payload)));
    await Promise.allSettled(drawn);
    if (socket === this.socket) {
      this.say({kind: 'taken', robot: header.robot, camera: header.camera, n: header.n});
    }
  }

  each({robot, camera}, work) {
    (this.looks.get(keyOf(robot, camera)) || []).forEach(work);
  }

  closed(code) {
    this.end();
    if (code === REVOKED) {
      this.dispatchEvent(new Event('revoked'));
      return;
    }
    this.timer = setTimeout(() => {
      this.timer = 0;
      this.arrange();
    }, this.waitMs * (0.8 + 0.4 * Math.random()));
    this.waitMs = Math.min(this.waitMs * 1.7, LONGEST_WAIT_MS);
  }

  end(code) {
    const socket = this.socket;
    this.socket = null;
    clearInterval(this.ticker);
    if (socket) {
      socket.onopen = socket.onmessage = socket.onclose = null;
      socket.close(code);
    }
    this.dispatchEvent(new Event('connection'));
  }
}

function keyOf(robot, camera) {
  return JSON.stringify([robot, camera]);
}

let shared = null;

/** The one connection of this page. */
export function cameras() {
  shared = shared || new Cameras('/camera');
  return shared;
}
