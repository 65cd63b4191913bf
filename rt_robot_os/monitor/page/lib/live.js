// @ts-check
/**
 * The WebSocket to the server: it comes back by itself within two seconds, knows when the other
 * side is silent, how far the way is, and how far the server's clock is from ours.
 */

const FIRST_WAIT_MS = 200;
const LONGEST_WAIT_MS = 1500;
const PING_MS = 2000;
// Of silence: pongs come each two seconds.
const SILENT_MS = 5000;
const CONNECT_MS = 5000;
// The server says so when the session is no more.
const REVOKED = 4401;
// What the session may do has changed: it was locked or unlocked, or somebody changed the role.
const RIGHTS = 4403;

export class Live extends EventTarget {
  /** @param {string} path such as '/live' */
  constructor(path) {
    super();
    this.path = path;
    this.socket = null;
    this.isOpen = false;
    /** When the connection was lost, by this computer's clock; null while there is one. */
    this.lostMs = null;
    this.rttMs = null;
    this.received = 0;
    this.offsetMs = 0;
    this.bestRttMs = Infinity;
    this.watches = new Map();
    this.waitMs = FIRST_WAIT_MS;
    this.timer = 0;
    this.heardMs = 0;
    this.startedMs = Date.now();
    /** When the last message of the server came, by this computer's clocks; null: none yet. */
    this.contact = null;
    this.onOnline = () => this.hurry();
  }

  start() {
    if (this.isStarted) {
      return;
    }
    this.isStarted = true;
    this.startedMs = Date.now();
    this.contact = null;
    addEventListener('online', this.onOnline);
    document.addEventListener('visibilitychange', this.onOnline);
    this.ticker = setInterval(() => this.tick(), PING_MS);
    this.connect();
  }

  stop() {
    this.isStarted = false;
    removeEventListener('online', this.onOnline);
    document.removeEventListener('visibilitychange', this.onOnline);
    clearInterval(this.ticker);
    clearTimeout(this.timer);
    const socket = this.socket;
    this.socket = null;
    this.isOpen = false;
    this.lostMs = null;
    if (socket) {
      socket.close(1000);
    }
  }

  /** When the last message of the server came, by this computer's clock; without one the start. */
  get contactMs() {
    return this.contact ? this.contact.dateMs : this.startedMs;
  }

  /** For how long nothing has come from the server. */
  get silentMs() {
    // One clock stands while a computer sleeps, the other may be set back.
    return this.contact ? Math.max(Date.now() - this.contact.dateMs,
      performance.now() - this.contact.atMs) : Infinity;
  }

  /** Whether what is known is of now: the server said something a moment ago. */
  get isCurrent() {
    return this.silentMs <= SILENT_MS;
  }

  /** Whether it was started so recently that no answer means nothing yet. */
  get isYoung() {
    return Date.now() - this.startedMs <= SILENT_MS;
  }

  /** Now, by the server's clock, in ns since 1970. */
  nowNs() {
    return (Date.now() + this.offsetMs) * 1e6;
  }

  /**
   * Ask for signals; the same name replaces what was asked for by it.
   * @param {string} name of whoever asks
   * @param {?string} robot its id; null is every robot
   * @param {string[]} signals names, with * for any text
   * @param {number} rateHz at most so often
   * @returns {function(): void} end it
   */
  watch(name, robot, signals, rateHz = 5) {
    const wish = {kind: 'watch', id: name, robot, signals, rate_hz: rateHz};
    this.watches.set(name, wish);
    this.send(wish);
    return () => {
      if (this.watches.get(name) === wish) {
        this.watches.delete(name);
        this.send({...wish, signals: []});
      }
    };
  }

  /** Send a message; without a connection it is not sent, and that is the answer. */
  send(message) {
    if (!this.isOpen) {
      return false;
    }
    this.socket.send(JSON.stringify(message));
    return true;
  }

  connect() {
    clearTimeout(this.timer);
    const address = new URL(this.path, location.href);
    address.protocol = address.protocol.replace('http', 'ws');
    const socket = new WebSocket(address);
    this.socket = socket;
    this.heardMs = performance.now();
    socket.onopen = () => this.opened(socket);
    socket.onmessage = (event) => this.heard(socket, event.data);
    socket.onclose = (event) => this.closed(socket, event.code);
  }

  opened(socket) {
    if (socket !== this.socket) {
      socket.close();
      return;
    }
    this.isOpen = true;
    this.lostMs = null;
    this.waitMs = FIRST_WAIT_MS;
    this.watches.forEach((wish) => this.send(wish));
    this.ping();
    this.tell('connection');
  }

  heard(socket, text) {
    if (socket !== this.socket) {
      return;
    }
    this.heardMs = performance.now();
    this.contact = {atMs: this.heardMs, dateMs: Date.now()};
    let message;
    try {
      message = JSON.parse(text);
    } catch (error) {
      return;
    }
    this.received += 1;
    if (message.kind === 'pong') {
      this.measure(message);
    } else {
      this.tell(message.kind, message);
    }
  }

  closed(socket, code) {
    if (socket !== this.socket) {
      return;
    }
    const wasOpen = this.isOpen;
    this.isOpen = false;
    this.socket = null;
    this.rttMs = null;
    if (code === REVOKED) {
      this.stop();
      this.tell('revoked');
      return;
    }
    this.lostMs = this.lostMs || this.contactMs;
    if (code === RIGHTS) {
      this.tell('rights');
    }
    this.timer = setTimeout(() => this.connect(), this.waitMs * (0.8 + 0.4 * Math.random()));
    this.waitMs = Math.min(this.waitMs * 1.7, LONGEST_WAIT_MS);
    this.tell(wasOpen ? 'connection' : 'retry');
  }

  tick() {
    const quietMs = performance.now() - this.heardMs;
    if (this.isOpen && quietMs > SILENT_MS) {
      this.drop();
    } else if (!this.isOpen && this.socket && quietMs > CONNECT_MS) {
      this.drop();
    } else if (this.isOpen) {
      this.ping();
    }
  }

  /** Give a connection up at once: closing it properly may take a minute when the network is gone. */
  drop() {
    const socket = this.socket;
    this.closed(socket, 1006);
    socket.onclose = null;
    socket.close();
  }

  hurry() {
    if (!this.isStarted || document.hidden) {
      return;
    }
    if (this.isOpen) {
      this.ping();
    } else if (!this.socket) {
      this.waitMs = FIRST_WAIT_MS;
      this.connect();
    }
  }

  ping() {
    this.send({kind: 'ping', t: performance.now()});
  }

  measure({t, utc_ns: utcNs}) {
    this.rttMs = performance.now() - t;
    if (typeof utcNs === 'number' && this.rttMs <= this.bestRttMs + 5) {
      this.bestRttMs = Math.min(this.bestRttMs, this.rttMs);
      this.offsetMs = utcNs / 1e6 + this.rttMs / 2 - Date.now();
    }
    this.tell('rtt');
  }

  tell(kind, detail = {}) {
    this.dispatchEvent(new CustomEvent(kind, {detail}));
  }
}
