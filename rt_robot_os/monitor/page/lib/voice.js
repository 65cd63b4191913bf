// @ts-check
/**
 * Talk with whoever is beside a robot: WebRTC between this browser and the robot itself; only what
 * sets it up goes over the server. Nothing is sent to anybody until one speaks: push to talk.
 */

import {attribute, h, replace, tone, write} from './dom.js';
import {button, notice, segments} from './parts.js';
import {saidOf} from './said.js';

const METER_MS = 100;
const GATHER_MS = 2000;
const QUIET_DB = -60;
const SOUND = {audio: {echoCancellation: true, noiseSuppression: true, autoGainControl: true}};
const STATES = {idle: 'none', asking: 'none', ringing: 'warn', connected: 'ok', ended: 'none'};

/** Why this browser gives no microphone: '' when it does. */
export function whyNoMicrophone() {
  if (!window.isSecureContext) {
    return 'voice.insecure';
  }
  return navigator.mediaDevices && window.RTCPeerConnection ? '' : 'voice.unable';
}

/**
 * Offer a call.
 * @param {Object} context of the view
 * @param {{robot: string}} what the id of the robot
 * @returns {{element: HTMLElement, close: function(): void, call: Call}}
 */
export function voiceOf(context, {robot}) {
  const panel = new Panel(context, robot);
  context.t.words.load('voice').then(() => panel.isClosed || panel.draw());
  return {element: panel.element, close: () => panel.close(), call: panel.call};
}

/** A call, without anything to see; 'change' tells of each new state. */
export class Call extends EventTarget {
  constructor(robot) {
    super();
    this.robot = robot;
    this.state = 'idle';
    this.why = '';
    this.isOpen = false;
    this.speaker = h('audio', {autoplay: true});
  }

  get isOn() {
    return ['asking', 'ringing', 'connected'].includes(this.state);
  }

  become(state, why = '') {
    this.state = state;
    this.why = why;
    this.dispatchEvent(new Event('change'));
  }

  /** Ring; the robot takes the call by itself, and says there that somebody calls. */
  async start() {
    if (this.isOn) {
      return;
    }
    this.become('asking');
    try {
      this.mine = await navigator.mediaDevices.getUserMedia(SOUND);
    } catch (error) {
      this.end(error.name === 'NotAllowedError' ? 'voice.denied' : 'voice.no_device');
      return;
    }
    if (this.state !== 'asking') {
      this.stop();
      return;
    }
    this.mute(!this.isOpen);
    this.peer = new RTCPeerConnection({iceServers: []});
    this.mine.getTracks().forEach((track) => this.peer.addTrack(track, this.mine));
    this.peer.ontrack = ({streams, track}) => this.hear(streams[0] || new MediaStream([track]));
    this.peer.onconnectionstatechange = () => this.looked();
    await this.peer.setLocalDescription(await this.peer.createOffer());
    await gathered(this.peer);
    this.ring();
  }

  ring() {
    if (this.state !== 'asking') {
      return;
    }
    const address = new URL('/voice', location.href);
    address.protocol = address.protocol.replace('http', 'ws');
    this.socket = new WebSocket(address);
    this.socket.onopen = () => this.say({kind: 'ring', robot: this.robot,
      sdp: this.peer.localDescription.sdp});
    this.socket.onmessage = (event) => this.heard(JSON.parse(event.data));
    this.socket.onclose = () => this.end('voice.lost');
    this.become('ringing');
  }

  say(message) {
    if (this.socket && this.socket.readyState === WebSocket.OPEN) {
      this.socket.send(JSON.stringify(message));
    }
  }

  async heard(message) {
    if (message.kind === 'answer') {
      await this.peer.setRemoteDescription({type: 'answer', sdp: message.sdp});
    } else if (message.kind === 'ended') {
      this.end(message.why ? message : 'voice.over');
    }
  }

  hear(stream) {
    this.theirs = stream;
    this.speaker.srcObject = stream;
    this.speaker.play().catch(() => {});
    this.dispatchEvent(new Event('stream'));
  }

  looked() {
    const state = this.peer && this.peer.connectionState;
    if (state === 'connected' && this.state === 'ringing') {
      this.become('connected');
    } else if (state === 'failed') {
      this.end('voice.no_way');
    }
  }

  /** Whether the microphone is heard at the robot. */
  mute(isMuted) {
    this.isOpen = !isMuted;
    if (this.mine) {
      this.mine.getAudioTracks().forEach((track) => {
        track.enabled = !isMuted;
      });
    }
    this.dispatchEvent(new Event('change'));
  }

  hangUp() {
    this.say({kind: 'hang_up'});
    this.end('voice.over');
  }

  end(why) {
    const wasOn = this.isOn;
    this.stop();
    if (wasOn) {
      this.become('ended', why);
    }
  }

  stop() {
    if (this.socket) {
      this.socket.onclose = this.socket.onmessage = null;
      this.socket.close(1000);
    }
    this.peer?.close();
    this.mine?.getTracks().forEach((track) => track.stop());
    this.speaker.srcObject = null;
    this.socket = this.peer = this.mine = this.theirs = null;
  }
}

/** Wait until the browser knows its own addresses; without other servers that takes no time. */
function gathered(peer) {
  return new Promise((done) => {
    if (peer.iceGatheringState === 'complete') {
      done();
    }
    peer.onicegatheringstatechange = () => peer.iceGatheringState === 'complete' && done();
    setTimeout(done, GATHER_MS);
  });
}

