// The picture of the sphere: its axes and grid, the reference, the wheels and the torque. Lengths
// are in units of the sphere's radius. The projection is parallel, with n3 upwards.

import { AXES, across, add, cross, dot, fromN3, length, product, rotated, scaled, turn, unit } from './maths.js';
import { prepare } from './plot.js';

/** Least distance from the centre that the picture shows, and that of the ends of the axes without their names. */
const [REACH, AXIS] = [1.62, 1.25];
/** Room for the name of an axis, px. */
const NAME = 20;
/** Length of the torque's arrow at the rig's limit, the least part of it that is drawn, and its width, px. */
const [FULL, LEAST, THICK] = [1.4, 0.08, 9];
const CIRCLE = 48;
/** Height of a text, px. Where it may stand: turned from the usual direction, rad, and further, px. */
const LINE = 14;
const PLACES = [[0, 0], [0.6, 0], [-0.6, 0], [0, 12], [1.2, 4], [-1.2, 4], [0.6, 16], [-0.6, 16], [0, 28], [1.9, 8], [-1.9, 8], [Math.PI, 8]];
/** A text stays where it is unless another place has this much less of its area covered, px². */
const STAYS = 24;
/** The band from the hand to the pointer: its least length, and the ring at its end, px. */
const [BAND, RING] = [24, 5];

const angles = (n, span = 2 * Math.PI) => Array.from({ length: n + 1 }, (_, k) => (span * k) / n);
const segment = (a, b) => angles(12, 1).map((k) => add(scaled(a, 1 - k), scaled(b, k)));

function circle(normal) {
  const [a, b] = across(normal);
  return angles(CIRCLE).map((t) => add(scaled(a, Math.cos(t)), scaled(b, Math.sin(t))));
}

/** The equator, four parallels and twelve meridians; whether each is drawn more strongly. */
const GRID = [0, -60, -30, 30, 60].map((degrees) => {
  const [s, c] = [Math.sin((degrees * Math.PI) / 180), Math.cos((degrees * Math.PI) / 180)];
  return { strong: degrees === 0, line: circle(AXES[2]).map((p) => add(scaled(p, c), [0, 0, s])) };
}).concat(angles(12).slice(0, 12).map((azimuth, k) => ({
  strong: k % 3 === 0,
  line: angles(20, 1).map((part) => {
    const latitude = ((120 * part - 60) * Math.PI) / 180;
    return rotated(turn([0, 0, azimuth]), [Math.cos(latitude), 0, Math.sin(latitude)]);
  }),
})));

export class Camera {
  constructor() {
    this.home();
  }

  /** Looks along n2, slightly from the side of n1 and from above. */
  home() {
    this.azimuth = -1.25;
    this.elevation = 0.22;
  }

  /** Turns the view so that the surface follows the pointer. `radius` is the sphere's, px. */
  orbit(dx, dy, radius) {
    this.azimuth -= dx / radius;
    this.elevation = Math.min(1.5, Math.max(-1.5, this.elevation + dy / radius));
  }

  /** Returns the directions to the right, up and towards the viewer, in frame N. */
  get frame() {
    const [sa, ca] = [Math.sin(this.azimuth), Math.cos(this.azimuth)];
    const [se, ce] = [Math.sin(this.elevation), Math.cos(this.elevation)];
    return { right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce], eye: [ce * ca, ce * sa, se] };
  }
}

/** The middle and radius of the sphere in a picture of this size, px. */
export function place(width, height) {
  const half = Math.min(width, height) / 2;
  return { x: width / 2, y: height / 2, radius: Math.max(10, half / REACH, (half - NAME) / AXIS) };
}

/** Returns the area that two rectangles `[left, top, right, bottom]` share, px². */
export const shared = (a, b) => Math.max(0, Math.min(a[2], b[2]) - Math.max(a[0], b[0]))
  * Math.max(0, Math.min(a[3], b[3]) - Math.max(a[1], b[1]));

