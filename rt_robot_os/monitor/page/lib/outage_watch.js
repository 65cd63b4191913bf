// @ts-check
/** Make an outage heard and seen outside of the page: sound, read out, notification, title, icon. */

import {notify} from './notification.js';
import {outageOf, outageWords} from './outage.js';
import {announce} from './toast.js';

/** Watch for outages; context.outage is the one of now. Returns what ends it. */
export function watchOutages(context) {
  const {state, silence, sound} = context;
  let notice = null;
  let wasHeard = false;
  const end = () => {
    notice?.then((made) => made?.close());
    notice = null;
  };
  const look = () => {
    const outage = outageOf(state);
    silence.update(state);
    const isHeard = silence.sounds(outage);
    context.outage = outage;
    sound.outage(isHeard);
    if (isHeard && !wasHeard) {
      const {title, text} = outageWords(outage, context);
      announce(`${title}. ${text}`, true);
      notice = shown(context, title, text);
    } else if (!outage) {
      end();
    }
    wasHeard = isHeard;
    context.showTitle();
  };
  const off = state.on('robots connection server tick', look);
  look();
  return () => {
    off();
    end();
    sound.outage(false);
    context.outage = null;
  };
}

/** Show a notification while the page is out of sight; a promise of it, or null. */
function shown({settings}, title, text) {
  return document.hidden && settings.notify
    ? notify(title, {body: text, tag: 'outage', requireInteraction: true}) : null;
}
