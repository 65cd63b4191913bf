// @ts-check
/** Start: words, session, then the shell with its views, or the view to sign in. */

import {Api, ApiError} from './lib/api.js';
import {h, replace} from './lib/dom.js';
import {Format} from './lib/format.js';
import {store, stored, translator, Words} from './lib/i18n.js';
import {Live} from './lib/live.js';
import {prepare} from './lib/notification.js';
import {Silence} from './lib/outage.js';
import {button, notice} from './lib/parts.js';
import {Shell} from './lib/shell.js';
import {Sound} from './lib/sound.js';
import {State} from './lib/state.js';
import {clearMessages, toast} from './lib/toast.js';
import {unlock} from './lib/unlock.js';

const root = document.getElementById('app');
const words = new Words();
const api = new Api();
const live = new Live('/live');
const state = new State(live);
const sound = new Sound(stored('sound') === 'on');
const settings = {theme: stored('theme') || '', notify: stored('notify') === 'on'};
let shell = null;
let session = null;

/** What every view is given. */
const context = {
  api,
  live,
  state,
  sound,
  silence: new Silence(),
  settings,
  toast,
  t: translator(words),
  format: null,
  user: null,
  /** What the role may do; of it allowed is what the session may do without the password. */
  permissions: new Set(),
  allowed: new Set(),
  isLocked: false,
  people: null,
  /** What keeps alarms from being known now; null: nothing. */
  outage: null,
  /** Go to another view: '#/alarms/robot/7'. */
  go(hash) {
    location.hash = hash;
  },
  /**
   * Order something of a robot.
   * @returns {Promise<{ok: boolean, text: string}>} its answer
   * @throws {ApiError} it was not asked, did not answer, or refuses
   */
  async command(robot, what, args = {}) {
    const path = `/api/robots/${encodeURIComponent(robot)}/commands`;
    // Of the same key the server has it done once, should the browser send it again.
    const key = `${Date.now().toString(36)}${Math.random().toString(36).slice(2)}`;
    const answer = await api.post(path, {do: what, args, key});
    if (answer && answer.ok === false) {
      throw new ApiError(409, answer.text, '', '', answer.codes);
    }
    return answer;
  },
  /** After somebody has signed in: begin anew with who that is. */
  async signedIn() {
    await begin();
  },
  /** The session is this now, as the server says: locked, unlocked, or with other rights. */
  sessionIs(found) {
    session = found;
    api.csrf = found.csrf || '';
    const user = typeof found.user === 'object' ? found.user : {name: found.user};
    context.user = {role: found.role, ...user};
    context.allowed = new Set(found.permissions);
    context.permissions = new Set([...found.permissions, ...(found.role_permissions || [])]);
    context.isLocked = Boolean(found.locked);
    context.people = found.people;
    state.tell('session');
  },
  signedOut,
  async signOut() {
    try {
      await api.delete('/api/session');
    } catch (error) {
      // The server forgets the session by itself; here it ends at once.
    }
    leave();
  },
  async setLanguage(language) {
    store('language', language);
    await words.use(language);
    show();
  },
  setTheme(theme) {
    settings.theme = theme;
    store('theme', theme || null);
    if (theme) {
      document.documentElement.dataset.theme = theme;
    } else {
      delete document.documentElement.dataset.theme;
    }
    dispatchEvent(new Event('themechange'));
  },
  async setSound(isOn) {
    store('sound', isOn ? 'on' : null);
    await sound.switch(isOn);
  },
  async setNotify(isOn) {
    const isAllowed = isOn && await prepare();
    settings.notify = isAllowed;
    store('notify', isAllowed ? 'on' : null);
    return isAllowed;
  },
  /** How many alarms nobody has answered, and the worst in words: for the title and the icon. */
  setBadge(count, text) {
    context.badge = {count, text};
    context.showTitle();
  },
  showTitle() {
    shell?.showTitle();
  },
  badge: {count: 0, text: ''},
  /** A view that is about one robot says so: the stop button stops that one. */
  shownRobot: null,
};

async function begin(asked = api.get('/api/session').catch((error) => error)) {
  root.setAttribute('aria-busy', 'true');
  const found = await asked;
  if (found instanceof ApiError && found.status !== 401) {
    unreachable();
    return;
  }
  session = found instanceof ApiError ? null : found;
  if (session) {
    context.sessionIs(session);
    state.clear();
    live.start();
  }
  show();
}

function leave() {
  live.stop();
  state.clear();
  session = null;
  api.csrf = '';
  context.user = null;
  context.permissions = new Set();
  context.allowed = new Set();
  context.isLocked = false;
  context.setBadge(0, '');
  clearMessages();
  show();
}

function show() {
  context.format = new Format(words.locale);
  shell?.close();
  shell = new Shell(root, context, session !== null);
  root.removeAttribute('aria-busy');
}

let again;

function unreachable() {
  replace(root, h('main.alone', notice('offline', words.say('shell.no_answer'),
    words.say('shell.no_answer_text'), button(words.say('shell.again'), () => begin(),
      {kind: 'primary'}))));
  root.removeAttribute('aria-busy');
  clearTimeout(again);
  again = setTimeout(begin, 2000);
}

/** Ask the server what the session is by now; false: there is none, or no answer. */
async function renew() {
  const mine = session;
  try {
    const found = await api.get('/api/session', {}, {background: true});
    if (mine && found.user !== mine.user) {
      // Somebody else has signed in, in another window.
      location.reload();
      return false;
    }
    context.sessionIs(found);
    return true;
  } catch (error) {
    return false;
  }
}

api.onSignedOut = () => session && signedOut();
// A question only for who waits for the answer; what a timer asks for waits until then.
api.onLocked = (isAsked) => (isAsked ? unlock(context) : renew().then(() => false));
api.onStale = renew;
live.addEventListener('rights', renew);
// In another window of this browser somebody may have signed in again.
live.addEventListener('revoked', async () => (await renew() ? live.start() : signedOut()));
live.addEventListener('emergency', (event) => {
  const {name, person} = /** @type {CustomEvent} */ (event).detail;
  toast(context.t('shell.emergency', {name, person}), {kind: 'warn', shownMs: 60000});
});

function signedOut() {
  leave();
  toast(context.t('shell.signed_out'), {kind: 'warn'});
}

// A notification was touched.
navigator.serviceWorker?.addEventListener('message', ({data}) => {
  if (data?.kind === 'go' && data.hash) {
    context.go(data.hash);
  }
});

addEventListener('keydown', (event) => {
  if (event.key === 'F9' && session) {
    event.preventDefault();
    context.go('#/alarms');
  }
});

await words.use(Words.preferred());
const first = api.get('/api/session').catch((error) => error);
await words.load('shell', 'words', 'alarms', 'said');
await begin(first);
