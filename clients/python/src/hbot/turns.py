"""Turns: quaternions (w, x, y, z) and rotation vectors, rad. Plain numbers, which are quick."""

from __future__ import annotations

import math
from collections.abc import Iterable

Quaternion = tuple[float, float, float, float]
Turn = tuple[float, float, float]


def conjugate(q: Iterable[float]) -> Quaternion:
    """Return the opposite turn."""
    w, x, y, z = q
    return (w, -x, -y, -z)


def times(a: Iterable[float], b: Iterable[float]) -> Quaternion:
    """Return the turn `a` after the turn `b`."""
    (aw, ax, ay, az), (bw, bx, by, bz) = a, b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by + ay * bw + az * bx - ax * bz,
        aw * bz + az * bw + ax * by - ay * bx,
    )


def exp(turn: Iterable[float]) -> Quaternion:
    """Return the quaternion of a rotation vector."""
    x, y, z = turn
    angle = math.sqrt(x * x + y * y + z * z)
    factor = math.sin(angle / 2) / angle if angle > 1e-9 else 0.5
    return (math.cos(angle / 2), factor * x, factor * y, factor * z)


def log(q: Iterable[float]) -> Turn:
    """Return the rotation vector of the shortest turn."""
    w, x, y, z = q
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
    return (factor * x, factor * y, factor * z)
