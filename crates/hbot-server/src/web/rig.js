// What the page knows of the rig. It changes with what arrives from the server and with what the
// person asks, and it draws nothing. The rules are those of the panel (docs/panel.md).

import { between, conjugate, length, normalised, product, rotation } from './maths.js';

/** If no state arrives for this time, the server is silent, ms. */
const SILENT_AFTER = 1500;
/** While a stop is not confirmed, a silence of this time is enough, ms. */
const SILENT_AFTER_STOP = 500;
/** A stop that is not confirmed after the first time is told, and after the second an alarm, ms. */
const [CONFIRMED_SOON, CONFIRMED_WITHIN] = [200, 1000];
/** Samples are kept for this time, s. */
export const SPAN = 10;
const MOST_MESSAGES = 100;
const MOST_SAMPLES = 4000;

const TORQUE = new Set(['enabling', 'active']);
/** Returns whether the motors can have torque in this mode. */
export const hasTorque = (mode) => TORQUE.has(mode);

/** Units of what makes a torque at rest. */
export const PUSHES = /^(N m(\/rad)?|kg)$/;

/** A speed is judged by its largest value in this time, so that what is said does not flicker, s. */
const RECENT = 0.5;
/** After a turn by this angle, the reason why the server has refused to enable may be gone, rad. */
const TURNED = 0.1;
/** The torque is at its limit if it is this part of it or more for so long, s. */
const [AT_LIMIT, AT_LIMIT_S] = [0.95, 0.2];
/** Part of the torque that the limits cut: the least that is told. */
export const LEAST_TOLD = 0.01;

/** The end of the message about a client that has taken over. */
const TAKEN = ' has taken over command';

export class Rig {
  /** `ownName` is what other clients know this page by. */
  constructor(ownName) {
    this.ownName = ownName;
    this.hello = null;
    this.info = null;
    /** Whether the rig was simulated, as the server said last. Another one may be there now. */
    this.wasSimulated = null;
    /** The last state of all servers. */
    this.lastState = null;
    /** When it came. */
    this.heardState = null;
    /** The size of its torque, as all words say it, N m. */
    this.told = '';
    this.lease = { who: 'unknown' };
    /** Numbers of this page's connections, to recognise what it has done itself. */
    this.own = new Set();
    this.messages = [];
    this.closed = null;
    this.stop = null;
    this.wishes = new Map();
    /** What the server warns of in the scene, in parts: `{ effect, what, why, remedy, shakes }`. */
    this.warnings = [];
    /** Up to which stiffness the scene is stable, as the server said last. */
    this.stable = [];
    /** Torque of the scene against angle about n1, n2, n3, as the server said last. */
    this.curves = null;
    /** The name and the effects of the scene that these curves belong to. */
    this.curved = { effects: [] };
    this.forget();
  }

  /** Forgets what a server has said of its present run. */
  forget() {
    this.state = null;
    this.samples = [];
    /** From what the newest angle is measured. */
    this.origin = 'N';
    this.fault = null;
    /** The fault that the rig was in when it was stopped. */
    this.faultBefore = null;
    this.shaking = null;
    /** What the server refused last: `{ op, why, q }`, with the orientation of the sphere then. */
    this.refusal = null;
    this.heard = performance.now();
    this.wishes.clear();
  }

  opened(hello) {
    // A server gives each connection a higher number. If not, it has started again.
    if ([...this.own].some((number) => number >= hello.session)) this.own.clear();
    this.own.add(hello.session);
    this.forget();
    this.hello = hello;
    this.closed = null;
    this.info = null;
    this.lease = { who: 'unknown' };
    // The ticks can begin again at 0, and all states of this connection come after the stop.
    if (this.stop) Object.assign(this.stop, { after: null, again: true });
    this.say(`connected to ${hello.server}, ${hello.rig}`);
  }

  lost(closed) {
    if (this.hello) this.say(`connection lost: ${closed.why}`, 'bad');
    this.hello = null;
    this.closed = closed;
    this.state = null;
    this.lease = { who: 'unknown' };
    this.wishes.clear();
  }

  /**
   * Notes a message. `weight` is 'bad' for a fault or lost contact, 'warn' for take-over, shaking or a refusal. `log` is
   * the path of its flight log.
   */
  say(text, weight = '', log = null) {
    const last = this.messages[0];
    if (last?.text === text) {
      Object.assign(last, { log, at: new Date(), times: last.times + 1 });
    } else {
      this.messages.unshift({ text, weight, log, at: new Date(), times: 1 });
      this.messages.length = Math.min(this.messages.length, MOST_MESSAGES);
    }
    this.spoke = true;
  }