class Panel {
  constructor(context, robot) {
    this.context = context;
    this.robot = robot;
    this.mode = 'push';
    this.call = new Call(robot);
    this.element = h('section.voice', {onkeydown: (event) => this.key(event, true),
      onkeyup: (event) => this.key(event, false)});
    this.call.addEventListener('change', () => this.look());
    this.call.addEventListener('stream', () => this.meters());
    this.off = context.state.on('robots', () => this.look());
  }

  close() {
    this.isClosed = true;
    this.off();
    this.call.hangUp();
    this.endMeters();
    removeEventListener('blur', this.onBlur);
  }

  draw() {
    const {t} = this.context;
    const why = whyNoMicrophone();
    if (why) {
      replace(this.element, h('h2', t('voice.title')), notice('empty', t(why), t(`${why}_text`)));
      return;
    }
    this.status = h('p.voice-state', {role: 'status'});
    this.begin = button(t('voice.call'), () => this.call.start(), {kind: 'primary', icon: 'phone'});
    this.finish = button(t('voice.hang_up'), () => this.call.hangUp(),
      {kind: 'danger', icon: 'hangup'});
    this.push = button(t('voice.push'), () => {}, {icon: 'talk'});
    this.push.classList.add('voice-push');
    this.push.onpointerdown = (event) => this.press(event);
    this.push.onpointerup = this.push.onpointercancel = () => this.release();
    this.push.onlostpointercapture = this.push.onblur = () => this.release();
    this.onBlur = () => this.release();
    addEventListener('blur', this.onBlur);
    this.modes = segments(t('voice.mode'), {push: t('voice.mode_push'), open: t('voice.mode_open')},
      this.mode, (mode) => this.choose(mode));
    this.mineMeter = meter(t('voice.mine'));
    this.theirMeter = meter(t('voice.theirs'));
    this.inCall = h('div.voice-controls', this.push, this.modes,
      h('div.voice-meters', this.mineMeter.element, this.theirMeter.element));
    replace(this.element, h('div.section-head', h('h2', t('voice.title')), this.begin, this.finish),
      this.status, this.inCall, h('p.help', t('voice.help')));
    this.look();
  }

  /** Another person's call with this robot, or null. */
  other() {
    const robot = this.context.state.robots.get(this.robot);
    return (robot && robot.call && !this.call.isOn && robot.call) || null;
  }

  look() {
    if (!this.status) {
      return;
    }
    const {t, state} = this.context;
    const {call} = this;
    const robot = state.robots.get(this.robot);
    const other = this.other();
    this.begin.hidden = call.isOn;
    this.begin.disabled = Boolean(other) || !robot || !robot.connected;
    this.finish.hidden = !call.isOn;
    this.inCall.hidden = !call.isOn;
    this.push.hidden = this.mode !== 'push';
    attribute(this.push, 'aria-pressed', String(call.isOpen));
    tone(this.element, 'voice', STATES[call.state]);
    write(this.status, this.words(call, other));
    if (!call.isOn) {
      this.endMeters();
    }
  }

  words(call, other) {
    const {t} = this.context;
    if (other) {
      return t('voice.busy', {name: other.by || t('voice.somebody')});
    }
    if (call.state === 'ended') {
      return typeof call.why === 'string' ? t(call.why) : saidOf(t, call.why, 'why').text;
    }
    return call.state === 'connected'
      ? t(call.isOpen ? 'voice.heard' : 'voice.listening') : t(`voice.${call.state}`);
  }

  choose(mode) {
    this.mode = mode;
    this.call.mute(mode === 'push');
  }

  press(event) {
    this.push.setPointerCapture(event.pointerId);
    if (this.mode === 'push') {
      this.call.mute(false);
    }
  }

  release() {
    if (this.mode === 'push' && this.call.isOpen) {
      this.call.mute(true);
    }
  }

  key(event, isDown) {
    if (event.key === ' ' && event.target === this.push && this.mode === 'push') {
      event.preventDefault();
      if (!event.repeat) {
        this.call.mute(!isDown);
      }
    }
  }

  meters() {
    this.endMeters();
    const sound = new AudioContext();
    const mine = analyser(sound, this.call.mine);
    const theirs = analyser(sound, this.call.theirs);
    const timer = setInterval(() => {
      this.mineMeter.show(this.call.isOpen ? loudness(mine) : QUIET_DB);
      this.theirMeter.show(loudness(theirs));
    }, METER_MS);
    this.endMeters = () => {
      clearInterval(timer);
      sound.close();
      this.endMeters = () => {};
    };
  }

  endMeters() {}
}

function analyser(sound, stream) {
  const found = sound.createAnalyser();
  found.fftSize = 2048;
  sound.createMediaStreamSource(stream).connect(found);
  return found;
}

/** How loud it is, in dB below full scale. */
function loudness(node) {
  const samples = new Float32Array(node.fftSize);
  node.getFloatTimeDomainData(samples);
  const power = samples.reduce((sum, each) => sum + each * each, 0) / samples.length;
  return power > 0 ? Math.max(QUIET_DB, 10 * Math.log10(power)) : QUIET_DB;
}

function meter(label) {
  const bar = h('meter', {min: 0, max: 100, value: 0, 'aria-label': label});
  return {
    element: h('label.voice-meter', h('span', label), bar),
    show: (db) => {
      bar.value = Math.round(100 * (1 - db / QUIET_DB));
    },
  };
}
