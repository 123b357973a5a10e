// Vectors of three numbers, and quaternions [w, x, y, z] that rotate sphere axes into frame N.

export const AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const scaled = (a, k) => [a[0] * k, a[1] * k, a[2] * k];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** Returns the unit vector in the direction of `a`, or null if `a` is too short to have one. */
export function unit(a) {
  const norm = length(a);
  return norm > 1e-9 ? scaled(a, 1 / norm) : null;
}

/** Returns two unit vectors that are perpendicular to the unit vector `a` and to each other. */
export function across(a) {
  const other = Math.abs(a[0]) < 0.6 ? AXES[0] : AXES[1];
  const first = unit(cross(a, other));
  return [first, cross(a, first)];
}

export const conjugate = (q) => [q[0], -q[1], -q[2], -q[3]];

export function product(p, q) {
  return [
    p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
    p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
    p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
    p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]];
}

export function normalised(q) {
  const norm = Math.hypot(...q);
  return norm > 0 ? q.map((x) => x / norm) : [1, 0, 0, 0];
}

/** Rotates the vector `v` by the quaternion `q`. */
export function rotated(q, v) {
  const u = [q[1], q[2], q[3]];
  const t = scaled(cross(u, v), 2);
  return add(add(v, scaled(t, q[0])), cross(u, t));
}

/** Returns the quaternion of the rotation vector `r`, rad. */
export function turn(r) {
  const angle = length(r);
  const k = angle < 1e-9 ? 0.5 : Math.sin(angle / 2) / angle;
  return [Math.cos(angle / 2), r[0] * k, r[1] * k, r[2] * k];
}

/** Returns the rotation vector from `p` to `q`, rad. */
export const between = (p, q) => rotation(product(conjugate(p), q));

/** Returns the rotation vector of `q`, rad: the smallest rotation, at most half a turn. */
export function rotation(q) {
  const p = q[0] < 0 ? q.map((x) => -x) : q;
  const e = [p[1], p[2], p[3]];
  const s = length(e);
  return scaled(e, s < 1e-9 ? 2 : 2 * Math.atan2(s, p[0]) / s);
}

/** Returns the least rotation that takes n3 to the unit vector `a`. At -n3 a half turn about n1. */
export function fromN3(a) {
  return a[2] < -1 + 1e-9 ? [0, 1, 0, 0] : normalised([1 + a[2], -a[1], a[0], 0]);
}
