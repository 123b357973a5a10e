"""Vectors of three numbers with arithmetic."""

from __future__ import annotations

import math
import numbers
from collections.abc import Sequence
from typing import Any


class Vector(tuple[float, float, float]):
    """Three numbers, such as a torque in frame N: a tuple that also adds and scales.

    `-0.01 * state.omega`, `a + b`, `a - b`, `a / 2`, `a.norm()`, `a.dot(b)` and `a.cross(b)`. The
    other operand of a sum can be any list or tuple of three numbers. A sum with an array of NumPy
    is an array.
    """

    __slots__ = ()

    def __new__(cls, values: Sequence[float] | Any = (0.0, 0.0, 0.0)) -> Vector:
        """Return the three numbers in `values` as a vector.

        Raises:
            ValueError: there are not three of them.
        """
        vector = super().__new__(cls, values)
        if len(vector) != 3:
            raise ValueError(f"a vector of {len(vector)} numbers; legal: 3")
        return vector

    def __add__(self, other: Any) -> Any:
        if not isinstance(other, (tuple, list)):
            return NotImplemented
        x, y, z = other
        return Vector((self[0] + x, self[1] + y, self[2] + z))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if not isinstance(other, (tuple, list)):
            return NotImplemented
        x, y, z = other
        return Vector((self[0] - x, self[1] - y, self[2] - z))

    def __rsub__(self, other: Any) -> Any:
        return (-self) + other

    def __mul__(self, factor: Any) -> Any:
        if not isinstance(factor, numbers.Real):
            return NotImplemented
        k = float(factor)
        return Vector((self[0] * k, self[1] * k, self[2] * k))

    __rmul__ = __mul__

    def __truediv__(self, divisor: Any) -> Any:
        if not isinstance(divisor, numbers.Real):
            return NotImplemented
        k = float(divisor)
        return Vector((self[0] / k, self[1] / k, self[2] / k))

    def __neg__(self) -> Vector:
        return Vector((-self[0], -self[1], -self[2]))

    def __pos__(self) -> Vector:
        return self

    def norm(self) -> float:
        """Return the length."""
        return math.hypot(*self)

    def dot(self, other: Sequence[float]) -> float:
        """Return the scalar product with `other`."""
        x, y, z = other
        return self[0] * x + self[1] * y + self[2] * z

    def cross(self, other: Sequence[float]) -> Vector:
        """Return the vector product of this vector with `other`, in this order."""
        x, y, z = other
        a, b, c = self
        return Vector((b * z - c * y, c * x - a * z, a * y - b * x))
