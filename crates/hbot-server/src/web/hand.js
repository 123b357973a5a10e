// A hand for the simulated sphere: pointer or arrow keys turn it, and the scene pushes back. With
// Shift, beside the sphere, with two fingers, or where there is no such hand, they turn the view.

import { add, conjugate, cross, dot, normalised, product, rotated, scaled, turn } from './maths.js';
import { place } from './sphere.js';

/** How fast an arrow key turns the sphere or the view, rad/s. */
const KEY_RATE = 0.8;
/** How far the mouse wheel twists the sphere, rad for each pixel that it scrolls. */
const TWIST = 0.003;
const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class Hand {
  /**
   * `may()` returns whether there is a hand to take, and `move(q)` sends the orientation to which
   * it moves, or null to let go. At most one request is on its way.
   */
  constructor(canvas, rig, camera, { may, move, changed }) {
    Object.assign(this, { canvas, rig, camera, may, send: move, changed });
    this.held = null;
    this.pointers = new Map();
    this.keys = new Map();
    this.busy = false;
    this.unsent = false;
    canvas.addEventListener('pointerdown', (event) => this.down(event));
    canvas.addEventListener('pointermove', (event) => this.drag(event));
    for (const kind of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      canvas.addEventListener(kind, (event) => this.up(event));
    }
    canvas.addEventListener('wheel', (event) => this.wheel(event), { passive: false });
    canvas.addEventListener('dblclick', () => {
      camera.home();
      changed();
    });
    canvas.addEventListener('keydown', (event) => this.key(event));
    canvas.addEventListener('keyup', (event) => this.keyUp(event.key));
    canvas.addEventListener('blur', () => [...this.keys.keys()].forEach((key) => this.keyUp(key)));
    window.addEventListener('blur', () => this.letGo());
  }

  get at() {
    return place(this.canvas.clientWidth, this.canvas.clientHeight);
  }

  /** Returns the point of the sphere under the pointer, in frame N, or null beside the sphere. */
  under(x, y) {
    const { at } = this;
    const [u, v] = [(x - at.x) / at.radius, (at.y - y) / at.radius];
    const square = u * u + v * v;
    if (square > 1) return null;
    const { right, up, eye } = this.camera.frame;
    return add(add(scaled(right, u), scaled(up, v)), scaled(eye, Math.sqrt(1 - square)));
  }

  take(grip, pointer) {
    const q = this.rig.state.q;
    this.held = { q, grip: rotated(conjugate(q), grip), pointer };
    this.move();
  }

  /** Turns the hand by a motion on the screen, in units of the sphere's radius. */
  turn(dx, dy) {
    const { right, up, eye } = this.camera.frame;
    const motion = add(scaled(right, dx), scaled(up, -dy));
    this.held.q = normalised(product(turn(cross(eye, motion)), this.held.q));
    this.move();
  }

  down(event) {
    if (event.button !== 0) return;
    this.canvas.setPointerCapture(event.pointerId);
    const [x, y] = [event.offsetX, event.offsetY];
    this.pointers.set(event.pointerId, [x, y]);
    if (this.pointers.size > 1) {
      this.letGo();
      return;
    }
    const grip = this.under(x, y);
    if (grip && !event.shiftKey && this.may()) this.take(grip, [x, y]);
    this.changed();
  }

  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const [x, y] = [event.offsetX, event.offsetY];
    const [dx, dy] = [x - before[0], y - before[1]];
    this.pointers.set(event.pointerId, [x, y]);
    const { radius } = this.at;
    if (this.held?.pointer) {
      this.held.pointer = [x, y];
      this.turn(dx / radius, dy / radius);
    } else {
      this.camera.orbit(dx / this.pointers.size, dy / this.pointers.size, radius);
    }
    this.changed();
  }

  up(event) {
    this.pointers.delete(event.pointerId);
    if (this.held?.pointer) this.letGo();
  }

  /** Twists the held sphere about the line of sight. */
  wheel(event) {
    if (!this.held) return;
    event.preventDefault();
    const pixels = event.deltaY * [1, 16, 160][event.deltaMode];
    this.held.q = normalised(product(turn(scaled(this.camera.frame.eye, -TWIST * pixels)), this.held.q));
    this.move();
    this.changed();
  }

  key(event) {
    if (!(event.key in KEYS) || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    const view = event.shiftKey || !(this.held || this.may());
    if (!this.keys.has(event.key)) this.keys.set(event.key, view);
    if (!view && !this.held) this.take(this.camera.frame.eye, null);
    this.changed();
  }

  keyUp(key) {
    this.keys.delete(key);
    const turns = [...this.keys.values()].some((view) => !view);
    if (this.held && !this.held.pointer && !turns) this.letGo();
  }

  /** Moves on by what the keys ask for in `dt` seconds. Returns whether a key is down. */
  step(dt) {
    for (const [key, view] of this.keys) {
      const [dx, dy] = KEYS[key].map((x) => x * KEY_RATE * Math.min(dt, 0.1));
      if (view) this.camera.orbit(dx, dy, 1);
      else if (this.held) this.turn(dx, dy);
    }
    return this.keys.size > 0;
  }

  letGo() {
    if (!this.held) return;
    this.held = null;
    this.move();
    this.changed();
  }

  /** Forgets the hand without a request, because the connection or the lease has gone. */
  drop() {
    this.held = null;
    this.unsent = false;
  }

  /** Sends the newest orientation as soon as the last one has been answered. */
  move() {
    if (this.busy) {
      this.unsent = true;
      return;
    }
    this.busy = true;
    this.unsent = false;
    // After a failed move nothing says where the hand is, so it lets go. A release that waits stays.
    this.send(this.held?.q ?? null).catch(() => this.letGo()).then(() => {
      this.busy = false;
      if (this.unsent) this.move();
    });
  }

  /** Returns the force of the scene at the grip, N, and its torque, N m. Null if not held. */
  get force() {
    const { state, info } = this.rig;
    if (!this.held || !state || !info) return null;
    const radius = info.rig.sphere.radius;
    const force = scaled(cross(state.torque, rotated(state.q, this.held.grip)), 1 / radius);
    return { newtons: Math.sqrt(dot(force, force)), torque: Math.hypot(...state.torque) };
  }
}
