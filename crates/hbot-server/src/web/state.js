// The state of the rig in words: badge, headline, what to do, the buttons' rights and the bars.

import { LEAST_TOLD, hasTorque } from './rig.js';
import { length } from './maths.js';

/** From this rate on, the page says that the sphere still turns without torque, rad/s. */
const TURNS = 0.1;
/** From this rate on, nobody is asked to give it torque again, rad/s. A simulated hand sways more slowly. */
const SPINS = 2;
/** Part of the torque that the limits cut: the least that its bar shows. */
const LEAST_SHOWN = 0.0005;
/** Part of a limit from which a bar says that it is near. */
const NEAR = 0.7;

const $ = (id) => document.getElementById(id);

/** Sets the text of an element, if it has changed. */
export function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Whether the page is used with a finger, which has no keys. */
export const touch = matchMedia('(pointer: coarse)');

/** Where there is no room for all words: the window of a telephone. */
export const narrow = matchMedia('(max-height: 30rem), (max-width: 36rem)');

const METERS = [
  ['Torque', "of the sphere / the rig's limit"],
  ['Speed', "how fast the sphere turns / the rig's limit"],
  ['Traction', 'part of the friction between wheel and sphere that is in use'],
  ['Slip', "how fast a wheel slides on the sphere / the rig's limit"],
  // Whatever the limits cut, the scene does not feel as it is meant.
  ['Saturation', "part of the scene's torque that the rig's limits cut off", { low: LEAST_SHOWN, high: 1 }],
].map(([name, title, borders]) => {
  const row = document.createElement('div');
  row.title = title;
  const label = document.createElement('span');
  label.textContent = name;
  const meter = document.createElement('meter');
  meter.setAttribute('aria-label', name);
  Object.assign(meter, { min: 0, max: 1, low: NEAR, high: 0.9, optimum: 0, ...borders });
  const figures = document.createElement('span');
  row.append(label, meter, figures);
  return { row, meter, figures, name };
});
$('meters').append(...METERS.map(({ row }) => row));
/** What stays in sight where a long text covers the bars. */
const KEPT = METERS.slice(0, 2);

/** Returns what shows a text of the server: what stands between backticks is code. */
export const withCode = (text) => text.split('`').map((part, k) => (
  k % 2 === 0 ? part : Object.assign(document.createElement('code'), { textContent: part })));

/** What is said of a simulated rig in place of what to do about motors. */
const UNPOWERED = 'Simulated: nothing real moves.';

const sentence = (text) => `${text[0].toUpperCase()}${text.slice(1)}${/[.!?]$/.test(text) ? '' : '.'}`;

