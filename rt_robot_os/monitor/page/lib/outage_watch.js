/** Make an outage heard and seen outside of the page: sound, read out, notification, title, icon. */

import {outageOf, outageWords} from './outage.js';
import {announce} from './toast.js';

/** Watch for outages; context.outage is the one of now. Returns what ends it. */
export function watchOutages(context) {
  const {state, silence, sound} = context;
  let notice = null;
  let wasHeard = false;
  const look = () => {
    const outage = outageOf(state);
    silence.update(state);
    const isHeard = silence.sounds(outage);
    context.outage = outage;
    sound.outage(isHeard);
    if (isHeard && !wasHeard) {
      const {title, text} = outageWords(outage, context);
      announce(`${title}. ${text}`, true);
      notice = notify(context, title, text) || notice;
    } else if (!outage) {
      notice?.close();
      notice = null;
    }
    wasHeard = isHeard;
    context.showTitle();
  };
  const off = state.on('robots connection server tick', look);
  look();
  return () => {
    off();
    notice?.close();
    sound.outage(false);
    context.outage = null;
  };
}

function notify({settings}, title, text) {
  if (!document.hidden || !settings.notify || !('Notification' in window)
      || Notification.permission !== 'granted') {
    return null;
  }
  const made = new Notification(title, {body: text, tag: 'outage', requireInteraction: true});
  made.onclick = () => {
    window.focus();
    made.close();
  };
  return made;
}
