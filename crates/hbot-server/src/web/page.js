// The page: a client of the server like any other. It holds no rule of its own, draws the newest
// state in each frame of the screen, and asks for about as many states as it can draw.

import { Controls } from './controls.js';
import { Hand } from './hand.js';
import { Link } from './link.js';
import { length, rotation } from './maths.js';
import { plot, plotCurves, rescale } from './plot.js';
import { Rig, hasTorque } from './rig.js';
import { Camera, draw, shared } from './sphere.js';
import { isStopped, narrow, put, showMessages, showState, stillTurns, touch, withCode } from './state.js';

/** States per second that the page asks for. */
const STATES = 60;
/** The server needs some time to know up to which stiffness a changed scene is stable, ms. */
const STABLE_AFTER = 150;
/** Pause after a request for `info` that failed, ms. */
const INFO_AGAIN = 1000;
/** A connection over which nothing comes for this time is replaced, ms. */
const RENEW_AFTER = 4000;
/** Figures in words change at most this often, ms. */
const WORDS_EVERY = 100;
/** A plot is drawn at most this often, ms: in every second frame of the usual 60 a second. */
const PLOT_EVERY = 25;
/** A click so soon after the one that took command is no wish to release it, ms. */
const AGAIN = 700;
/** The hand that turns the simulated sphere: N m/rad, N m s/rad, kg m². */
const HAND = { stiffness: 3, damping: 0.05, inertia: 0.002 };

const $ = (id) => document.getElementById(id);
const camera = new Camera();
let token = null;

const scheme = location.protocol === 'https:' ? 'wss:' : 'ws:';
// Other clients tell several pages apart by it. An iPad says that it is a Mac, but a Mac has no
// touch screen.
const { userAgent, maxTouchPoints } = navigator;
const first = (names) => names.find(([sign]) => userAgent.includes(sign))[1];
const browser = first([['Edg', 'Edge'], ['OPR', 'Opera'], ['SamsungBrowser', 'Samsung Internet'], ['Firefox', 'Firefox'],
  ['FxiOS', 'Firefox'], ['Chrom', 'Chrome'], ['CriOS', 'Chrome'], ['Safari', 'Safari'], ['', 'browser']]);
const system = first([['iPhone', 'iPhone'], ['iPad', 'iPad'], ['Android', 'Android'], ['CrOS', 'ChromeOS'],
  ['Windows', 'Windows'], ['Mac', maxTouchPoints > 0 ? 'iPad' : 'Mac'], ['Linux', 'Linux'], ['', 'another system']]);
const rig = new Rig(`${browser} on ${system}`);
const link = new Link(`${scheme}//${location.host}/ws`, rig.ownName, {
  token: () => token,
  opened(hello) {
    rig.opened(hello);
    $('token').hidden = true;
    link.request('subscribe', { every: Math.max(1, Math.round(hello.rate_hz / STATES)) }).catch(tell('states'));
    askInfo();
  },
  closed(closed) {
    rig.lost(closed);
    hand.drop();
    if (closed.code === 'unauthorized') {
      $('token').hidden = false;
      $('secret').focus();
    }
    changed();
  },
  refused: (error) => tell('refused')(error),
  event(message) {
    const loaded = rig.event(message);
    if (message.event === 'lease' && !rig.commands) hand.drop();
    if (loaded) askInfo();
    if (message.event === 'set') {
      valued = false;
      askInfoIn(STABLE_AFTER);
    }
    changed();
  },
});

function tell(what) {
  return (error) => {
    rig.say(`${what}: ${error.message}`, 'warn');
    changed();
  };
}

/** Sends a request. Returns whether it was carried out; if not, the person reads why. */
async function ask(op, fields, what = op) {
  rig.refusal = null;
  try {
    await link.request(op, fields);
    changed();
    return true;
  } catch (error) {
    tell(what)(error);
    if (['enable', 'reset'].includes(op)) rig.refusal = { op, why: error.message, q: rig.state?.q };
    return false;
  }
}