  take(info) {
    this.info = info;
    this.wasSimulated = info.rig.simulated;
    this.warnings = info.advice ?? [];
    // The server takes up to a second to know it of a changed scene. The last answer stays until then.
    this.stable = info.stable ?? this.stable;
    if (info.curves) {
      this.curves = info.curves;
      this.curved = structuredClone({ name: info.scene?.name, effects: info.scene?.effect ?? [] });
    }
    // The page may have come after the stop, or while the sphere shakes.
    this.fault ??= info.incident ?? null;
    this.shaking ??= info.shaking ?? null;
    if (this.lease.who === 'unknown' && info.lease) {
      this.leased(info.lease.holder, info.lease.session);
    }
  }

  leased(holder, session) {
    if (session === null) this.lease = { who: 'free' };
    else if (session === this.hello?.session) this.mine();
    else this.lease = { who: 'other', by: { name: holder, session } };
  }

  mine() {
    if (this.lease.who !== 'mine') this.mineSince = performance.now();
    this.lease = { who: 'mine' };
    // What is over is no warning any more.
    for (const message of this.messages) if (message.text.endsWith(TAKEN)) message.weight = '';
    this.spoke = true;
  }

  /** Takes an event. Returns whether `info` has changed with it. */
  event(message) {
    switch (message.event) {
      case 'state':
        this.sample(message);
        return false;
      case 'fault': {
        const stopped = message.mode === 'fault' || message.mode === 'estop';
        const by = message.by && message.mode !== 'fault' ? ` by ${this.name(message.by)}` : '';
        const said = by && stopped ? 'stopped' : message.message;
        this.say(`${message.fault ?? message.mode}: ${said}${by}`, message.mode === 'fault' ? 'bad' : '', message.flight_log);
        const before = this.fault?.mode === 'fault' ? this.fault : this.faultBefore;
        this.faultBefore = message.mode === 'estop' ? before : null;
        this.fault = stopped ? message : null;
        return false;
      }
      case 'lease':
        if (this.lease.who === 'mine' && message.cause === 'stolen') {
          this.say(`${this.name({ name: message.holder, session: message.session })}${TAKEN}`, 'warn');
        }
        this.leased(message.holder, message.session);
        return false;
      case 'scene':
        this.refusal = null;
        this.say(`scene: ${message.name}${message.by ? `, loaded by ${this.name(message.by)}` : ''}`);
        this.wishes.clear();
        return true;
      case 'set':
        this.refusal = null;
        this.warnings = message.advice ?? [];
        Object.assign(this.info?.scene?.effect?.find(({ id }) => id === message.effect) ?? {}, message.parameters);
        return false;
      case 'shaking':
        this.say(message.message, message.shaking ? 'warn' : '');
        this.shaking = message.shaking ? message : null;
        return false;
      case 'stopping':
        this.say(message.message, 'bad');
        return false;
      default:
        return false;
    }
  }

  sample(state) {
    // The message about a stop can overtake the states before it.
    const stopped = state.mode === 'fault' || state.mode === 'estop';
    // What was refused has come about, perhaps by another client.
    if (!stopped && (this.refusal?.op === 'reset' || hasTorque(state.mode))) this.refusal = null;
    if (this.refusal?.op === 'enable' && length(between(this.refusal.q ?? state.q, state.q)) > TURNED) this.refusal = null;
    if (this.fault && state.tick > this.fault.tick && !stopped) this.fault = this.faultBefore = null;
    const stop = this.stop;
    if (stop && (stop.after === null || state.tick > stop.after) && !hasTorque(state.mode)) {
      this.stop = null;
    }
    this.state = this.lastState = state;
    this.heard = this.heardState = performance.now();
    this.origin = state.reference ? 'reference' : 'N';
    this.samples.push({ t: state.t, omega: state.omega, torque: state.torque, scale: state.scale,
      mode: state.mode, reference: state.reference, angle: this.deflection(state) });
    const old = state.t - SPAN - 1;
    if (this.samples.length > MOST_SAMPLES || this.samples[0].t < old - 1) {
      this.samples = this.samples.filter((sample) => sample.t >= old).slice(-MOST_SAMPLES);
    }
  }

