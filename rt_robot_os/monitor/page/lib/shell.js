// @ts-check
/** What is around each view: head, line of alarms, navigation; and which view is open. */

import {alarmStrip} from './alarm_strip.js';
import {watchAlarms} from './alarm_watch.js';
import {asset} from './asset.js';
import {connectionMark} from './connection.js';
import {openDialog} from './dialog.js';
import {attribute, h, replace} from './dom.js';
import {icon} from './icons.js';
import {openMenu} from './menu.js';
import {outageWords} from './outage.js';
import {watchOutages} from './outage_watch.js';
import {button, iconButton, notice} from './parts.js';
import {stopButton} from './stop.js';
import {lockedNotice, unlock} from './unlock.js';
import {mayOpen, viewNamed, viewsFor} from './views.js';

// What the line of alarms, the overview and the stop button live on.
const SIGNALS = ['battery', 'agent/state', 'stop_reason', 'codes/*', 'health/*/signs', 'health/*/news2_details',
  'health/*/place_details'];
// Narrow screens show so many views; the others are behind "more".
const FIRST_VIEWS = 4;
// Of these title and icon of the window tell.
const OUT_OF_SIGHT = new Set(['server', 'robots']);
// A view that is there sooner shows no sign of loading.
const PATIENCE_MS = 200;

export class Shell {
  /**
   * @param {HTMLElement} root
   * @param {Object} context
   * @param {boolean} isSignedIn
   */
  constructor(root, context, isSignedIn) {
    this.root = root;
    this.context = context;
    this.isSignedIn = isSignedIn;
    this.ends = [];
    this.endView = null;
    this.shown = 0;
    this.heading = h('h1.title');
    this.main = h('main.main', {id: 'main', tabindex: '-1'});
    this.links = new Map();
    if (isSignedIn) {
      this.build();
    } else {
      replace(root, this.main);
      root.className = 'shell shell-alone';
    }
    this.onhash = () => this.route();
    addEventListener('hashchange', this.onhash);
    this.route();
  }

  build() {
    const {context} = this;
    const {t} = context;
    const strip = alarmStrip(context);
    const mark = connectionMark(context);
    const mayStop = context.permissions.has('acknowledge');
    const stop = mayStop ? stopButton(context) : null;
    const skip = h('button.skip', {type: 'button', onclick: () => this.main.focus()},
      t('shell.skip'));
    const head = h('header.head', skip, h('a.brand', {href: '#/overview', 'aria-label':
      t('shell.brand')}, h('img', {src: asset('style/icon.svg'), alt: '', width: 32, height: 32})),
    this.heading, mark.element, this.lockButton(), this.soundButton(), iconButton('account', t('shell.account'),
      () => openMenu(context)), stop && stop.element);
    replace(this.root, head, strip.element, this.rail(), this.main);
    this.root.className = 'shell';
    this.ends.push(strip.close, mark.close, watchAlarms(context), watchOutages(context),
      context.state.on('session', () => this.sessionChanged()),
      context.live.watch('shell', null, SIGNALS, 1));
    if (stop) {
      this.ends.push(stop.close);
    }
    // Alarms can be looked at also when the server no longer gives out the view of them.
    load(viewNamed('alarms'), context).catch(() => {});
  }

  /** That the session is locked, and the way out; not there while it is not. */
  lockButton() {
    const {context} = this;
    const {t} = context;
    const made = h('button.button.locked-mark', {type: 'button', title: t('shell.locked_tip'),
      onclick: () => unlock(context)}, icon('locked'), h('span.label', t('shell.locked')));
    const show = () => {
      made.hidden = !context.isLocked;
    };
    this.ends.push(context.state.on('session', show));
    show();
    return made;
  }

  /** Locked or unlocked: a view that needs more than is left gives way to a word about it. */
  sessionChanged() {
    if (this.isShut !== this.mustUnlock(this.view)) {
      this.route();
    }
  }

  mustUnlock(view) {
    return this.isSignedIn && !mayOpen(view, this.context.allowed);
  }

  soundButton() {
    const {t, sound, setSound} = this.context;
    const made = iconButton('sound', '', () => setSound(sound.state !== 'on'));
    const show = () => {
      made.classList.toggle('is-waiting', sound.state === 'blocked');
      attribute(made, 'aria-label', t('shell.sound'));
      attribute(made, 'aria-pressed', String(sound.state === 'on'));
      made.title = t(`shell.sound_${sound.state}`);
      replace(made, icon(sound.state === 'on' ? 'sound' : 'muted'));
    };
    sound.addEventListener('change', show);
    this.ends.push(() => sound.removeEventListener('change', show));
    show();
    return made;
  }

  rail() {
    const {t} = this.context;
    const views = viewsFor('rail', this.context.permissions);
    const items = views.map((each, index) => {
      const link = h('a.rail-link', {href: `#/${each.name}`}, icon(each.name),
        h('span', t(`shell.view_${each.name}`)));
      this.links.set(each.name, link);
      return h(`li${index >= FIRST_VIEWS ? '.rail-later' : ''}`, link);
    });
    const later = views.slice(FIRST_VIEWS);
    this.moreButton = h('button.rail-link', {type: 'button', onclick: () => this.more(later)},
      icon('more'), h('span', t('shell.more')));
    this.later = new Set(later.map((each) => each.name));
    const more = later.length > 0 && h('li.rail-more', this.moreButton);
    return h('nav.rail', {'aria-label': t('shell.views')}, h('ul', items, more));
  }