/** Returns the paragraphs below the headline: `[weight, text]`, and as a third the part of the text that is bold. */
function details(rig) {
  const head = rig.headline;
  const stop = rig.unconfirmedStop;
  const state = rig.state;
  const mode = rig.info?.modes?.find((mode) => mode.name === state?.mode)?.sentence ?? '';
  const ago = ((performance.now() - rig.heardState) / 1000).toFixed(0);
  const old = !rig.isLive && rig.lastState
    ? [['last', `Last heard: ${rig.lastState.mode.toUpperCase()}, ${rig.told} N m, ${ago} s ago`]] : [];
  if (stop) {
    const ends = 'This message ends when the rig reports a mode without torque.';
    // What was wrong is over where the rig is heard again.
    if (rig.isBack) {
      return [
        ['strong', `Connected again: the rig is ${state.mode.toUpperCase()} and pushes. Press STOP.`],
        ['strong', rig.isSimulated ? UNPOWERED : "If it pushes on, cut the motors' power."],
        ['', ends],
        ...old];
    }
    return [
      rig.isSimulated ? ['strong', UNPOWERED] : ['strong power', "Cut the motors' power."],
      ...old,
      ['', `Press ${touch.matches || !document.hasFocus() ? 'STOP' : 'STOP or Esc'} again. ${ends}`],
      ['', sentence(stop.why ?? 'the server has not confirmed the stop')]];
  }
  if (head === 'NO CONTACT') {
    const why = rig.silentFor === null
      ? `Not connected: ${rig.closed?.why ?? ''}. The page tries again by itself.`
      : 'The server says nothing.';
    return [
      rig.isSimulated ? ['', ''] : ['strong', "If in doubt, cut the motors' power."],
      ...old,
      ['bad', why],
      ['', `What the rig does now is not known. ${rig.isSimulated ? UNPOWERED : ''}`]];
  }
  if (!state) return [['weak', rig.hello ? 'Waiting for the first state.' : 'Not connected.']];
  const by = rig.fault?.by;
  if (state.mode === 'fault') {
    const words = rig.info?.faults?.find((fault) => fault.name === state.fault);
    const who = by ? ` It was ${rig.name(by)}.` : '';
    const { found, remedy } = rig.fault ?? {};
    const take = taking(rig);
    const goOn = `To go on: ${take && `${take}, `}Reset, then Enable.`;
    return [
      ['', `No torque. ${words?.sentence ?? state.fault}${who}`],
      ['warn', notReset(rig)],
      // Of a simulated rig, nothing has to be mended before.
      rig.isSimulated ? ['', `${goOn} ${remedy ?? ''}`, goOn] : ['', `${remedy ?? ''} ${goOn}`, remedy?.match(/^.*?\.( |$)/)?.[0]],
      ['weak', found && !narrow.matches ? `${state.fault}: ${found}` : state.fault]];
  }
  if (state.mode === 'estop') {
    const { fault: before, remedy } = rig.faultBefore ?? {};
    const what = rig.info?.faults?.find((fault) => fault.name === before)?.sentence ?? '';
    const who = `${by ? `Stopped by ${rig.name(by)}.` : mode}${rig.isSimulated ? '' : ' The motors still have power.'}`;
    return [['bad', narrow.matches ? '' : who], ['warn', notReset(rig)], ['', narrow.matches ? `${who} ${wayOn(rig)}` : wayOn(rig)],
      // How to go on stands above.
      ['bad', before ? `Before the stop: ${before}. ${what}` : ''], ['', remedy ?? '']];
  }
  if (rig.isStopping) return [['strong', 'STOP sent, not confirmed yet.']];
  if (rig.shakes) {
    const { effect, frequency } = rig.shaking;
    const { remedy } = rig.unstable.find((warning) => warning.effect === effect) ?? rig.unstable[0] ?? {};
    return [['strong warn', remedy ?? 'Lower the stiffness or raise the damping.'],
      ['warn', `Torque lowered: ${effect ?? 'the scene'} shook the sphere at ${frequency.toFixed(0)} Hz.`]];
  }
  if (isWarned(rig)) {
    const [first] = rig.unstable;
    return [['strong warn', first.remedy], ['warn', `Warning: ${brief(first)}.`]];
  }
  if (isFree(rig)) return [['free', 'Nobody commands. The sphere pushes on; STOP and Disable work.']];
  if (isStrained(rig)) {
    const few = narrow.matches || rig.warnings.length > 0;
    return [['strong cut', rig.pushing.length > 0 ? `Lower ${rig.pushing.slice(0, 2).join(' or ')}, or push less.` : 'Ask for less torque.'],
      ['', few ? '' : 'The scene asks for more torque than the limits let through.']];
  }
  if (state.mode === 'idle' && (rig.refusal?.op === 'enable' || rig.isFar)) return notEnabled(rig);
  // Motors can hurt a hand.
  return [[hasTorque(state.mode) && !rig.isSimulated ? 'strong' : 'weak', mode]];
}

const cure = (rig) => (rig.isSimulated ? 'Set the anchor to here.' : 'Turn the sphere nearer.');

/** Says that the server has refused or may refuse to enable. Only it knows the turns that the scene leaves free. */
function notEnabled(rig) {
  const allowed = rig.info.limits.enable_max_angle;
  return [['strong warn', rig.isFar ? cure(rig) : ''],
    ['warn', rig.refusal?.op === 'enable' ? `Not enabled: ${rig.refusal.why}`
      : `No torque. The sphere is ${rig.away.toFixed(2)} rad from the reference, and Enable is refused beyond `
      + `${allowed.toFixed(2)} rad unless the scene lets it turn that far.`]];
}

function notReset(rig) {
  if (rig.isFast) {
    return `The sphere must slow down before Reset: ${rig.fastest.toFixed(2)} rad/s, the limit is ${rig.info.limits.speed} rad/s.`;
  }
  return rig.refusal?.op === 'reset' ? `Not reset: ${rig.refusal.why}` : '';
}