  /** Returns the rotation vector from the reference, or from frame N without one, rad. */
  deflection(state) {
    return between(state.reference ?? [1, 0, 0, 0], state.q);
  }

  /**
   * Returns the angle from the scene's anchor, rad, and the torque, N m, about n1, n2 and n3. The
   * anchor is where the sphere was when the scene began, or frame N. Null without a state.
   */
  get present() {
    const { state } = this;
    if (!state) return null;
    const effect = this.info?.scene?.effect?.find((effect) => effect.reference);
    const anchor = state.reference
      ? product(conjugate(normalised(effect?.reference ?? [1, 0, 0, 0])), state.reference) : [1, 0, 0, 0];
    return { angle: rotation(product(state.q, conjugate(anchor))), torque: state.torque };
  }

  /**
   * Returns the curves, and whether they are `old`: the server has not told them since the scene
   * has changed. There are none while those of another scene were told last. By its unit, the
   * torque at rest is proportional to all that makes it together. So the curves follow a single
   * parameter at once, but for the little that damping adds to them.
   */
  get presentCurves() {
    const { name, effect: effects = [] } = this.info?.scene ?? {};
    const { curved } = this;
    const names = (all) => all.map(({ id, kind }) => `${id} ${kind}`).join('\n');
    if (this.info && (name !== curved.name || names(effects) !== names(curved.effects))) return { old: true, curves: [] };
    let [factor, changes, pushing] = [1, 0, 0];
    for (const [k, effect] of effects.entries()) {
      for (const [key, { unit = '' }] of Object.entries(this.kind(effect.kind)?.schema.properties ?? {})) {
        const [before, now] = [curved.effects[k][key], this.value(effect, key)];
        if (PUSHES.test(unit) && (before || now)) pushing += 1;
        if (JSON.stringify(before) === JSON.stringify(now)) continue;
        changes += 1;
        factor = PUSHES.test(unit) && before > 0 ? now / before : NaN;
      }
    }
    const part = changes === 1 && pushing === 1 && Number.isFinite(factor) ? factor : 1;
    return { old: !this.info || changes > 0, curves: this.curves.map((curve) => curve.map(([angle, torque]) => [angle, part * torque])) };
  }

  last(seconds, of = 'omega') {
    return this.samples.filter(({ t }) => t >= this.state.t - seconds).map((sample) => sample[of]);
  }

  /** Whether the sphere pushes, and its torque has been at the rig's limit for a while. */
  get isAtLimit() {
    const limit = this.info?.limits.torque;
    return hasTorque(this.state?.mode) && limit > 0 && this.last(AT_LIMIT_S, 'torque').every((it) => length(it) >= AT_LIMIT * limit);
  }

  /** Returns what cuts the torque. Other limits than these do not show in the state. */
  get limit() {
    const limit = this.info?.limits.torque;
    if (this.state.traction >= 1) return 'Friction cuts';
    return limit > 0 && length(this.state.torque) >= AT_LIMIT * limit ? 'The torque limit cuts' : 'Limits cut';
  }

  /** Whether the limits have cut the torque for a while. */
  get isCut() {
    return this.last(AT_LIMIT_S, 'mode').every((it) => it === 'active')
      && this.last(AT_LIMIT_S, 'scale').every((it) => 1 - it >= LEAST_TOLD);
  }

  /** Returns the names of the parameters that make a torque at rest, by the units that `info` tells. */
  get pushing() {
    const names = (this.info?.scene?.effect ?? []).flatMap((effect) => (
      Object.entries(this.kind(effect.kind)?.schema.properties ?? {})
        .filter(([key, { unit = '' }]) => PUSHES.test(unit) && this.value(effect, key))
        .map(([key]) => key.replaceAll('_', ' '))));
    return [...new Set(names)];
  }

  /** Returns the warnings that the scene may shake the sphere. */
  get unstable() {
    return this.warnings.filter(({ shakes }) => shakes);
  }

  /** Returns the largest speed of the last moments, rad/s. */
  get fastest() {
    return this.state ? Math.max(...this.last(RECENT).map(length)) : 0;
  }

  /** Whether the server has found that the sphere shakes by itself. */
  get shakes() {
    return this.shaking !== null && hasTorque(this.state?.mode);
  }

