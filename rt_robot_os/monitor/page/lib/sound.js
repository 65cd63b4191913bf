// @ts-check
/**
 * The sound of alarms: short bursts of tones, made by the browser; no file. Browsers play nothing
 * before somebody has touched the page, so it has to be switched on once a visit.
 */

// Hz of the tones of a burst, and how often a burst comes again while nobody has answered, in s.
const BURSTS = {
  critical: {tones: [660, 830, 990, 660, 990], againS: 8},
  urgent: {tones: [590, 740, 590], againS: 20},
  warning: {tones: [520, 520], againS: 60},
  // Falling: alarms may be missed.
  outage: {tones: [440, 330, 262], againS: 20},
};
const TONE_S = 0.16;
const GAP_S = 0.07;
const LOUDNESS = 0.25;

export class Sound extends EventTarget {
  constructor(isWanted) {
    super();
    this.isWanted = isWanted;
    this.audio = null;
    this.level = null;
    this.isOutage = false;
    this.timer = 0;
    // Any touch of the page counts for the browser.
    const wake = () => this.isWanted && this.wake();
    addEventListener('pointerdown', wake, {capture: true, passive: true});
    addEventListener('keydown', wake, {capture: true, passive: true});
  }

  /** off; on; or blocked: wanted, but the browser waits for a touch. */
  get state() {
    if (!this.isWanted) {
      return 'off';
    }
    return this.audio && this.audio.state === 'running' ? 'on' : 'blocked';
  }

  /** Switch it; called from a touch it may play from now on, and does so once, to be heard. */
  async switch(isWanted) {
    this.isWanted = isWanted;
    if (isWanted) {
      await this.wake();
      this.play('warning');
    }
    this.schedule();
    this.dispatchEvent(new Event('change'));
  }

  async wake() {
    if (this.audio && this.audio.state === 'running') {
      return;
    }
    this.audio = this.audio || new AudioContext();
    try {
      await this.audio.resume();
    } catch (error) {
      // It stays blocked, and the page says so.
    }
    this.dispatchEvent(new Event('change'));
  }

  /** Sound for the worst alarm that nobody has answered; null is none. */
  alarm(level) {
    if (level !== this.level) {
      this.level = level in BURSTS ? level : null;
      this.schedule();
    }
  }

  /** Sound while alarms may be missed and no alarm sounds by itself. */
  outage(isOutage) {
    if (isOutage !== this.isOutage) {
      this.isOutage = isOutage;
      if (!this.level) {
        this.schedule();
      }
    }
  }

  schedule() {
    clearInterval(this.timer);
    const level = this.level || (this.isOutage ? 'outage' : null);
    if (level && this.isWanted) {
      this.play(level);
      this.timer = setInterval(() => this.play(level), BURSTS[level].againS * 1000);
    }
  }

  play(level) {
    if (this.state !== 'on') {
      return;
    }
    let at = this.audio.currentTime + 0.02;
    for (const tone of BURSTS[level].tones) {
      this.tone(tone, at);
      at += TONE_S + GAP_S;
    }
  }

  tone(hz, at) {
    const source = this.audio.createOscillator();
    const loudness = this.audio.createGain();
    source.type = 'triangle';
    source.frequency.value = hz;
    loudness.gain.setValueAtTime(0, at);
    loudness.gain.linearRampToValueAtTime(LOUDNESS, at + 0.02);
    loudness.gain.setValueAtTime(LOUDNESS, at + TONE_S - 0.04);
    loudness.gain.linearRampToValueAtTime(0, at + TONE_S);
    source.connect(loudness).connect(this.audio.destination);
    source.start(at);
    source.stop(at + TONE_S);
  }
}