/** Which of its places each text has on a canvas. */
const taken = new Map();

class Drawing {
  constructor(context, frame, at, colours) {
    Object.assign(this, { c: context, frame, at, colours, texts: [], full: [] });
  }

  point(p) {
    return [this.at.x + this.at.radius * dot(p, this.frame.right),
      this.at.y - this.at.radius * dot(p, this.frame.up)];
  }

  /** Returns whether the unit sphere hides a point: it is inside the sphere or behind it. */
  hides(p) {
    const near = dot(p, this.frame.eye);
    const beside = dot(p, p) - near * near;
    return beside < 1 && near < Math.sqrt(1 - beside) - 1e-3;
  }

  /** Draws the visible parts of a line, the hidden parts, or both, which `alpha` fades. */
  line(points, colour, width, alpha, { dashed = false } = {}) {
    const { c } = this;
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.setLineDash(dashed ? [5, 4] : []);
    for (const hidden of [true, false]) {
      c.globalAlpha = alpha[hidden ? 1 : 0];
      if (c.globalAlpha === 0 || alpha[hidden ? 1 : 0] === 0) continue;
      c.beginPath();
      let pen = false;
      for (const p of points) {
        const [x, y] = this.point(p);
        if (this.hides(p) !== hidden) pen = false;
        else if (pen) c.lineTo(x, y);
        else {
          c.moveTo(x, y);
          pen = true;
        }
      }
      c.stroke();
    }
    c.globalAlpha = 1;
    c.setLineDash([]);
  }

  head([x0, y0], [x1, y1], size, colour, alpha) {
    const { c } = this;
    const run = Math.hypot(x1 - x0, y1 - y0);
    c.fillStyle = colour;
    c.globalAlpha = alpha;
    c.beginPath();
    if (run < 1) c.arc(x1, y1, size / 2, 0, 2 * Math.PI);
    else {
      const [ux, uy] = [(x1 - x0) / run, (y1 - y0) / run];
      const [bx, by] = [x1 - ux * size, y1 - uy * size];
      c.moveTo(x1 + 2 * ux, y1 + 2 * uy);
      c.lineTo(bx - uy * size * 0.45, by + ux * size * 0.45);
      c.lineTo(bx + uy * size * 0.45, by - ux * size * 0.45);
    }
    c.fill();
    c.globalAlpha = 1;
  }

  arrow(from, to, colour, width) {
    this.line(segment(from, to), colour, width, [1, 0.3]);
    this.head(this.point(from), this.point(to), 5 + 2 * width, colour, this.hides(to) ? 0.35 : 1);
  }

  /** Notes a text for `write`, to stand `beyond` px behind the point p, seen from the centre. A text that changes has a `key`. */
  text(p, text, colour, beyond = 0, key = text) {
    this.texts.push({ at: this.point(p), text, colour, beyond, key });
  }

  /** Returns the rectangle of a noted text at one of its places. */
  rectangle({ at: [x0, y0], text, beyond }, [turned, further]) {
    const [dx, dy] = [x0 - this.at.x, y0 - this.at.y];
    // An axis along the line of sight has no direction in the picture.
    const way = (Math.hypot(dx, dy) > 1 ? Math.atan2(dy, dx) : -Math.PI / 4) + turned;
    const half = this.c.measureText(text).width / 2;
    // A long text begins where a short one would.
    const more = Math.max(0, half - NAME / 2);
    const [x, y] = [x0 + (beyond + further + more) * Math.cos(way), y0 + (beyond + further) * Math.sin(way)];
    return [x - half, y - LINE / 2, x + half, y + LINE / 2];
  }