  /** Whether the server refuses a reset because the sphere is still as fast as in the fault. */
  get isFast() {
    const limit = this.info?.limits.speed;
    return this.state?.fault === 'overspeed' && limit > 0 && this.fastest > limit;
  }

  /** Returns who asked for something, as the person at this page would say it. */
  name(by) {
    if (by.session === null) return `the signal ${by.name}`;
    if (this.own.has(by.session)) return 'you';
    // Clients of one name have the numbers of their connections.
    const holder = this.lease.by;
    const alike = by.name === this.ownName || (by.name === holder?.name && by.session !== holder.session);
    return `${by.name.replace(/^panel /, '')}${alike ? ` (session ${by.session})` : ''}`;
  }

  /** Notes that the person has asked for a stop. The time limit begins with the first request. */
  asksStop() {
    // What was sent to a server that is gone is over.
    if (this.stop?.again) this.stop = null;
    this.stop ??= { asked: performance.now(), after: this.state?.tick ?? null, why: null };
    this.spoke = true;
  }

  stopFailed(why) {
    if (this.stop) this.stop.why ??= why;
    this.say(this.isSimulated ? `not stopped: ${why}` : `${why}: cut the motors' power`, 'bad');
  }

  get unconfirmedStop() {
    const stop = this.stop;
    const late = stop && performance.now() - stop.asked > CONFIRMED_WITHIN;
    return stop && (stop.why !== null || late) ? stop : null;
  }

  /** Whether a stop has been on its way for longer than usual. */
  get isStopping() {
    return this.stop !== null && performance.now() - this.stop.asked > CONFIRMED_SOON;
  }

  /** Returns who else has stopped the rig, or null. */
  get stopper() {
    const by = this.fault?.by;
    return this.state?.mode === 'estop' && by && !this.own.has(by.session) ? by : null;
  }

  /** Returns the time since the last state if it is too long, s. Otherwise null. */
  get silentFor() {
    const silent = performance.now() - this.heard;
    return this.hello && silent > (this.unconfirmedStop ? SILENT_AFTER_STOP : SILENT_AFTER) ? silent / 1000 : null;
  }

  /** Notes the torque that all words say until the next call, so that no two differ. */
  tell() {
    if (this.lastState) this.told = length(this.lastState.torque).toFixed(2);
  }

  get isLive() {
    return this.hello !== null && this.state !== null && this.silentFor === null;
  }

  get isCertain() {
    return this.isLive && (!this.unconfirmedStop || this.isBack);
  }

  /** Whether a connection that was made after the stop shows what the rig does. */
  get isBack() {
    return Boolean(this.unconfirmedStop?.again) && this.isLive;
  }

  get commands() {
    return this.isLive && this.lease.who === 'mine';
  }

  /** Null without a connection: the next server there may have another rig. */
  get isSimulated() {
    return this.hello ? this.info?.rig.simulated ?? null : null;
  }

  /** Returns what the person must know first: a word of the panel. */
  get headline() {
    if (this.unconfirmedStop) return 'NOT STOPPED';
    if (!this.hello) return this.closed ? 'NO CONTACT' : 'CONNECTING';
    if (this.silentFor !== null) return 'NO CONTACT';
    return this.state ? this.state.mode.toUpperCase() : 'NO STATE';
  }

  /** Returns the angle between the sphere and the scene's reference, rad. Null without one. */
  get away() {
    return this.state?.reference ? length(this.deflection(this.state)) : null;
  }

  /** Whether the sphere is so far from the reference that the server may refuse to enable. */
  get isFar() {
    return this.state !== null && !hasTorque(this.state.mode) && !this.beginsHere
      && this.away > this.info?.limits.enable_max_angle;
  }

  /** Whether the effect whose reference counts is placed where the sphere is when it is enabled. */
  get beginsHere() {
    const placed = (this.info?.scene?.effect ?? []).map((effect) => (
      effect.anchor ?? this.kind(effect.kind)?.schema.properties?.anchor?.default));
    return placed.find((anchor) => anchor !== undefined) === 'here';
  }

  kind(name) {
    return this.info?.effects.find((kind) => kind.name === name);
  }

  /** Returns the value of a parameter: a wish that is not answered yet, or else what is used. */
  value(effect, key) {
    const wish = this.wishes.get(`${effect.id} ${key}`);
    return wish === undefined ? effect[key] : wish;
  }
}
