// @ts-check
/** What one sees and holds while driving one robot. */

import {ask} from '../../lib/dialog.js';
import {attribute, h, replace, tone, write} from '../../lib/dom.js';
import {icon} from '../../lib/icons.js';
import {hasKeys} from '../../lib/keys.js';
import {isUp} from '../../lib/outage.js';
import {badge, button, setBadge} from '../../lib/parts.js';
import {saidOf, saidSignal, writeSaid} from '../../lib/said.js';
import {release} from '../../lib/stop.js';
import {announce} from '../../lib/toast.js';
import {voiceOf} from '../../lib/voice.js';
import {Gamepads} from './gamepad.js';
import {Hand, letGoUnseen} from './hand.js';
import {joystick} from './joystick.js';
import {Keys} from './keys.js';
import {Line} from './line.js';
import {driverPicture} from './picture.js';

// A round trip shorter than this is as good as none.
const GOOD_MS = 120;
const SIGNALS = ['stop_reason', 'steering', 'speed', 'battery', 'codes/*'];
// What the multiplexer says while the e-stop is pressed begins so.
const ESTOP = 'nobody: e-stop';
const SHARES = {min: 20, max: 100, step: 10, value: 60};

export class Cockpit {
  constructor(context, robot, chooser) {
    this.context = context;
    this.robot = robot;
    this.share = SHARES.value / 100;
    this.hand = new Hand();
    this.line = new Line(robot.id, this.hand, () => this.wish());
    this.build(chooser);
    this.keys = new Keys(this.hand);
    this.gamepads = new Gamepads(this.hand);
    this.ends = [letGoUnseen(this.hand),
      context.live.watch('drive', robot.id, SIGNALS, 5),
      context.state.on('signals robots tick', () => this.showRobot())];
    this.listen();
    this.show();
  }

  build(chooser) {
    const {t} = this.context;
    this.stick = joystick(this.hand, [t('drive.stick'), hasKeys() && t('drive.stick_keys')]
      .filter(Boolean).join(' '));
    this.picture = driverPicture(this.context, this.robot);
    this.link = badge('none', '', 'offline');
    this.reason = h('p.drive-reason', {role: 'status'});
    this.told = h('div.drive-told', {role: 'alert'});
    this.seat = h('div.drive-seat');
    this.released = button(t('drive.release'), () => this.release(), {icon: 'check'});
    this.released.hidden = true;
    this.element = h('div.drive',
      h('section.drive-scene', {'aria-label': t('drive.scene')}, this.picture.element,
        // Over the picture: what comes and goes must not move the stick under a finger.
        h('div.drive-over', this.told, h('div.drive-held', this.reason, this.released))),
      h('section.drive-board', {'aria-label': t('drive.controls')}, chooser || null, this.seat,
        this.stick.element, h('p.drive-hint.small.muted', h('span.only-keys', t('drive.hint')),
          h('span.only-touch', t('drive.hint_touch'))),
        this.speedLimit(), this.facts()),
      this.talk = h('div.drive-talk'));
    this.offerCall();
  }

  /** Talk with whoever is there, where that is allowed and the robot can. */
  offerCall() {
    const can = (this.robot.capabilities || []).includes('talk')
      && this.context.permissions.has('talk');
    if (can && !this.voice) {
      this.voice = voiceOf(this.context, {robot: this.robot.id});
      replace(this.talk, this.voice.element);
    }
  }

  speedLimit() {
    const {t} = this.context;
    this.limit = h('output.number');
    const slider = h('input', {type: 'range', 'aria-label': t('drive.limit'), ...SHARES});
    slider.oninput = () => {
      this.share = Number(slider.value) / 100;
      this.showLimit();
    };
    return h('label.drive-limit', h('span', t('drive.limit')), slider, this.limit);
  }

  facts() {
    const {t} = this.context;
    this.rtt = h('dd.number');
    this.speed = h('dd.number');
    this.pad = h('dd');
    return h('dl.facts.drive-facts',
      h('dt', t('drive.link')), h('dd', this.link),
      h('dt', t('drive.rtt')), this.rtt,
      h('dt', t('drive.speed')), this.speed,
      h('dt', t('drive.gamepad')), this.pad);
  }

  listen() {
    const {line, hand} = this;
    line.addEventListener('seat', () => this.show());
    line.addEventListener('lost', ({detail}) => this.lost(detail));
    line.addEventListener('refused', ({detail}) => this.refused(detail));
    line.addEventListener('over', () => this.tell('warn', 'over'));
    line.addEventListener('tick', () => this.tick());
    ['closed', 'opened', 'moved'].forEach((each) => hand.addEventListener(each,
      () => this.stick.show(hand.x, hand.y, hand.isClosed)));
    const why = (event) => /** @type {CustomEvent} */ (event).detail.why;
    hand.addEventListener('opened', (event) => this.opened(why(event)));
    hand.addEventListener('closed', () => this.tell());
    hand.addEventListener('refused', (event) => why(event) === 'lease'
      && this.tell('warn', 'take_first'));
  }

  wish() {
    const {limits} = this.line.seat;
    return {linear: (limits.linear_m_s || 0) * this.share,
      angular: (limits.angular_rad_s || 0) * Math.sqrt(this.share)};
  }

  tick() {
    this.gamepads.poll();
    this.hand.changed();
    this.showLink();
  }

  // ---- who drives --------------------------------------------------------------------------