  /**
   * Writes the noted texts where they cover least of the rectangles `full` and of each other, and
   * are within the picture. The edge of a text is that of the ground.
   */
  write(full, [width, height]) {
    const { c } = this;
    const room = [...full];
    for (const noted of this.texts) {
      const costs = PLACES.map((place, k) => {
        const rect = this.rectangle(noted, place);
        const inside = shared(rect, [0, 0, width, height]) - (rect[2] - rect[0]) * LINE;
        return room.reduce((sum, other) => sum + shared(rect, other), 0) - 4 * inside + 2 * k;
      });
      let best = costs.indexOf(Math.min(...costs));
      const last = taken.get(noted.key);
      if (last !== undefined && costs[last] < costs[best] + STAYS) best = last;
      taken.set(noted.key, best);
      const rect = this.rectangle(noted, PLACES[best]);
      room.push(rect);
      const [x, y] = [(rect[0] + rect[2]) / 2, (rect[1] + rect[3]) / 2];
      c.strokeStyle = this.colours.ground;
      c.lineWidth = 3;
      c.lineJoin = 'round';
      c.textAlign = 'center';
      c.textBaseline = 'middle';
      c.strokeText(noted.text, x, y);
      c.fillStyle = noted.colour;
      c.fillText(noted.text, x, y);
    }
    this.texts = [];
  }

  /** Returns a square around a point, of `reach` px to each side. */
  around(p, reach) {
    const [x, y] = this.point(p);
    return [x - reach, y - reach, x + reach, y + reach];
  }

  dot(p, radius, colour, filled = true) {
    const { c } = this;
    const [x, y] = this.point(p);
    c.beginPath();
    c.arc(x, y, radius, 0, 2 * Math.PI);
    c.fillStyle = c.strokeStyle = colour;
    c.lineWidth = 1.2;
    if (filled) c.fill();
    else c.stroke();
  }

  sphere(q) {
    const { c, at, colours } = this;
    const [x, y] = [at.x - 0.3 * at.radius, at.y - 0.35 * at.radius];
    const light = c.createRadialGradient(x, y, 0, at.x, at.y, at.radius);
    light.addColorStop(0, colours.sphere[0]);
    light.addColorStop(1, colours.sphere[1]);
    c.globalAlpha = 0.84;
    c.fillStyle = light;
    c.beginPath();
    c.arc(at.x, at.y, at.radius, 0, 2 * Math.PI);
    c.fill();
    c.globalAlpha = 0.7;
    c.strokeStyle = colours.grid;
    c.lineWidth = 1.5;
    c.stroke();
    c.globalAlpha = 1;
    for (const { line, strong } of GRID) {
      this.line(line.map((p) => rotated(q, p)), colours.grid, 1, [strong ? 0.75 : 0.32, 0]);
    }
  }

  reference(q) {
    const colour = this.colours.ghost;
    for (const normal of AXES) {
      const line = circle(normal).map((p) => rotated(q, p));
      this.line(line, colour, 1.2, [0.8, 0.24], { dashed: true });
    }
    for (const axis of AXES.map((axis) => rotated(q, axis))) {
      this.line(segment(axis, scaled(axis, 1.16)), colour, 1.5, [1, 0.3], { dashed: true });
      this.dot(scaled(axis, 1.16), 4, colour, false);
      this.full.push(this.around(scaled(axis, 1.16), 4));
    }
  }

  axes(q) {
    AXES.forEach((axis, k) => {
      const [tip, colour] = [rotated(q, axis), this.colours.axes[k]];
      this.arrow([0, 0, 0], scaled(tip, AXIS), colour, 2.5);
      if (!this.hides(tip)) this.dot(tip, 3.5, colour);
      this.full.push(this.around(scaled(tip, AXIS), 3));
      this.text(scaled(tip, AXIS), `s${k + 1}`, colour, 13);
    });
  }

