// A quantity of three components against the time before now, with its legend above the curves.

import { add, length, scaled } from './maths.js';
import { SPAN } from './rig.js';
import { touch } from './state.js';

/** Room around the curves, CSS pixels: top, right, bottom, left. */
const ROOM = [20, 8, 16, 44];

/** A point of a curve may lie beside the line that is drawn by this much, CSS pixels. */
const TOLERANCE = 0.25;

/** The least full scale. */
const LEAST = 0.02;

/** Time between two samples from which on no line joins them, s. */
const GAP = 0.5;

/** A reference that has stood still for so long steps if it changes, s. */
const STOOD = 0.3;
/** A part of a quaternion that changes by less than this stands still. */
const STILL = 1e-9;

/** Prepares a canvas for its present size and resolution. Returns its context and CSS size. */
export function prepare(canvas) {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext('2d');
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

/** Returns 1, 2 or 5 times a power of ten that is at least `x`. */
export function roundUp(x) {
  const decade = 10 ** Math.floor(Math.log10(x));
  return [1, 2, 5, 10].map((k) => k * decade).find((y) => y >= x * (1 - 1e-9)) ?? x;
}

/** Of each canvas the full scale: `usual`, that which it holds, and that which its values need. */
const scales = new Map();

/** Returns the full scale that a plot holds. It only grows. */
function hold(canvas, usual, needed) {
  const held = scales.get(canvas);
  const end = Math.max(held?.usual === usual ? held.end : usual, needed);
  scales.set(canvas, { usual, end, needed });
  return end;
}

/** Fits the full scale of a plot to what it shows, or brings the usual one back. */
export function rescale(canvas) {
  const held = scales.get(canvas);
  if (held) held.end = held.end > held.needed ? held.needed : Math.max(held.usual, held.needed);
}

/** Says at the right above a plot, if there is room from `at` on, that a click fits a scale that is wider than its values. */
function offerFit(c, canvas, at, end, colours) {
  const held = scales.get(canvas);
  const text = `${touch.matches ? 'tap' : 'click'} to fit`;
  if (held.end <= held.needed || at + 16 + c.measureText(text).width > end) return;
  c.fillStyle = colours.weak;
  c.textAlign = 'right';
  c.fillText(text, end, 9);
  c.textAlign = 'left';
}

/** Draws a line through points whose `x` grows, without those that lie within TOLERANCE of it. */
function trace(c, points, x, y) {
  let [start, last, low, high] = [null, null, 0, 0];
  for (const point of points) {
    const next = [x(point), y(point)];
    const slope = start && (next[1] - start[1]) / (next[0] - start[0]);
    if (!start || slope < low || slope > high) {
      if (last) c.lineTo(...last);
      else c.moveTo(...next);
      start = last ?? next;
      [low, high] = [-Infinity, Infinity];
    }
    const run = next[0] - start[0];
    if (run > 0) {
      low = Math.max(low, (next[1] - TOLERANCE - start[1]) / run);
      high = Math.min(high, (next[1] + TOLERANCE - start[1]) / run);
    }
    last = next;
  }
  if (last) c.lineTo(...last);
}

const same = (p, q) => p === q || Boolean(p && q && p.every((x, k) => Math.abs(x - q[k]) < STILL));

/**
 * Whether the reference jumps at this sample: it has stood still for STOOD before, and stands after.
 * One that moves, or that a client streams, is no step.
 */
function isStep(samples, k) {
  const [before, now] = [samples[k - 1].reference ?? null, samples[k].reference ?? null];
  if (same(before, now)) return false;
  if (before === null || now === null) return true;
  for (let i = k - 2; i >= 0 && samples[k - 1].t - samples[i].t < STOOD; i -= 1) {
    if (!same(samples[i].reference, before)) return false;
  }
  return k + 1 === samples.length || same(now, samples[k + 1].reference);
}

/**
 * Draws a plot. `of` returns the three components of a sample, in `unit`. The full scale is `usual` or
 * more, or fitted to the values, at least LEAST.
 * Where there is no room for `name`, the legend has `short`. `end` says what the newest sample is. With
 * `total`, the length of the vector is a fourth curve. A `limit` of it is drawn if the scale has it. A
 * change by more than `jump` is no line, nor is a time without samples. With `steps`, nor
 * is a step of the reference. Values that come near to `jump` have it as the end of their axis.
 */
export function plot(canvas, samples, colours, { name, short = name, of, usual, unit, end: last, total, limit, jump = Infinity, steps }) {
  const { context: c, width, height } = prepare(canvas);
  const [top, right, bottom, left] = ROOM;
  const now = samples.at(-1)?.t ?? 0;
  const shown = samples.slice(samples.findIndex(({ t }) => t >= now - SPAN));
  const curves = ['n1', 'n2', 'n3'].map((label, k) => (
    { label, colour: colours.axes[k], at: (sample) => of(sample)[k] }));
  if (total) {
    curves.push({ label: 'length', colour: colours.torque, at: (sample) => length(of(sample)) });
  }
  const runs = [];
  shown.forEach((sample, k) => {
    const before = shown[k - 1];
    if (k === 0 || sample.t - before.t > GAP || length(add(of(sample), scaled(of(before), -1))) > jump
      || (steps && isStep(shown, k))) runs.push([]);
    runs.at(-1).push(sample);
  });
  let most = LEAST;
  for (const sample of shown) {
    for (const curve of curves) most = Math.max(most, Math.abs(curve.at(sample)));
  }
  const end = hold(canvas, roundUp(usual), most > 0.6 * jump ? jump : roundUp(most));
  const limited = limit > 0 && limit < end;
  const full = `\u00b1${+end.toPrecision(3)} ${unit}`;
  const x = (t) => left + (width - left - right) * (1 + (t - now) / SPAN);
  const y = (v) => top + (height - top - bottom) * (0.5 - (0.5 * v) / end);
  c.font = '12px system-ui, sans-serif';
  c.textBaseline = 'middle';
  c.lineWidth = 1;
  for (const v of [-end, 0, end]) {
    c.strokeStyle = colours.line;
    c.globalAlpha = v === 0 ? 0.9 : 0.45;
    c.beginPath();
    c.moveTo(left, y(v));
    c.lineTo(width - right, y(v));
    c.stroke();
    c.globalAlpha = 1;
    c.fillStyle = colours.weak;
    c.textAlign = 'right';
    c.fillText(`${+v.toPrecision(v === Math.round(v) ? 2 : 3)}`, left - 5, y(v));
  }
  c.textAlign = 'center';
  for (const t of [-SPAN, -SPAN / 2, 0]) {
    c.textAlign = t === 0 ? 'right' : t === -SPAN ? 'left' : 'center';
    c.fillText(t === 0 ? last : `${t} s`, x(now + t), height - 6);
  }
  c.textAlign = 'left';
  c.fillStyle = colours.text;
  const room = width - left - right - curves.reduce((sum, { label }) => sum + c.measureText(label).width + 10, 4);
  const title = [`${name}, ${full}`, `${short}, ${full}`, `${short}, ${unit}`].find((it) => c.measureText(it).width <= room) ?? unit;
  c.fillText(title, left, 9);
  let at = left + c.measureText(title).width + 14;
  for (const curve of curves) {
    c.fillStyle = curve.colour;
    c.fillText(curve.label, at, 9);
    at += c.measureText(curve.label).width + 10;
    c.strokeStyle = curve.colour;
    c.lineWidth = 1.5;
    c.beginPath();
    for (const run of runs) trace(c, run, (sample) => x(sample.t), (sample) => y(curve.at(sample)));
    c.stroke();
  }
  if (limited) {
    c.fillStyle = c.strokeStyle = colours.warn;
    if (at + c.measureText('limit').width <= width) c.fillText('limit', at, 9);
    at += c.measureText('limit').width;
    c.setLineDash([6, 6]);
    c.beginPath();
    c.moveTo(left, y(limit));
    c.lineTo(width - right, y(limit));
    c.stroke();
    c.setLineDash([]);
  }
  offerFit(c, canvas, at, width - right, colours);
  return end;
}

/**
 * Draws the torque of the scene against the angle about each axis, with a dot for each axis where the
 * sphere is now, grey if this is not `live`. `curves` are pairs of rad and N m, faint if they are
 * `old`. If there are none, the server computes them. `present` has the angle and the torque about
 * each axis or is null, and `limit` is the rig's torque limit, N m.
 */
export function plotCurves(canvas, { curves, old }, present, live, colours, limit) {
  const { context: c, width, height } = prepare(canvas);
  const [top, right, bottom, left] = ROOM;
  const largest = Math.max(LEAST, ...curves.flat().map(([, torque]) => Math.abs(torque)));
  const end = hold(canvas, roundUp(limit > 0 ? 1.25 * limit : LEAST), roundUp(limit > 0 ? Math.min(largest, 1.25 * limit) : largest));
  const clamp = (v) => Math.max(-end, Math.min(end, v));
  const x = (angle) => left + (width - left - right) * (0.5 + angle / (2 * Math.PI));
  const y = (v) => top + (height - top - bottom) * (0.5 - (0.5 * v) / end);
  c.font = '12px system-ui, sans-serif';
  c.textBaseline = 'middle';
  c.lineWidth = 1;
  const line = (points, colour) => {
    c.strokeStyle = colour;
    c.beginPath();
    for (const [a, v] of points) c.lineTo(x(a), y(v));
    c.stroke();
  };
  c.fillStyle = colours.weak;
  const known = curves.length > 0;
  for (const v of known ? [-end, 0, end] : [0]) {
    line([[-Math.PI, v], [Math.PI, v]], colours.line);
    c.textAlign = 'right';
    c.fillText(`${+v.toPrecision(2)}`, left - 5, y(v));
  }
  for (const degrees of [-180, -90, 0, 90, 180]) {
    const a = (degrees * Math.PI) / 180;
    line([[a, -end], [a, end]], colours.line);
    c.textAlign = degrees === -180 ? 'left' : degrees === 180 ? 'right' : 'center';
    c.fillText(`${degrees}\u00b0`, x(a), height - 6);
  }
  c.textAlign = 'left';
  c.fillStyle = colours.text;
  const title = `scene, \u00b1${+end.toPrecision(2)} N m about`;
  c.fillText(title, left, 9);
  let at = left + c.measureText(title).width + 8;
  c.lineWidth = 1.5;
  curves.forEach((curve, k) => {
    c.fillStyle = colours.axes[k];
    c.fillText(`n${k + 1}`, at, 9);
    at += c.measureText(`n${k + 1}`).width + 8;
  });
  // Walls that are many times as strong would flatten everything that the hand can feel.
  c.save();
  c.beginPath();
  c.rect(left, top, width - left - right, height - top - bottom);
  c.clip();
  c.globalAlpha = old ? 0.45 : 1;
  c.lineWidth = 2;
  curves.forEach((curve, k) => line(curve, colours.axes[k]));
  // Where curves coincide, their colours alternate. Elsewhere each dash lies on a line of its colour.
  c.setLineDash([8, 16]);
  curves.forEach((curve, k) => {
    c.lineDashOffset = -8 * k;
    line(curve, colours.axes[k]);
  });
  c.setLineDash([]);
  c.lineDashOffset = 0;
  c.lineWidth = 1.5;
  c.globalAlpha = 1;
  if (limit > 0 && end > limit) {
    c.setLineDash([6, 6]);
    for (const v of [-limit, limit]) line([[-Math.PI, v], [Math.PI, v]], colours.warn);
  }
  c.restore();
  if (limit > 0 && end > limit) {
    c.fillStyle = colours.warn;
    const text = ['limit, dashed', 'limit'].find((text) => at + 6 + c.measureText(text).width <= width);
    if (text) c.fillText(text, at + 6, 9);
    at += 6 + c.measureText(text ?? '').width;
  }
  offerFit(c, canvas, at, width - right, colours);
  if (!known) {
    c.fillStyle = colours.weak;
    c.textAlign = 'center';
    c.fillText('computing the curve', x(0), y(0) - 12);
    return;
  }
  present?.torque.forEach((torque, k) => {
    c.fillStyle = live ? colours.axes[k] : colours.weak;
    c.beginPath();
    c.arc(x(present.angle[k]), y(clamp(torque)), 5, 0, 2 * Math.PI);
    c.fill();
    // Its edge keeps it apart from the curve.
    c.strokeStyle = colours.ground;
    c.stroke();
  });
}