/** Returns the button that gives command, if the person must press it first. */
const taking = (rig) => ({ mine: '', other: 'Take over' }[rig.lease.who] ?? 'Take command');

function wayOn(rig) {
  const take = taking(rig) && `press ${taking(rig)}, then `;
  const far = !rig.isFar || take ? '' : rig.isSimulated ? 'set the anchor to here, then ' : 'turn the sphere to its reference, then ';
  const press = take ? '' : 'press ';
  // A simulated sphere may spin for ever.
  const rest = !spins(rig) ? '' : rig.isSimulated ? 'hold the sphere, then ' : 'wait until the sphere rests, then ';
  return rig.stopper ? `To go on, make sure that nobody touches the sphere, ${take || 'then '}${press}Reset, then Enable.`
    : `To go on, ${rest}${take}${far}${press}Recover.`;
}

const notice = document.createElement('p');
notice.id = 'notice';
$('box').append(notice);

/** Whether the sphere can push by a scene that may shake it. */
const isWarned = (rig) => hasTorque(rig.state?.mode) && rig.unstable.length > 0;

/** Whether nobody commands what can push. */
const isFree = (rig) => rig.lease.who === 'free' && hasTorque(rig.state?.mode);

/** Whether a stop is confirmed: the rig says it, and has no torque. */
export const isStopped = (rig) => rig.isCertain && rig.headline === 'ESTOP';

/** Whether the limits keep the scene from being felt as it is meant. */
const isStrained = (rig) => rig.isCut || rig.isAtLimit;

/** Whether the sphere turns without torque, fast enough to tell. */
export const stillTurns = (rig) => rig.isCertain && !rig.unconfirmedStop && !hasTorque(rig.state.mode) && length(rig.state.omega) > TURNS;

/** Whether it turns so fast that torque must wait. */
const spins = (rig) => stillTurns(rig) && rig.fastest > SPINS;

/**
 * Returns the sentences at the end of the box as `[class, text]`: that the sphere turns, or what is
 * cut, and a warning.
 */
function noticed(rig) {
  const { state, isCertain, isFast, shakes, warnings } = rig;
  if (!isCertain || rig.unconfirmedStop) return [];
  const speed = length(state.omega);
  // The box says it already of a sphere that is too fast.
  if (stillTurns(rig) && !isFast) return [['turns', `${narrow.matches ? 'Still' : 'The sphere still'} turns: ${speed.toFixed(2)}\u00a0rad/s`]];
  const warned = shakes || isWarned(rig);
  const short = warned || (narrow.matches && warnings.length > 0);
  const cut = 1 - state.scale;
  const lines = [];
  if (state.mode === 'active' && cut >= LEAST_TOLD) lines.push(['cut', `${rig.limit} ${percent(cut)}${short ? '' : ' of the torque'}`]);
  else if (rig.isAtLimit) lines.push(['cut', short ? 'Torque at its limit' : "The torque is at the rig's limit"]);
  // Such a warning has the place of the rest, and the bar above says who commands.
  if (warned) return lines;
  if (warnings.length > 0) {
    const [first] = warnings;
    lines.push(['', `${warnings.length > 1 ? `${warnings.length} warnings, the first` : 'Warning'}: ${brief(first)}`]);
  }
  return lines;
}

/** Returns what a warning says without its reasons, for the box. */
function brief({ effect, what, shakes }) {
  // Where it shakes stands at the scene.
  const [text] = (narrow.matches && shakes ? 'may shake the sphere' : what).split('. ');
  return (effect ? `${effect}: ${text}` : text).replaceAll('`', '');
}

/** Says a part in per cent. All of it is never cut. */
function percent(part) {
  return part > 0.99 ? 'over 99 %' : `${(100 * part).toFixed(0)} %`;
}

const kept = document.createElement('div');
kept.id = 'kept';
$('box').append(kept);

/** Shows all of a text that is too long even there, or of a notice that is. */
const more = Object.assign(document.createElement('button'), { id: 'more', type: 'button', hidden: true });
more.onclick = () => {
  $('box').classList.toggle('whole');
  fit();
};
kept.append(more);