let infoTimer = null;
/** Asks for `info` soon. A timer that runs is not postponed: changes may come without a pause. */
function askInfoIn(ms) {
  infoTimer ??= setTimeout(() => {
    infoTimer = null;
    if (link.isOpen) askInfo();
  }, ms);
}

async function askInfo() {
  try {
    const info = await link.request('info');
    rig.take(info);
    // The server has begun to compute it with this question.
    if (info.render && !info.stable) askInfoIn(STABLE_AFTER);
    showScene();
  } catch (error) {
    if (link.isOpen) tell('info')(error);
    askInfoIn(INFO_AGAIN);
  }
}

const hand = new Hand($('sphere'), rig, camera, {
  may: () => rig.commands && rig.isSimulated,
  move: (q) => link.request('hand', q ? { q, ...HAND } : { release: true }).catch((error) => {
    tell('hand')(error);
    throw error;
  }),
  changed,
});
const controls = new Controls($('effects'), rig, (effect, key, value) => (
  ask('set', { effect, [key]: value }, `${effect} ${key}`)));

/** Stops the rig. If nothing comes over the usual connection, the stop also goes over another. */
function stop() {
  rig.asksStop();
  $('question').hidden = true;
  const ways = link.isOpen ? [link.request('estop')] : [];
  if (!link.isOpen || rig.silentFor !== null) ways.push(link.stopApart((session) => rig.own.add(session)));
  Promise.any(ways).catch((failed) => rig.stopFailed(failed.errors.at(-1).message)).finally(changed);
  changed();
}

// The keys stop the rig everywhere in the page, also in a field. Enter presses the focused button.
window.addEventListener('keydown', (event) => {
  if (event.key !== 'Escape' && event.key !== ' ') return;
  event.preventDefault();
  event.stopImmediatePropagation();
  if (!event.repeat) stop();
}, true);
// A browser presses the focused button when Space is released.
window.addEventListener('keyup', (event) => event.key === ' ' && event.preventDefault(), true);
$('stop').addEventListener('pointerdown', stop);
$('stop').addEventListener('click', (event) => event.detail === 0 && stop());

for (const op of ['enable', 'disable', 'reset']) $(op).onclick = () => ask(op);
// A stop between the two makes the server refuse the second.
$('recover').onclick = async () => await ask('reset', {}, 'recover') && ask('enable', {}, 'recover');

$('lease').onclick = async () => {
  const { who, by } = rig.lease;
  if (who === 'mine') {
    // The second click on the button that took command.
    if (performance.now() - rig.mineSince < AGAIN) return;
    hand.letGo();
    if (await ask('release')) rig.lease = { who: 'free' };
  } else if (who === 'other' && hasTorque(rig.state?.mode)) {
    const name = rig.name(by);
    put($('asked'), `Take over from ${name}?`);
    put($('consequence'), `The sphere pushes, and ${name} commands it. The scene goes on when you take `
      + `over. If the program of ${name} streams torques, they end. ${touch.matches ? 'STOP' : 'Esc'} stops the rig and closes this question.`);
    $('question').hidden = false;
    $('no').focus();
  } else acquire(who === 'other');
};
async function acquire(steal) {
  $('question').hidden = true;
  if (await ask('acquire', { steal }, 'take over')) rig.mine();
  changed();
}
$('yes').onclick = () => acquire(true);
$('no').onclick = () => {
  $('question').hidden = true;
  $('lease').focus();
};
$('token').onsubmit = (event) => {
  event.preventDefault();
  token = $('secret').value;
  $('secret').value = '';
  link.connect();
};

$('shelf').onchange = showScene;
$('load').onclick = () => ask('load_scene', { scene: $('shelf').value }, 'load');
$('show').onclick = () => { $('text').value = JSON.stringify(rig.info?.scene ?? {}, null, 1); };
$('loadtext').onclick = () => {
  try {
    ask('load_scene', { scene: JSON.parse($('text').value) }, 'load');
  } catch (error) {
    tell('load')(error);
  }
};
$('astext').ontoggle = () => $('text').value || $('show').click();
if (touch.matches) put($('astext').lastElementChild, 'Paste a text, or edit it elsewhere.');

