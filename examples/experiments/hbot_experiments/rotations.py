"""Quaternions `(w, x, y, z)` that rotate sphere axes into N, and rotation vectors in N, rad."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]


def product(a: Sequence[float], b: Sequence[float]) -> Quaternion:
    """Return the quaternion of the rotation `b` followed by `a`."""
    (aw, ax, ay, az), (bw, bx, by, bz) = a, b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def inverse(q: Sequence[float]) -> Quaternion:
    """Return the inverse of a unit quaternion."""
    w, x, y, z = q
    return (w, -x, -y, -z)


def rotated(q: Sequence[float], v: Sequence[float]) -> Vector:
    """Return the vector `v`, turned by a unit quaternion."""
    return product(product(q, (0.0, *v)), inverse(q))[1:]


def exponential(turn: Sequence[float]) -> Quaternion:
    """Return the quaternion of a rotation vector, rad."""
    angle = math.hypot(*turn)
    if angle == 0.0:
        return (1.0, 0.0, 0.0, 0.0)
    factor = math.sin(angle / 2) / angle
    return (math.cos(angle / 2), factor * turn[0], factor * turn[1], factor * turn[2])


def logarithm(q: Sequence[float]) -> Vector:
    """Return the shortest rotation vector of a unit quaternion, rad. Its length is at most pi."""
    w, x, y, z = q if q[0] >= 0 else (-q[0], -q[1], -q[2], -q[3])
    sine = math.hypot(x, y, z)
    if sine == 0.0:
        return (0.0, 0.0, 0.0)
    factor = 2 * math.atan2(sine, w) / sine
    return (factor * x, factor * y, factor * z)


def turn_between(start: Sequence[float], end: Sequence[float]) -> Vector:
    """Return the rotation vector in frame N that turns `start` into `end`, rad."""
    return logarithm(product(end, inverse(start)))


def angle_between(start: Sequence[float], end: Sequence[float]) -> float:
    """Return the angle between two orientations, rad, from 0 to pi."""
    return math.hypot(*turn_between(start, end))


def direction(numbers: random.Random) -> Vector:
    """Return a unit vector whose direction is uniformly distributed."""
    while True:
        vector = (numbers.gauss(0, 1), numbers.gauss(0, 1), numbers.gauss(0, 1))
        length = math.hypot(*vector)
        if length > 1e-6:
            return (vector[0] / length, vector[1] / length, vector[2] / length)