/** Returns how far below the top of an element its last whole line in sight ends, px. */
function wholeLines(element) {
  const { top, bottom } = element.getBoundingClientRect();
  const lines = document.createRange();
  lines.selectNodeContents(element);
  const ends = [...lines.getClientRects()].map((line) => line.bottom).filter((end) => end <= bottom);
  return Math.max(top, ...ends) - top;
}

/** Lets the box cover the bars if its text needs their room. So nothing moves. */
function fit() {
  const [box, text, told] = ['box', 'details', 'told'].map($);
  const scrolls = () => [box, text].some((it) => it.scrollHeight > it.clientHeight);
  const cut = () => notice.scrollHeight > notice.clientHeight + 1 || notice.scrollWidth > notice.clientWidth;
  const whole = box.classList.contains('whole');
  box.classList.remove('long', 'whole');
  more.hidden = true;
  $('meters').prepend(...KEPT.map(({ row }) => row));
  told.style.marginTop = text.style.maxHeight = '';
  // It takes room of the text.
  more.hidden = !cut();
  const long = scrolls() || (whole && !more.hidden);
  box.classList.toggle('long', long);
  if (long) kept.prepend(...KEPT.map(({ row }) => row));
  more.hidden = !scrolls() && !cut();
  if (!more.hidden) {
    more.setAttribute('aria-expanded', String(whole));
    put(more, whole ? 'Less' : 'More');
    box.classList.toggle('whole', whole);
    if (long && !whole) text.style.maxHeight = `${wholeLines(text)}px`;
  }
  if (!long) return;
  // A still longer one pushes the messages down.
  const over = box.getBoundingClientRect().bottom - told.getBoundingClientRect().top;
  if (told.parentElement.id === 'left' && over > 0) told.style.marginTop = `${Math.ceil(over)}px`;
}
window.addEventListener('resize', fit);

/** Ends the list of messages after a whole line. */
function foot() {
  const list = $('messages');
  list.style.borderBottom = list.closest('#left') ? `${list.offsetHeight - wholeLines(list)}px solid transparent` : '';
}
new ResizeObserver(foot).observe($('messages'), { box: 'border-box' });

/** Draws the sentences at the end of the box. Returns their text. */
function showNotice(sentences) {
  const text = sentences.map(([, sentence]) => sentence).join('. ');
  if (notice.title === text) return text;
  notice.title = text;
  notice.replaceChildren(...sentences.flatMap(([className, sentence], k) => [
    k > 0 ? '. ' : '', Object.assign(document.createElement('span'), { className, textContent: sentence })]));
  return text;
}

/** Returns what the colour of the headline says beside the mode. */
function mood(rig) {
  if (!rig.isCertain || !hasTorque(rig.state.mode) || rig.headline === 'NOT STOPPED') return '';
  return rig.shakes ? ': shakes' : isWarned(rig) ? ': warning' : rig.isAtLimit ? ': at limit' : rig.isCut ? ': reduced' : '';
}

const figures = ['b', 'span', 'small'].map((tag) => document.createElement(tag));
$('now').append(...figures);

/** Writes the present torque, or the frequency that the box tells of a sphere that shakes. No other number may stand in its place. */
function showNow(rig) {
  const limit = rig.info?.limits.torque;
  const words = !rig.isLive ? ['', '', '']
    : rig.isCertain && rig.shakes ? [rig.shaking.frequency.toFixed(0), 'Hz', 'shaking frequency']
      : [rig.told, 'N m', `torque${limit > 0 ? `, limit ${limit.toFixed(2)}` : ''}`];
  words.forEach((word, k) => put(figures[k], word));
}

