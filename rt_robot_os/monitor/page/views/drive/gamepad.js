// @ts-check
/**
 * Driving with a gamepad: closed while a shoulder button is held; the left stick says where to.
 *
 * One that is unplugged opens the hand.
 */

// Of the standard mapping: the upper shoulder buttons.
const DEAD_MAN = [4, 5];
const DEAD_ZONE = 0.15;

export class Gamepads {
  constructor(hand) {
    this.name = 'gamepad';
    this.hand = hand;
    this.index = null;
    this.ongone = (event) => {
      if (event.gamepad.index === this.index) {
        this.gone();
      }
    };
    addEventListener('gamepaddisconnected', this.ongone);
    hand.add(this);
  }

  /** Whether there is one. */
  get isThere() {
    return all().length > 0;
  }

  /** Look at them: they tell nothing by themselves. */
  poll() {
    if (this.index !== null && !all().some((each) => each.index === this.index)) {
      this.gone();
    }
  }

  read() {
    const pads = all();
    const held = pads.find((each) => each.index === this.index && isHeld(each))
      || pads.find(isHeld);
    this.index = held ? held.index : null;
    return held ? {x: zoned(held.axes[0]), y: -zoned(held.axes[1])} : null;
  }

  gone() {
    this.index = null;
    this.hand.letGo('gamepad');
  }

  end() {
    removeEventListener('gamepaddisconnected', this.ongone);
  }
}

function all() {
  return [...(navigator.getGamepads ? navigator.getGamepads() : [])]
    .filter((each) => each && each.connected);
}

function isHeld(pad) {
  return DEAD_MAN.some((each) => pad.buttons[each] && pad.buttons[each].pressed);
}

/** Take the dead zone off: what is left goes from 0 to 1 all the same. */
function zoned(value) {
  const far = Math.abs(value);
  return far > DEAD_ZONE ? Math.sign(value) * Math.min(1, (far - DEAD_ZONE) / (1 - DEAD_ZONE)) : 0;
}