  show() {
    const {t} = this.context;
    const {state, by, connected, limits} = this.line.seat;
    const mayBe = connected && limits.linear_m_s > 0;
    tone(this.element, 'seat', state);
    replace(this.seat, ...this.seatOf(state, this.nameOf(by), mayBe));
    attribute(this.stick.element, 'aria-disabled', String(state !== 'yours'));
    if (connected && !limits.linear_m_s) {
      replace(this.seat, h('p', t('drive.cannot')));
    }
    this.showLimit();
    this.showLink();
    this.showRobot();
  }

  seatOf(state, by, mayBe) {
    const {t} = this.context;
    if (state === 'yours') {
      return [badge('accent', t('drive.you_drive'), 'check'),
        button(t('drive.give'), () => this.line.give(), {icon: 'leave'})];
    }
    if (state === 'other') {
      return [badge('warn', t('drive.other_drives', {name: by}), 'person'),
        button(t('drive.take_over'), () => this.takeOver(by))];
    }
    const take = button(t('drive.take'), () => this.take(false), {kind: 'primary', icon: 'drive'});
    attribute(take, 'disabled', !mayBe || state !== 'free');
    return [take, !mayBe && h('p.small.muted', t('drive.not_there'))];
  }

  nameOf(by) {
    const {user, t} = this.context;
    return by && user && by === user.name ? t('drive.you_elsewhere') : by;
  }

  take(over) {
    this.tell();
    this.line.take(over);
    this.stick.element.focus({preventScroll: true});
  }

  async takeOver(name) {
    const {t} = this.context;
    const yes = await ask({title: t('drive.take_over_title', {name}),
      text: t('drive.take_over_text', {name}), yes: t('drive.take_over'), no: t('drive.no'),
      kind: 'danger'});
    if (yes !== null) {
      this.take(true);
    }
  }

  lost({by}) {
    this.hand.letGo('lease');
    this.tell('critical', 'lost', {name: this.nameOf(by)});
  }

  refused({why, by}) {
    this.tell('warn', why === 'held' ? 'held' : why === 'cannot' ? 'cannot' : 'not_there',
      {name: this.nameOf(by)});
  }

  opened(why) {
    if (why !== 'open' && why !== 'leave' && why !== 'lease') {
      this.tell('warn', `opened_${why}`);
    }
  }

  /** Tell something that stays until the hand closes again; nothing takes it away. */
  tell(kind = '', key = '', values = {}) {
    const {t} = this.context;
    const text = key && t(`drive.${key}`, values);
    replace(this.told, text && h(`p.drive-note.tone-${kind}`, icon('warn'), h('span', text)));
    if (kind === 'critical') {
      announce(text, true);
    }
  }

  // ---- what is known -----------------------------------------------------------------------

  showLink() {
    const {t} = this.context;
    const {whyNot, rttMs, beat, isMine} = this.line;
    const isArmed = !isMine || whyNot || !beat || beat.armed || !this.hand.isClosed;
    const [kind, key, name] = whyNot && whyNot !== 'lease' ? ['critical', whyNot, 'offline']
      : !isMine ? ['none', 'ready', 'info'] : !isArmed ? ['warn', 'open_first', 'warn']
        : rttMs > GOOD_MS ? ['warn', 'fair', 'warn'] : ['ok', 'good', 'check'];
    setBadge(this.link, kind, t(`drive.link_${key}`), name);
    this.element.classList.toggle('is-frozen', kind === 'critical');
    write(this.rtt, this.context.format.unit(rttMs, 'ms'));
    write(this.pad, t(this.gamepads.isThere ? 'drive.gamepad_there' : 'drive.gamepad_none'));
    if (beat && beat.speed) {
      this.showSpeed(beat.speed);
    }
    if (beat) {
      this.showReason(saidOf(t, beat, 'stop_reason'), textOf(beat.steering));
    }
  }

  showRobot() {
    if (this.line.beat) {
      return;
    }
    const {state} = this.context;
    if (!isUp(state, state.robots.get(this.robot.id) || {})) {
      // What it said last is not what it does.
      write(this.reason, '');
      write(this.speed, '–');
      this.released.hidden = true;
      return;
    }
    const value = (name) => state.signal(this.robot.id, name)?.value;
    this.showReason(saidSignal(this.context, this.robot.id, 'stop_reason'),
      textOf(value('steering')));
    if (value('speed')) {
      this.showSpeed(value('speed'));
    }
  }

  showSpeed({linear_m_s: linear}) {
    write(this.speed, this.context.format.unit(rounded(linear), 'm/s', 2));
  }

  showReason(reason, steering) {
    const {t, permissions} = this.context;
    const held = steering.startsWith(ESTOP);
    writeSaid(this.reason, held ? {text: t('drive.stopped'), lang: null} : reason);
    this.reason.classList.toggle('is-held', held);
    this.released.hidden = !held || !permissions.has('acknowledge');
  }

  showLimit() {
    const {format} = this.context;
    const {linear} = this.wish();
    write(this.limit, linear ? format.unit(rounded(linear), 'm/s', 2) : format.percent(this.share));
  }

  async release() {
    const {t} = this.context;
    const yes = await ask({title: t('drive.release_title'), text: t('drive.release_text'),
      yes: t('drive.release'), no: t('drive.no')});
    if (yes !== null) {
      await release(this.context, this.robot);
    }
  }

  robotChanged(robot) {
    this.robot = robot;
    this.picture.robotChanged(robot);
    this.offerCall();
  }

  close() {
    this.line.end();
    this.keys.end();
    this.gamepads.end();
    this.picture.close();
    this.voice?.close();
    this.ends.forEach((each) => each());
  }
}

/** Signals of text come as the text, or as the message with it. */
function textOf(value) {
  return value && typeof value === 'object' ? value.data || value.text || '' : value || '';
}

function rounded(value) {
  const found = Math.round(value * 100) / 100;
  return found === 0 ? 0 : found;
}