let shown = '';
/** Draws everything that is text, without the scene. */
export function showState(rig) {
  const head = rig.headline;
  const lines = details(rig).filter(([, text]) => text);
  const line = showNotice(noticed(rig));
  $('headline').dataset.mood = mood(rig);
  put($('chip'), head + mood(rig));
  // Before the text is fitted, because it has another place then.
  document.body.classList.toggle('shakes', rig.isCertain && rig.shakes);
  document.body.classList.toggle('warned', rig.isCertain && isWarned(rig));
  document.body.classList.toggle('strained', rig.isCertain && isStrained(rig));
  document.body.classList.toggle('turning', stillTurns(rig));
  document.body.classList.toggle('old', !rig.isLive);
  // A rate or a time that changes keeps its length.
  const key = JSON.stringify([head, lines, line.length]).replace(/\d(?=\d* s ago)/g, '0');
  if (key !== shown) {
    shown = key;
    if ($('headline').textContent !== head) {
      $('details').scrollTop = 0;
      $('box').classList.remove('whole');
    }
    document.body.dataset.head = head.toLowerCase().replace(' ', '-');
    put($('headline'), head);
    $('details').replaceChildren(...lines.map(([weight, text, act = '']) => {
      const line = document.createElement('p');
      line.className = weight;
      const bold = document.createElement('b');
      bold.append(...withCode(act));
      const [before, after] = act ? text.split(act) : ['', text];
      line.append(...withCode(before), bold, ...withCode(after));
      return line;
    }));
    fit();
  }
  for (const last of $('details').querySelectorAll('.last')) put(last, lines.find(([weight]) => weight === 'last')[1]);
  document.body.classList.toggle('stopped', isStopped(rig));
  document.body.classList.toggle('unreal', rig.isSimulated === true);
  showNow(rig);
  bar(rig);
  orders(rig);
  meters(rig);
}

function bar(rig) {
  const simulated = rig.isSimulated;
  const last = rig.wasSimulated;
  const [kind, word, title] = simulated === null
    ? ['unknown', last === null ? 'UNKNOWN' : last ? 'was SIMULATED' : 'was LIVE',
      'no server says now whether its rig is simulated: the next one here may have another rig']
    : simulated ? ['simulated', 'SIMULATED', 'a simulated rig: there are no motors']
      : ['live', 'LIVE', 'a real rig: its motors can push'];
  const badge = $('badge');
  badge.dataset.kind = kind;
  badge.title = title;
  put(badge, word);
  const name = rig.info?.rig.name ?? rig.hello?.rig;
  // While the box is out of sight, its torque stands here.
  const away = rig.isLive && document.body.classList.contains('away');
  put($('rig'), !rig.hello ? 'not connected' : away ? `${rig.told} N m` : narrow.matches ? name : `${name}  ${rig.hello.rate_hz} Hz`);
  const title_ = simulated === null ? 'hbot page' : `${word}: ${name} - hbot page`;
  if (document.title !== title_) document.title = title_;
  const [button, said] = {
    mine: [narrow.matches ? 'Release' : 'Release command', 'you command'],
    free: ['Take command', 'nobody commands'],
    unknown: ['Take command', rig.hello ? 'watching' : ''],
    other: ['Take over', `${narrow.matches ? '' : 'you observe, '}${rig.lease.by ? rig.name(rig.lease.by) : ''} commands`],
  }[rig.lease.who];
  put($('who'), said);
  $('who').title = said;
  put($('alarm'), `NOT STOPPED: ${simulated ? 'simulated, nothing real moves' : "cut the motors' power"}`);
  $('who').dataset.lease = rig.lease.who;
  put($('lease'), button);
  $('who').classList.toggle('warn', isFree(rig));
  $('lease').disabled = !rig.isLive;
  $('lease').classList.toggle('next', rig.isCertain && !rig.unconfirmedStop && rig.lease.who === 'free');
  $('lease').title = rig.isLive ? '' : 'Nothing is heard from the server.';
}

/** Says why a button is locked. */
function why(rig, id) {
  const mode = rig.state?.mode;
  if (!rig.hello) return 'There is no connection.';
  if (id === 'disable') return 'The rig has no torque: there is nothing to disable.';
  if (!rig.isLive) return 'Nothing is heard from the server.';
  if (!rig.commands) return 'Only who commands can do this.';
  if (id === 'reset') return rig.isFast ? 'The sphere is still too fast.' : 'There is no fault and no stop to leave.';
  return mode === 'idle' ? rig.refusal.why : hasTorque(mode) ? 'The rig is enabled.' : `The rig is ${mode.toUpperCase()}: Reset comes first.`;
}

/** Why Recover is locked while the sphere spins. */
const RESTS = 'Recover when the sphere rests';