/** Draws what changes with `info`: the scene, its controls and the ready-made scenes. */
function showScene() {
  const { info } = rig;
  if (!info) return;
  put($('scene'), info.scene?.name ?? 'Scene');
  put($('about'), info.scene?.effect?.length === 0
    ? 'This scene has no effects: nothing is rendered.' : info.scene?.description ?? '');
  const scenes = info.scenes ?? [];
  if ($('shelf').options.length !== scenes.length) {
    $('shelf').replaceChildren(...scenes.map(({ file }) => new Option(file, file)));
  }
  const feels = scenes.find(({ file }) => file === $('shelf').value)?.description ?? '';
  // Of the running scene it stands above.
  put($('feels'), feels === $('about').textContent ? '' : feels);
  showRights();
  controls.show();
  // At once, because the curve is that of the name above it.
  showCurves();
}

/** The messages, below the bars where the window has room. */
const told = Object.assign(document.createElement('div'), { id: 'told' });
told.append($('messages').previousElementSibling, $('messages'));
const tall = matchMedia('(min-width: 44.01rem) and (min-height: 44.01rem)');
tall.onchange = () => $(tall.matches ? 'left' : 'right').append(told);
tall.onchange();

// On a telephone the box scrolls out of sight.
new IntersectionObserver(([{ isIntersecting }]) => document.body.classList.toggle('away', !isIntersecting)).observe($('headline'));

for (const id of ['legend', 'torque', 'angle', 'curves']) {
  $(id).title = $('terms').textContent;
  if (id === 'legend') continue;
  $(id).title += ` ${$('scales').textContent}`;
  $(id).onclick = () => {
    rescale($(id));
    changed();
  };
  $(id).onkeydown = (event) => event.key === 'Enter' && $(id).onclick();
}

function showRights() {
  const may = rig.commands;
  for (const id of ['load', 'loadtext']) {
    $(id).disabled = !may;
    $(id).title = may ? '' : 'Only who commands can load a scene.';
  }
  $('effects').toggleAttribute('inert', !may);
  $('observer').hidden = may || !(rig.state || rig.closed);
  put($('observer'), !rig.hello ? 'Not connected' : !rig.isLive ? 'No contact'
    : 'Locked: you observe');
  if (rig.lease.who !== 'other' || !rig.isLive || !hasTorque(rig.state.mode)) $('question').hidden = true;
  const list = $('warnings');
  const told = JSON.stringify(rig.warnings);
  if (list.dataset.shown !== told) {
    list.dataset.shown = told;
    list.replaceChildren(...rig.warnings.map(({ effect, what, why, remedy }) => {
      const item = document.createElement('li');
      if (remedy) item.append(Object.assign(document.createElement('strong'), { textContent: remedy.replaceAll('`', '') }));
      const text = document.createElement('span');
      text.append(...withCode([effect, what, why].filter(Boolean).join(': ')));
      item.append(text);
      // What follows the first sentence of a warning that is not urgent.
      if (!remedy && /\. /.test(what)) {
        text.className = 'folded';
        const more = Object.assign(document.createElement('button'), { type: 'button', textContent: 'More' });
        more.setAttribute('aria-expanded', 'false');
        more.onclick = () => {
          const folded = text.classList.toggle('folded');
          more.setAttribute('aria-expanded', String(!folded));
          put(more, folded ? 'More' : 'Less');
        };
        item.append(more);
      }
      return item;
    }));
  }
  put($('hint'), hint());
  const trouble = stopTrouble();
  const live = rig.isSimulated === false;
  const keys = live ? 'Esc or Space stops. Not an emergency switch.' : 'Esc or Space stops, anywhere here';
  put($('keys'), trouble || (live && (touch.matches || narrow.matches) ? 'Not an emergency switch' : touch.matches ? '' : keys));
  $('stop').title = isStopped(rig) ? 'The stop is confirmed. STOP works on.' : '';
  $('keys').classList.toggle('warn', trouble !== '');
}

