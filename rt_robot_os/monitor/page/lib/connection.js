// @ts-check
/** Whether what is shown is what is: connected, or no connection since when. */

import {h, tone, write} from './dom.js';
import {announce} from './toast.js';

// Longer than this the way there and back is worth a word.
const SLOW_MS = 400;

/** Make the mark; close ends it. */
export function connectionMark(context) {
  const {t, live, state, format} = context;
  const text = h('span.link-text');
  const element = h('p.link.link-wait', h('span.link-dot', {'aria-hidden': 'true'}), text);
  let lost = false;
  const draw = () => {
    const isLost = live.isOpen ? !live.isCurrent && live.contact !== null
      : live.lostMs !== null;
    const isLive = live.isOpen && !isLost;
    tone(element, 'link', isLive ? 'live' : isLost ? 'lost' : 'wait');
    if (isLost) {
      write(text, t('shell.lost_since', {time: format.time(live.lostMs || live.contactMs)}));
    } else if (!isLive) {
      write(text, t('shell.connecting'));
    } else {
      write(text, live.rttMs > SLOW_MS ? t('shell.slow', {rtt: format.unit(live.rttMs, 'ms')})
        : t('shell.live'));
    }
    if (isLost !== lost) {
      lost = isLost;
      announce(isLost ? text.textContent : t('shell.back_again'));
    }
  };
  const off = state.on('connection tick rtt', draw);
  draw();
  return {element, close: off};
}