  more(views) {
    const {t} = this.context;
    return openDialog(t('shell.views'), (close) => [h('nav.menu-links', views.map((each) => h(
      'a.menu-link', {href: `#/${each.name}`, onclick: () => close()}, icon(each.name),
      t(`shell.view_${each.name}`)))), h('div.actions', button(t('shell.close'), () => close()))],
    'sheet');
  }

  /** Open the view of the address; one that is not there, or not for this person, is the first. */
  async route() {
    const [name, ...rest] = location.hash.replace(/^#\/?/, '').split('/');
    const view = this.choose(viewNamed(name));
    const arg = view.name === name ? rest.map(decoded).join('/') : '';
    this.shown += 1;
    const mine = this.shown;
    this.end();
    this.mark(view);
    this.isShut = this.mustUnlock(view);
    if (this.isShut) {
      this.put(lockedNotice(this.context));
      return;
    }
    const timer = setTimeout(() => mine === this.shown && this.put(this.waiting()), PATIENCE_MS);
    try {
      const {view: found} = await load(view, this.context);
      if (mine === this.shown) {
        const body = h(`div.view.view-${view.name}`);
        this.put(body);
        this.endView = found.open(body, this.context, arg) || null;
      }
    } catch (error) {
      console.error(error);
      if (mine === this.shown) {
        this.failed(error);
      }
    } finally {
      clearTimeout(timer);
    }
  }

  /** What stands where a view will be. */
  waiting() {
    const {t, outage} = this.context;
    return outage?.kind === 'server'
      ? notice('offline', t('shell.no_answer'), t('shell.no_answer_text'))
      : notice('loading', t('shell.loading'));
  }

  /** Show this; who went by keys in what was there before is at its beginning. */
  put(shown) {
    const wasThere = this.main.contains(document.activeElement);
    replace(this.main, shown);
    if (wasThere && !this.main.contains(document.activeElement)) {
      this.main.focus({preventScroll: true});
    }
  }

  choose(view) {
    if (!this.isSignedIn) {
      return view && view.place === 'alone' ? view : viewNamed('login');
    }
    if (view && view.place !== 'alone' && mayOpen(view, this.context.permissions)) {
      return view;
    }
    return viewsFor('rail', this.context.permissions)[0] || viewNamed('account');
  }

  mark(view) {
    this.view = view;
    this.heading.textContent = this.context.t(`shell.view_${view.name}`);
    this.showTitle();
    this.links.forEach((link, name) => attribute(link, 'aria-current',
      name === view.name ? 'page' : null));
    if (this.moreButton) {
      attribute(this.moreButton, 'aria-current', this.later.has(view.name) ? 'true' : null);
    }
    if (this.wasRouted) {
      this.main.focus({preventScroll: true});
      this.main.scrollTop = 0;
      scrollTo(0, 0);
    }
    this.wasRouted = true;
  }

  /** The title of the window: alarms first, since it is cut at its end. */
  showTitle() {
    const {badge: {count, text}, outage, t} = this.context;
    const isUnknown = outage && OUT_OF_SIGHT.has(outage.kind);
    const view = [this.heading.textContent, t('shell.brand')].join(' – ');
    const lost = isUnknown && outageWords(outage, this.context).title;
    document.title = [count && `(${count}) ${text}`, lost, !count && view].filter(Boolean)
      .join(' – ');
    attribute(document.getElementById('icon'), 'href', asset(count ? 'style/icon_alarm.svg'
      : isUnknown ? 'style/icon_unknown.svg' : 'style/icon.svg'));
  }

  failed(error) {
    const {t} = this.context;
    this.put(h('div.view', notice('error', t('shell.view_failed'), error.message,
      button(t('shell.again'), () => this.route(), {kind: 'primary'}))));
  }

  end() {
    this.context.shownRobot = null;
    const end = this.endView;
    this.endView = null;
    if (end) {
      try {
        end();
      } catch (error) {
        console.error(error);
      }
    }
  }

  close() {
    removeEventListener('hashchange', this.onhash);
    this.shown += 1;
    this.end();
    this.ends.forEach((each) => each());
  }
}

async function load(view, context) {
  const [found] = await Promise.all([import(`../views/${view.name}.js`),
    context.t.words.load(view.name), sheet(view.name)]);
  return found;
}

/** Load the style of a view once; it is there before the view is, so that nothing jumps. */
function sheet(name) {
  const href = asset(`style/${name}.css`);
  if (document.querySelector(`link[href="${href}"]`)) {
    return Promise.resolve();
  }
  return new Promise((resolve) => {
    const link = h('link', {rel: 'stylesheet', href, onload: resolve, onerror: resolve});
    document.head.append(link);
  });
}

function decoded(text) {
  try {
    return decodeURIComponent(text);
  } catch (error) {
    return text;
  }
}