/** Returns why STOP may not work as usual, that it is on its way, or that it has worked. */
function stopTrouble() {
  if (!rig.hello) return 'No connection: cannot reach the rig';
  if (isStopped(rig)) return stillTurns(rig) ? 'torque off, still turns' : `stopped, ${length(rig.state.torque).toFixed(2)} N m`;
  if (rig.isBack) return 'Connected again: STOP reaches the rig';
  if (rig.unconfirmedStop || !(rig.isLive || rig.stop)) return 'No answer: may not reach the rig';
  if (rig.stop) return 'STOP sent, not confirmed yet';
  return touch.matches || document.hasFocus() ? '' : 'The keys go elsewhere: this button stops';
}

/** Returns what the hand can do with the picture. */
function hint() {
  if (rig.state && rig.silentFor !== null) return `Last heard ${rig.silentFor.toFixed(0)} s ago.`;
  if (!rig.isLive) return '';
  if (hand.held) return hand.held.pointer && !touch.matches ? 'Scroll to twist the sphere about the line of sight.' : '';
  if (hand.may()) {
    return touch.matches || narrow.matches ? 'Drag the sphere to turn it. Beside it or with two fingers: the view.'
      : 'Drag the sphere to turn it, or use the arrow keys. With Shift, beside it or with two fingers: the view.';
  }
  return rig.isSimulated ? 'A drag turns the view. Only who commands can turn the sphere.'
    : `Drag to turn the view, double ${touch.matches ? 'tap' : 'click'} to turn it back.`;
}

const dark = matchMedia('(prefers-color-scheme: dark)');
let colours = palette();
function palette() {
  const style = getComputedStyle(document.documentElement);
  const of = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    axes: [of('axis1'), of('axis2'), of('axis3')], sphere: [of('sphere'), of('edge')],
    ...Object.fromEntries(['torque', 'ghost', 'grid', 'ground', 'wheel', 'weak', 'hand', 'line', 'text', 'warn'].map((k) => [k, of(k)])),
  };
}
dark.onchange = () => {
  colours = palette();
  changed();
};

const absent = Object.assign(document.createElement('p'), { id: 'absent' });
$('picture').append(absent);

/** Says in place of the picture that no server answers, and when the page tries again. */
function absence() {
  absent.hidden = rig.hello !== null || !rig.closed || rig.closed.code === 'unauthorized';
  if (absent.hidden) return;
  const wait = link.nextAt - performance.now();
  const what = rig.closed.code ? `Not connected: ${rig.closed.why}.` : `No server answers at ${location.host}.`;
  put(absent, `${what} `
    + (wait > 0 ? `Next attempt in ${Math.ceil(wait / 1000)} s.` : 'Trying now.'));
}

/** Writes the figures of the picture. */
function words() {
  const { state } = rig;
  const legend = $('legend');
  legend.hidden = !state;
  if (!state) return;
  const turned = rotation(state.q);
  const angle = length(turned);
  // A rounded number that is zero has no sign.
  const figure = (x) => (Math.round(1000 * x) / 1000 + 0).toFixed(3).padStart(7);
  if (legend.children.length === 0) {
    for (const name of ['torque', 'ghost', 'weak', 'weak']) {
      legend.append(Object.assign(document.createElement('p'), { className: name }));
    }
  }
  put(legend.children[0], rig.isLive ? 'torque' : 'last torque');
  put(legend.children[1], state.reference ? 'reference, dashed' : 'no reference');
  put(legend.children[2], `n1 n2 n3 from N ${turned.map(figure).join(' ')} rad`);
  put(legend.children[3], `turned from N ${figure(angle)} rad, ${((180 * angle) / Math.PI).toFixed(1)}\u00b0`);
  const away = rig.away;
  $('sphere').setAttribute('aria-label', `Sphere: turned ${angle.toFixed(2)} rad, torque `
    + `${rig.told} N m${away === null ? '' : `, ${away.toFixed(2)} rad from its reference`}`);
  const { force } = hand;
  $('grip').hidden = !force;
  if (force) put($('grip'), `${force.newtons.toFixed(2)} N, ${force.torque.toFixed(3)} N m at your hand`);
}