  /** Draws a wheel at its contact: C = A0 Rz(steer) Rx(cone) Rz(toe), contact point c3. */
  wheel(wheel, radius, steer, drive) {
    const axis = unit(wheel.axis);
    if (!axis || !(radius > 0)) return;
    const a = product(product(fromN3(axis), turn([0, 0, steer])), turn([wheel.cone, 0, 0]));
    const c = product(a, turn([0, 0, wheel.toe]));
    const [rolling, normal] = [rotated(c, AXES[1]), rotated(c, AXES[2])];
    const r = wheel.radius / radius;
    const centre = scaled(normal, 1 + r);
    const rim = (t) => add(centre, add(scaled(rolling, r * Math.cos(t)), scaled(normal, r * Math.sin(t))));
    const colour = this.colours.wheel;
    const alpha = this.hides(centre) ? 0.35 : 1;
    const ctx = this.c;
    this.line(segment(axis, scaled(axis, 1 + 2 * r)), colour, 1, [0.7, 0.2], { dashed: true });
    ctx.beginPath();
    for (const t of angles(CIRCLE)) ctx.lineTo(...this.point(rim(t)));
    ctx.moveTo(...this.point(centre));
    ctx.lineTo(...this.point(rim(-drive)));
    ctx.fillStyle = ctx.strokeStyle = colour;
    ctx.globalAlpha = 0.35 * alpha;
    ctx.fill();
    ctx.globalAlpha = alpha;
    ctx.lineWidth = 2.5;
    ctx.stroke();
    ctx.globalAlpha = 1;
    this.arrow(add(centre, scaled(rolling, -0.3)), add(centre, scaled(rolling, 0.3)), colour, 1.5);
    const bounds = [centre, ...angles(8).map(rim)].map((p) => this.point(p));
    const ends = (k, all) => [Math.min(...all.map((it) => it[k])), Math.max(...all.map((it) => it[k]))];
    const [[left, right], [top, bottom]] = [ends(0, bounds), ends(1, bounds)];
    this.full.push([left, top, right, bottom], ...[-0.3, 0.3].map((s) => this.around(add(centre, scaled(rolling, s)), 4)));
    this.text(scaled(axis, 1 + 2 * r), `wheel ${wheel.name ?? '?'}`, colour, 13);
  }

  torque(torque, limit, told) {
    const direction = unit(torque);
    const share = limit > 0 ? length(torque) / limit : 1;
    // Below one hundredth of the limit the direction is not meaningful.
    if (!direction || share < 0.01) return;
    const colour = this.colours.torque;
    const at = (part) => scaled(direction, FULL * part);
    const tip = Math.min(Math.max(share, LEAST), 1);
    const [from, to] = [[0, 0, 0], at(tip)].map((p) => this.point(p));
    const run = Math.hypot(to[0] - from[0], to[1] - from[1]);
    const alpha = dot(direction, this.frame.eye) < 0 ? 0.8 : 1;
    // A thin line with an end shows how long the arrow is at the limit.
    const side = scaled(across(direction)[0], 0.09);
    this.line(segment([0, 0, 0], at(1)), colour, 1.5, [0.9, 0.5]);
    this.line([add(at(1), side), add(at(1), scaled(side, -1))], colour, 2, [0.9, 0.5]);
    const head = Math.min(3 * THICK, 0.7 * run);
    const neck = from.map((x, k) => to[k] - (head * 0.8 * (to[k] - x)) / Math.max(run, 1));
    const { c } = this;
    for (const [stroke, width] of [[this.colours.ground, THICK + 3], [colour, THICK]]) {
      Object.assign(c, { strokeStyle: stroke, lineWidth: width, globalAlpha: alpha });
      c.beginPath();
      c.moveTo(...from);
      c.lineTo(...neck);
      c.stroke();
    }
    this.head(from, to, Math.max(head, THICK), colour, alpha);
    this.full.push(...[0.5 * tip, tip, 1].map((part) => this.around(at(part), THICK)));
    this.text(at(tip), `${told} N m`, colour, 24, 'torque');
    // An arc about the arrow shows the sense of rotation, by the right-hand rule.
    const [a, b] = across(direction).map((it) => scaled(it, 0.09 + 0.15 * tip));
    const arc = angles(20, 4.6).map((t) => add(at(0.6 * tip), add(scaled(a, Math.cos(t)), scaled(b, Math.sin(t)))));
    this.line(arc, colour, 3, [alpha, alpha]);
    this.head(this.point(arc[18]), this.point(arc[20]), 12, colour, alpha);
  }

