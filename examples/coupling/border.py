"""Which stiffness couples two spheres stably? The linear theory of docs/coupling.md.

Two equal inertias turn about one axis. Each has a damper to the ground, and a spring to where the
other was some time ago:

    I x1'' = -b x1'(t - lag) - k (x1(t - lag) - x2(t - lag - delay)),   and x2 likewise

The sum and the difference of both angles are independent. With s the Laplace variable:

    I s² + c s + g + b s exp(-s lag) + k exp(-s lag) (1 - sign exp(-s delay)) = 0

where the sign is 1 for the sum and -1 for the difference. c and g are the damper and the spring
with which a hand that keeps still holds each sphere; without a hand they are 0.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Complex = NDArray[np.complex128]
DIFFERENCE, SUM = -1, 1


@dataclass(frozen=True)
class Coupled:
    """Two spheres that are coupled."""

    inertia: float
    """Of each sphere, with what is held to it, kg m²."""
    damping: float
    """Of each sphere's own rotation, N m s/rad."""
    delay: float
    """From the tick of an orientation to the tick in which it acts on the other sphere, s."""
    lag: float
    """From the reading of the joints until the torque computed from it, in the mean, s."""
    grip_stiffness: float = 0.0
    """Of the spring with which a hand holds each sphere, N m/rad. It acts without lag."""
    grip_damping: float = 0.0
    """Of the damper with which a hand holds each sphere, N m s/rad. It acts without lag."""

    def stiffness(self, omega: Numbers, sign: int) -> Complex:
        """Return the stiffness with which `j omega` solves the characteristic equation, N m/rad.

        It is real only at a border of stability.

        Args:
            omega: angular frequencies, rad/s.
            sign: `DIFFERENCE` or `SUM` of both angles.
        """
        s = 1j * omega
        mechanics = self.inertia * s * s + self.grip_damping * s + self.grip_stiffness
        own = mechanics * np.exp(s * self.lag) + self.damping * s
        stiffness: Complex = -own / (1.0 - sign * np.exp(-s * self.delay))
        return stiffness

    def border(self) -> tuple[float, float]:
        """Return the least unstable stiffness, N m/rad, and the frequency of its swing, rad/s.

        Scans the frequency for points at which the stiffness is real and positive.
        """
        found = [crossing for sign in (DIFFERENCE, SUM) for crossing in self._crossings(sign)]
        return min(found)

    def _crossings(self, sign: int) -> list[tuple[float, float]]:
        # Without a hand, a swing at the border turns by less than a whole turn of phase within the
        # delay. A hand's spring adds swings near its own frequency.
        highest = 2.0 * math.pi / self.delay + 10.0 * math.sqrt(self.grip_stiffness / self.inertia)
        grid = np.linspace(highest * 1e-5, highest * (1.0 - 1e-5), 20001)
        imaginary = self.stiffness(grid, sign).imag
        crossings = []
        for at in np.flatnonzero(np.diff(np.sign(imaginary))):
            low, high = float(grid[at]), float(grid[at + 1])
            negative = imaginary[at] < 0.0
            for _ in range(60):
                middle = 0.5 * (low + high)
                if (self._at(middle, sign).imag < 0.0) == negative:
                    low = middle
                else:
                    high = middle
            value = self._at(low, sign)
            # At a pole the sign changes too, with a large value on either side.
            if value.real > 0.0 and abs(value.imag) < 1e-6 * value.real:
                crossings.append((value.real, low))
        return crossings

    def _at(self, omega: float, sign: int) -> complex:
        return complex(self.stiffness(np.array([omega]), sign)[0])

    def growth(self, stiffness: float) -> complex:
        """Return the root of the difference that grows fastest, 1/s and rad/s.

        Follows the root from the border, where it is known, in small steps by Newton's method.
        """
        start, omega = self.border()
        s = 1j * omega
        for k in np.linspace(start, stiffness, 50):
            for _ in range(20):
                step = self._newton(s, float(k))
                s -= step
                if abs(step) < 1e-12 * abs(s):
                    break
        return s

    def _newton(self, s: complex, k: float) -> complex:
        late = cmath.exp(-s * self.lag)
        other = cmath.exp(-s * self.delay)
        hand = self.grip_damping * s + self.grip_stiffness
        value = self.inertia * s * s + hand + late * (self.damping * s + k * (1.0 + other))
        slope = (
            2.0 * self.inertia * s
            + self.grip_damping
            + late * (self.damping - k * self.delay * other)
            - self.lag * late * (self.damping * s + k * (1.0 + other))
        )
        return value / slope
