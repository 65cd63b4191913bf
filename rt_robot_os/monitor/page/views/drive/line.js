// @ts-check
/**
 * The connection to the robot that is driven: lease, tickets, commands, and how good the link is.
 *
 * Each command carries the newest ticket (the number of the robot's beat) that has come here, and
 * for how long it has lain here: the robot knows by its own clock how old a command is.
 */

/** A round trip longer than this, or no beat for so long, and nobody drives. */
export const BAD_MS = 300;
/** Commands: 25 a second while the hand is closed, fewer while it is open. */
export const PERIOD_MS = 40;
const OPEN_PERIOD_MS = 120;
// Changes go at once, but no faster than this.
const SHORTEST_MS = 15;
const ALIVE_MS = 1000;
const RETRY_MS = 1000;
// A command of which the robot has told nothing for so long did not come through, or too late.
const UNHEARD_MS = 450;
const UNHEARD = 100;
// What waits here would be old when it goes.
const WAITING_BYTES = 2000;
const REVOKED = 4401;
const UNKNOWN = 4404;

export class Line extends EventTarget {
  /**
   * @param {string} robot its id
   * @param {import('./hand.js').Hand} hand that drives
   * @param {function(): {linear: number, angular: number}} wish speed for a whole stick, in m/s and
   *   rad/s
   */
  constructor(robot, hand, wish) {
    super();
    this.robot = robot;
    this.hand = hand;
    this.wish = wish;
    this.seat = {state: 'away', by: '', connected: false, limits: {}};
    this.beat = null;
    this.beatMs = -Infinity;
    this.seq = 0;
    /** Commands that the robot has not told of yet: [seq, when]. */
    this.unheard = [];
    this.sentMs = -Infinity;
    this.saidMs = -Infinity;
    this.isEnded = false;
    this.ticker = setInterval(() => this.tick(), PERIOD_MS);
    this.onhand = () => this.changed();
    ['closed', 'opened', 'moved'].forEach((each) => hand.addEventListener(each, this.onhand));
    this.connect();
  }

  connect() {
    const address = new URL(`/drive?robot=${encodeURIComponent(this.robot)}`, location.href);
    address.protocol = address.protocol.replace('http', 'ws');
    const socket = new WebSocket(address);
    this.socket = socket;
    socket.onmessage = (event) => this.heard(JSON.parse(event.data));
    socket.onclose = (event) => this.closed(event.code);
  }

  get isOpen() {
    return Boolean(this.socket) && this.socket.readyState === WebSocket.OPEN;
  }

  get isMine() {
    return this.seat.state === 'yours';
  }

  /** Ask for the right to drive; over: also from somebody else. */
  take(over) {
    this.say({kind: 'take', over});
  }

  give() {
    this.hand.letGo('lease');
    this.say({kind: 'give'});
  }

  /** The time to the robot and back, in ms; null while it is not known. */
  get rttMs() {
    return this.beat && this.isFresh ? this.beat.rtt_ms : null;
  }

  get isFresh() {
    return performance.now() - this.beatMs <= BAD_MS;
  }

  /** Why nobody can drive now: away, absent, lease, beats, slow; empty: one can. */
  get whyNot() {
    if (!this.isOpen) {
      return 'away';
    }
    if (!this.seat.connected || (this.isMine && this.beat?.runs === false)) {
      return 'absent';
    }
    if (!this.isMine) {
      return 'lease';
    }
    if (!this.isFresh || this.socket.bufferedAmount > WAITING_BYTES) {
      return 'beats';
    }
    const [first] = this.unheard;
    const isUnheard = first && performance.now() - first[1] > UNHEARD_MS;
    return isUnheard || this.beat.rtt_ms > BAD_MS ? 'slow' : '';
  }

  heard(message) {
    if (message.kind === 'beat') {
      this.beat = message;
      this.beatMs = performance.now();
      this.unheard = this.unheard.filter(([seq]) => seq > message.seq);
    } else if (message.kind === 'seat') {
      const wasMine = this.isMine;
      this.seat = message;
      if (!wasMine && this.isMine) {
        this.seq = 0;
        this.unheard = [];
        this.beat = null;
        this.beatMs = -Infinity;
      }
    }
    this.look();
    this.tell(message.kind, message);
  }

  closed(code) {
    this.socket = null;
    this.seat = {...this.seat, state: 'away', by: ''};
    this.beat = null;
    this.look();
    this.tell('seat', this.seat);
    if (code === REVOKED || code === UNKNOWN) {
      this.tell('over', {code});
    } else if (!this.isEnded) {
      this.retry = setTimeout(() => this.connect(), RETRY_MS);
    }
  }

  /** Let the hand drive, or not, as the link is. */
  look() {
    const why = this.whyNot;
    this.hand.allow(why === '', why === 'lease' ? 'lease' : 'link');
  }

  tick() {
    this.look();
    const now = performance.now();
    if (now - this.saidMs >= ALIVE_MS) {
      this.say({kind: 'alive'});
    }
    // A little early is better than a whole period late.
    const period = this.hand.isClosed ? PERIOD_MS : OPEN_PERIOD_MS;
    if (now - this.sentMs >= period - 5) {
      this.drive();
    }
    this.tell('tick');
  }

  changed() {
    if (!this.hand.isClosed || performance.now() - this.sentMs >= SHORTEST_MS) {
      this.drive();
    }
  }

  drive() {
    const ticket = this.beat;
    if (!this.isMine || !ticket || !this.isOpen) {
      return;
    }
    const {linear, angular} = this.wish();
    const {isClosed, x, y} = this.hand;
    this.seq += 1;
    this.sentMs = performance.now();
    this.unheard.push([this.seq, this.sentMs]);
    this.unheard.splice(0, this.unheard.length - UNHEARD);
    this.say({kind: 'drive', seq: this.seq, beat: ticket.n, grip: isClosed,
      held_ms: Math.round((this.sentMs - this.beatMs) * 10) / 10,
      linear_m_s: isClosed ? y * linear : 0, angular_rad_s: isClosed ? -x * angular : 0});
  }

  say(message) {
    if (this.isOpen) {
      this.saidMs = performance.now();
      this.socket.send(JSON.stringify(message));
    }
  }

  tell(kind, detail = {}) {
    this.dispatchEvent(new CustomEvent(kind, {detail}));
  }

  end() {
    this.isEnded = true;
    clearInterval(this.ticker);
    clearTimeout(this.retry);
    this.hand.letGo('leave');
    ['closed', 'opened', 'moved'].forEach((each) => this.hand.removeEventListener(each, this.onhand));
    this.say({kind: 'give'});
    if (this.socket) {
      this.socket.onmessage = this.socket.onclose = null;
      this.socket.close(1000);
    }
  }
}