function orders(rig) {
  const mode = rig.state?.mode;
  const stopped = mode === 'fault' || mode === 'estop';
  const refused = rig.refusal?.op === 'enable' && rig.isFar;
  $('enable').disabled = !(rig.commands && mode === 'idle' && !refused);
  $('disable').disabled = !(rig.hello && hasTorque(mode));
  $('reset').disabled = !(rig.commands && stopped && !rig.isFast);
  const recovers = rig.commands && stopped && !rig.isFast && !rig.isFar && !rig.stopper;
  const waits = recovers && spins(rig);
  $('recover').disabled = !recovers || waits;
  // Only the next step stands out. While the sphere is too far, the box says another one, and while it turns, one waits.
  const next = !$('enable').disabled ? rig.isFar ? '' : 'enable' : mode !== 'fault' && recovers ? 'recover'
    : rig.fastest > TURNS ? '' : 'reset';
  for (const id of ['enable', 'reset', 'recover']) $(id).classList.toggle('next', id === next && !$(id).disabled);
  for (const id of ['enable', 'disable', 'reset']) $(id).title = $(id).disabled ? why(rig, id) : $(id).dataset.does;
  $('recover').title = waits ? RESTS : recovers ? $('recover').dataset.does : rig.stopper ? `Stopped by ${rig.name(rig.stopper)}: press Reset, then Enable`
    : stopped && rig.isFar ? `The sphere may be too far from the reference. ${cure(rig)} Or press Reset, then Enable`
    : why(rig, 'reset');
  const allowed = rig.info?.limits.enable_max_angle;
  const { away } = rig;
  $('distance').classList.toggle('warn', rig.isFar);
  put($('distance'), waits ? RESTS : !rig.state ? `Distance: not known ${rig.hello ? 'yet' : 'without a connection'}.`
    : !rig.isLive && away !== null ? `${away.toFixed(2)} rad from reference, as last heard`
    : away === null ? 'No reference: Enable works at any orientation.'
      // While the scene is rendered, it has begun elsewhere.
      : rig.beginsHere ? hasTorque(mode) ? `${away.toFixed(2)} rad from reference` : 'The scene begins where the sphere is.'
        : `${away.toFixed(2)} rad from reference${allowed === undefined || hasTorque(mode) ? '' : narrow.matches
            ? `; limit ${allowed.toFixed(2)}` : `. Enable works up to ${allowed.toFixed(2)} rad.`}`);
}

function meters(rig) {
  const { state, info } = rig;
  const limits = info?.limits;
  const share = (value, limit) => (limit > 0 ? value / limit : 0);
  const values = !rig.isLive || !limits ? METERS.map(() => [0, '-']) : [
    [share(length(state.torque), limits.torque),
      `${rig.told} / ${limits.torque.toFixed(2)} N m`],
    [share(length(state.omega), limits.speed),
      `${length(state.omega).toFixed(2)} / ${limits.speed} rad/s`],
    [state.traction, `${(100 * state.traction).toFixed(0)} % of friction`],
    [share(state.slip, limits.slip),
      `${(1e3 * state.slip).toFixed(1)} / ${(1e3 * limits.slip).toFixed(0)} mm/s`],
    1 - state.scale > LEAST_SHOWN
      ? [1 - state.scale, `${percent(1 - state.scale)} cut by limits`] : [0, 'none'],
  ];
  METERS.forEach(({ meter, figures, name }, k) => {
    const [value, text] = values[k];
    meter.value = Math.min(value, 1);
    // A sphere that shakes, or turns without torque, is never as it should be, however slow.
    if (name === 'Speed') meter.low = (rig.isCertain && rig.shakes) || stillTurns(rig) ? LEAST_SHOWN : NEAR;
    meter.setAttribute('aria-valuetext', `${name}: ${text}`);
    put(figures, text);
  });
}

/** Returns what shows a message: of the path of its flight log the file's name, and the rest as a tooltip. */
function said({ text, log }) {
  if (!log) return withCode(text);
  const file = document.createElement('span');
  file.textContent = log.slice(log.lastIndexOf('/') + 1);
  file.title = log;
  return [...withCode(text), '; flight log: ', file];
}

/** Draws the list of messages, newest first. */
export function showMessages(rig) {
  $('messages').replaceChildren(...rig.messages.slice(0, 20).map((message) => {
    const item = document.createElement('li');
    const time = document.createElement('time');
    time.textContent = message.at.toTimeString().slice(0, 8)
      + (message.times > 1 ? `, ${message.times} times` : '');
    item.append(time, ' ', ...said(message));
    item.className = message.weight;
    return item;
  }));
  foot();
}
