"""Converts between frame N and the axes of ROS, Unity, Unreal and CHAI3D.

docs/axes.md has the table and the reasons. All conversions assume that the person sits on the side
of -n2 and looks along n2. Then n1 points to the right, n2 away from the person, and n3 upwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

from .events import Quaternion
from .vectors import Vector


class Axes(Enum):
    """A convention of axes, to which vectors and quaternions of frame N can be converted."""

    ROS = "ros"
    """ROS (REP 103): x forward, y to the left, z up, right-handed."""
    UNITY = "unity"
    """Unity: x to the right, y up, z forward, left-handed."""
    UNREAL = "unreal"
    """Unreal: x forward, y to the right, z up, left-handed. Lengths are in centimetres."""
    CHAI3D = "chai3d"
    """CHAI3D: x towards the person, y to the right, z up, right-handed."""

    def vector(self, n: Sequence[float]) -> Vector:
        """Convert a direction, a force or a linear velocity from frame N. Does not change units."""
        (x, a), (y, b), (z, c) = _XYZ[self]
        return Vector((a * n[x], b * n[y], c * n[z]))

    def vector_to_n(self, v: Sequence[float]) -> Vector:
        """Convert a direction, a force or a linear velocity to frame N."""
        n = [0.0, 0.0, 0.0]
        for (index, sign), component in zip(_XYZ[self], v, strict=True):
            n[index] = sign * component
        return Vector(n)

    def axial(self, n: Sequence[float]) -> Vector:
        """Convert a torque, an angular velocity or a rotation vector from frame N.

        In left-handed axes such a vector also changes its sign, because a positive turn about an
        axis goes the other way there.
        """
        v = self.vector(n)
        return -v if self in _LEFT_HANDED else v

    def axial_to_n(self, v: Sequence[float]) -> Vector:
        """Convert a torque, an angular velocity or a rotation vector to frame N."""
        n = self.vector_to_n(v)
        return -n if self in _LEFT_HANDED else n

    def quaternion(self, q: Sequence[float]) -> Quaternion:
        """Convert an orientation `(w, x, y, z)` of the sphere in frame N.

        Returns:
            The quaternion in the order of the other program: `(w, x, y, z)` for CHAI3D,
            `(x, y, z, w)` for the others. It turns `vector(v)` into `vector(q v)`.
        """
        w = q[0]
        x, y, z = self.axial(q[1:])
        return (w, x, y, z) if self is Axes.CHAI3D else (x, y, z, w)

    def quaternion_to_n(self, q: Sequence[float]) -> Quaternion:
        """Convert an orientation in the order of `quaternion` to `(w, x, y, z)` in frame N."""
        w, vector = (q[0], q[1:]) if self is Axes.CHAI3D else (q[3], q[:3])
        return (w, *self.axial_to_n(vector))


_XYZ = {
    Axes.ROS: ((1, 1.0), (0, -1.0), (2, 1.0)),
    Axes.UNITY: ((0, 1.0), (2, 1.0), (1, 1.0)),
    Axes.UNREAL: ((1, 1.0), (0, 1.0), (2, 1.0)),
    Axes.CHAI3D: ((1, -1.0), (0, 1.0), (2, 1.0)),
}
"""The axes x, y, z: the index of the axis of frame N, and whether they point along it (1) or
against it (-1)."""
_LEFT_HANDED = (Axes.UNITY, Axes.UNREAL)
