// @ts-check
/**
 * The hand that drives, whatever it drives with: joystick on the screen, keys, gamepad.
 *
 * A source has a name and read(), which gives {x, y} while the hand is closed on it and null while
 * it is open; x is to the right and y ahead, from -1 to 1. A hand that was let go for some reason
 * counts again only when it was open: nothing moves under a finger that does not expect it.
 */

/** Why the hand was let go, as the view tells it; 'open' is by itself. */
export const REASONS = ['open', 'blur', 'hidden', 'pointer', 'gamepad', 'link', 'lease', 'leave'];

export class Hand extends EventTarget {
  constructor() {
    super();
    this.sources = [];
    this.isClosed = false;
    this.x = 0;
    this.y = 0;
    this.source = '';
    /** Sources that have to be open once before they count. */
    this.spent = new Set();
    this.isAllowed = false;
    this.why = 'lease';
  }

  /** Add a source; it calls changed() when it changes by itself. */
  add(source) {
    this.sources.push(source);
    this.spent.add(source);
  }

  /** Whether the hand may drive at present; not: whatever is closed is let go. */
  allow(isAllowed, why) {
    if (this.isAllowed && !isAllowed) {
      this.letGo(why);
    }
    this.isAllowed = isAllowed;
    this.why = isAllowed ? '' : why;
  }

  /** Open the hand, and have all that are closed opened before they count again. */
  letGo(why) {
    this.sources.filter((each) => each.read()).forEach((each) => this.spent.add(each));
    this.sources.forEach((each) => each.letGo && each.letGo());
    this.become(null, null, why);
  }

  /** Look at the sources; the one that is closed first has it until it opens. */
  changed() {
    let found = null;
    for (const source of this.sources) {
      const at = source.read();
      if (!at) {
        this.spent.delete(source);
      } else if (!this.spent.has(source) && (!found || source === this.held)) {
        found = {source, at};
      } else if (this.isClosed && source !== this.held) {
        // A second one that is closed meanwhile does not take over when the first one opens.
        this.spent.add(source);
      }
    }
    if (found && !this.isAllowed) {
      this.spent.add(found.source);
      this.dispatchEvent(new CustomEvent('refused', {detail: {why: this.why}}));
      found = null;
    }
    this.become(found && found.source, found && found.at, 'open');
  }

  become(source, at, why) {
    const wasClosed = this.isClosed;
    const before = [this.x, this.y];
    this.held = source;
    this.isClosed = Boolean(source);
    this.source = source ? source.name : '';
    const [x, y] = within(at);
    this.x = x;
    this.y = y;
    if (wasClosed !== this.isClosed) {
      this.dispatchEvent(new CustomEvent(this.isClosed ? 'closed' : 'opened', {detail: {why}}));
    } else if (this.isClosed && (before[0] !== x || before[1] !== y)) {
      this.dispatchEvent(new CustomEvent('moved'));
    }
  }
}

/** Bring a place into the circle; what is no number is its middle. */
function within(at) {
  if (!at || !Number.isFinite(at.x) || !Number.isFinite(at.y)) {
    return [0, 0];
  }
  const far = Math.max(1, Math.hypot(at.x, at.y));
  return [at.x / far, at.y / far];
}

/**
 * Let go whenever nobody may be looking: focus lost, window hidden, page left.
 * @returns {function(): void} end it
 */
export function letGoUnseen(hand) {
  const onblur = () => hand.letGo('blur');
  const onhidden = () => document.hidden && hand.letGo('hidden');
  const onleave = () => hand.letGo('leave');
  const dialogs = new MutationObserver(() => document.querySelector('dialog[open]')
    && hand.letGo('blur'));
  dialogs.observe(document.body, {childList: true});
  addEventListener('blur', onblur);
  document.addEventListener('visibilitychange', onhidden);
  document.addEventListener('freeze', onleave);
  addEventListener('pagehide', onleave);
  return () => {
    dialogs.disconnect();
    removeEventListener('blur', onblur);
    document.removeEventListener('visibilitychange', onhidden);
    document.removeEventListener('freeze', onleave);
    removeEventListener('pagehide', onleave);
  };
}