  /**
   * Draws where the hand holds the sphere, a band from there to the pointer, and the force with which the scene pushes.
   * Returns the ends of the force.
   */
  grip(grip, pointer, torque, limit) {
    const { c } = this;
    const from = this.point(grip);
    const [dx, dy] = pointer ? [pointer[0] - from[0], pointer[1] - from[1]] : [0, 0];
    const run = Math.hypot(dx, dy);
    // A shorter band is hidden by the hand.
    if (run > BAND) {
      const part = 1 - RING / run;
      c.strokeStyle = this.colours.hand;
      c.lineWidth = 1.5;
      c.beginPath();
      c.moveTo(...from);
      c.lineTo(from[0] + part * dx, from[1] + part * dy);
      c.stroke();
      c.beginPath();
      c.arc(...pointer, RING, 0, 2 * Math.PI);
      c.stroke();
    }
    this.dot(grip, 7, this.colours.hand);
    const force = scaled(cross(torque, grip), limit > 0 ? 1 / limit : 1);
    const share = length(force);
    if (share < 0.01) return [from, from];
    const to = this.point(add(grip, scaled(force, (0.15 + 0.6 * Math.min(share, 1)) / share)));
    c.strokeStyle = this.colours.hand;
    c.lineWidth = 5;
    c.beginPath();
    c.moveTo(...from);
    c.lineTo(...to);
    c.stroke();
    this.head(from, to, 16, this.colours.hand, 1);
    return [from, to];
  }
}

/**
 * Draws the picture. `held` is where a hand holds the sphere, or null. Then `label(ends, full)` gets
 * the ends of its force on the canvas and the rectangles that are full there, px, and returns the
 * one of its own text.
 */
export function draw(canvas, rig, camera, colours, held, label) {
  const { context, width, height } = prepare(canvas);
  const drawing = new Drawing(context, camera.frame, place(width, height), colours);
  const { state, info } = rig;
  const limit = info?.limits.torque ?? 0;
  // Without a state there is no pose to show.
  if (!state) return;
  const { q } = state;
  context.font = '13px system-ui, sans-serif';
  drawing.sphere(q);
  if (state.reference) drawing.reference(state.reference);
  drawing.axes(q);
  info?.rig.wheels.forEach((wheel, k) => drawing.wheel(wheel, info.rig.sphere.radius,
    state.joints[2 * k]?.angle ?? 0, state.joints[2 * k + 1]?.angle ?? 0));
  drawing.torque(state.torque, limit, rig.told);
  const grip = held && drawing.grip(rotated(q, held.grip), held.pointer, state.torque, limit);
  const usual = drawing.texts.map((text) => drawing.rectangle(text, PLACES[0]));
  const corner = new Drawing(context, camera.frame, { x: width - 42, y: 40, radius: 20 }, colours);
  AXES.forEach((axis, k) => {
    const colour = colours.axes[k];
    context.strokeStyle = context.fillStyle = colour;
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(...corner.point([0, 0, 0]));
    context.lineTo(...corner.point(axis));
    context.stroke();
    corner.text(axis, `n${k + 1}`, colour, 11);
  });
  corner.write([], [width, height]);
  const full = [...drawing.full, [width - 80, 0, width, 80]];
  if (grip) {
    const [from, to] = grip;
    const along = [0, 0.5, 1].map((part) => from.map((x, k) => x + part * (to[k] - x)));
    full.push(label(grip, [...usual, ...full]), ...along.map(([x, y]) => [x - 8, y - 8, x + 8, y + 8]));
  }
  drawing.write(full, [width, height]);
}
