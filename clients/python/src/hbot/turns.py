"""Turns as arrays of numpy: quaternions (w, x, y, z) and rotation vectors, rad."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = Any
"""An array of numpy."""


def conjugate(q: Any) -> Array:
    """Return the opposite turn."""
    return np.array([q[0], -q[1], -q[2], -q[3]])


def times(a: Any, b: Any) -> Array:
    """Return the turn `a` after the turn `b`."""
    (aw, ax, ay, az), (bw, bx, by, bz) = a, b
    return np.array(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by + ay * bw + az * bx - ax * bz,
            aw * bz + az * bw + ax * by - ay * bx,
        ]
    )


def exp(turn: Array) -> Array:
    """Return the quaternion of a rotation vector."""
    angle = float(np.linalg.norm(turn))
    factor = np.sin(angle / 2) / angle if angle > 1e-9 else 0.5
    return np.concatenate([[np.cos(angle / 2)], factor * np.asarray(turn)])


def log(q: Array) -> Array:
    """Return the rotation vector of the shortest turn."""
    if q[0] < 0.0:
        q = -q
    sine = float(np.linalg.norm(q[1:]))
    factor = 2.0 * np.arctan2(sine, q[0]) / sine if sine > 1e-12 else 2.0
    return np.asarray(factor * q[1:])
