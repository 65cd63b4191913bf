// @ts-check
/** Pictures, clips and sounds of an alarm, as far as the server has them. */

import {h, replace} from '../../lib/dom.js';

/** Show the media of an alarm. */
export function pictures(element, alarm, context) {
  const found = context.permissions.has('camera') ? alarm.media || [] : [];
  const key = found.map((each) => each.id).join();
  if (element.dataset.key === key) {
    return;
  }
  element.dataset.key = key;
  replace(element, found.map((each) => figure(each, context)));
}

function figure(each, {t, format}) {
  const source = `/api/media/${encodeURIComponent(each.id)}`;
  const when = format.time((each.t_ns || 0) / 1e6);
  const text = t('alarms.picture_of', {time: when});
  const kind = String(each.kind || '');
  if (kind === 'clip' || kind === 'video') {
    return h('figure', h('a.button', {href: `#/camera/${encodeURIComponent(each.robot || '')}`},
      t('alarms.clip')), h('figcaption.small.muted', when));
  }
  if (kind === 'sound' || kind === 'audio') {
    return h('figure', h('audio', {controls: true, preload: 'none', src: source, 'aria-label': text}),
      h('figcaption.small.muted', when));
  }
  const image = h('img', {src: source, alt: text, loading: 'lazy', width: each.width || 320,
    height: each.height || 240});
  return h('figure', h('a', {href: source, target: '_blank', rel: 'noopener'}, image),
    h('figcaption.small.muted', when));
}