let [asked, last, plotted, worded, odd] = [false, 0, 0, 0, false];
/** Whether the controls show what other clients have set. */
let valued = true;
function changed() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(frame);
}

/** Draws one plot or the others, in turns. */
function showPlot() {
  const { samples } = rig;
  const end = rig.isLive ? 'now' : samples.length > 0 ? 'last heard' : '';
  odd = !odd;
  if (odd) {
    plot($('torque'), samples, colours, {
      name: "torque about N's axes", short: 'torque', of: (s) => s.torque, usual: rig.info?.limits.torque || 1, unit: 'N m', end, total: true, limit: rig.info?.limits.torque });
  } else {
    plot($('angle'), samples, colours, {
      name: `angle from ${rig.origin}${rig.origin === 'N' ? " (the rig's frame)" : ''}`, short: `from ${rig.origin}`, of: (s) => s.angle,
      usual: rig.info?.limits.enable_max_angle || 0.5, unit: 'rad', end,
      // Beyond half a turn the least rotation is the other way round.
      jump: Math.PI, steps: true });
    showCurves();
  }
}

function showCurves() {
  $('curves').hidden = !rig.curves;
  if (rig.curves) plotCurves($('curves'), rig.presentCurves, rig.present, rig.isLive, colours, rig.info?.limits.torque ?? 0);
}

/**
 * Puts the force beside the hand and its arrow, whose ends are given, where it covers least of the
 * rectangles that are `full`, all on the canvas. Above it if it can. A finger hides more than a
 * mouse. Returns its own rectangle.
 */
function placeGrip([[x, y], [, toY]], full) {
  const { style, offsetWidth: width, offsetHeight: height } = $('grip');
  const { clientWidth, offsetTop: top } = $('sphere');
  const most = $('picture').clientHeight - top - height;
  const room = touch.matches ? 50 : 12;
  const [above, below] = [Math.min(y - room, toY - 12) - height, Math.max(y, toY) + 12];
  const aside = [0, -width / 3, width / 3];
  const rows = [above, below, above - height, below + height];
  const places = rows.flatMap((row) => aside.map((part) => [x - width / 2 + part, row])).map(([left, upper]) => {
    const at = [Math.max(0, Math.min(clientWidth - width, left)), Math.max(-top, Math.min(most, upper))];
    return [...at, at[0] + width, at[1] + height];
  });
  const covered = places.map((rect) => full.reduce((sum, other) => sum + shared(rect, other), 0));
  const best = places[covered.indexOf(Math.min(...covered))];
  style.left = `${best[0]}px`;
  style.top = `${top + best[1]}px`;
  return best;
}

let head = '';
function frame(now) {
  asked = false;
  if (hand.step((now - last) / 1000)) changed();
  last = now;
  const speaks = now - worded > WORDS_EVERY || head !== rig.headline || rig.spoke;
  if (speaks) rig.tell();
  draw($('sphere'), rig, camera, colours, hand.held, placeGrip);
  // For whoever measures: the tick that the picture shows.
  $('sphere').dataset.tick = rig.state?.tick ?? '';
  if (now - plotted > PLOT_EVERY) {
    plotted = now;
    showPlot();
  }
  if (!valued) controls.show();
  valued = true;
  if (speaks) {
    worded = now;
    head = rig.headline;
    showState(rig);
    showRights();
    words();
    absence();
    if (rig.spoke) showMessages(rig);
    rig.spoke = false;
  }
}

// Silence is no event, and it must show also while nothing else changes.
setInterval(() => {
  const silent = rig.hello ? performance.now() - link.heard : 0;
  if (silent > RENEW_AFTER) link.renew('the server has said nothing');
  // Without states: in virtual time, a server waits for a client to go on.
  else if (silent > RENEW_AFTER / 2) link.request('ping').catch(() => {});
  changed();
}, 250);
new ResizeObserver(changed).observe($('picture'));
