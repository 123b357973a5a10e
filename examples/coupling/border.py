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

    def stiffness(self, omega: float, sign: int) -> complex:
        """Return the stiffness with which `j omega` solves the characteristic equation, N m/rad.

        It is real only at a border of stability.
        """
        s = 1j * omega
        own = self._mechanics(s) * cmath.exp(s * self.lag) + self.damping * s
        return -own / (1.0 - sign * cmath.exp(-s * self.delay))

    def border(self) -> tuple[float, float]:
        """Return the least unstable stiffness, N m/rad, and the frequency of its swing, rad/s.

        Scans the frequency for points at which the stiffness is real and positive.
        """
        found = [crossing for sign in (DIFFERENCE, SUM) for crossing in self._crossings(sign)]
        return min(found)

    def _crossings(self, sign: int) -> list[tuple[float, float]]:
        # A swing of the border turns by less than a whole turn within a delay, and its frequency
        # is far above that of a damper alone.
        highest = math.pi / self.lag / 2.0 if self.delay == 0.0 else 2.0 * math.pi / self.delay
        grid = np.linspace(highest * 1e-5, highest * (1.0 - 1e-5), 20001)
        imaginary = np.array([self.stiffness(omega, sign).imag for omega in grid])
        crossings = []
        for at in np.flatnonzero(np.diff(np.sign(imaginary))):
            low, high = float(grid[at]), float(grid[at + 1])
            negative = imaginary[at] < 0.0
            for _ in range(60):
                middle = 0.5 * (low + high)
                if (self.stiffness(middle, sign).imag < 0.0) == negative:
                    low = middle
                else:
                    high = middle
            value = self.stiffness(low, sign)
            # At a pole the sign changes too, with a large value on either side.
            if value.real > 0.0 and abs(value.imag) < 1e-6 * value.real:
                crossings.append((value.real, low))
        return crossings

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

    def _mechanics(self, s: complex) -> complex:
        """Return the torque that turns a sphere and its hand, per angle, N m/rad."""
        return self.inertia * s * s + self.grip_damping * s + self.grip_stiffness

    def _newton(self, s: complex, k: float) -> complex:
        late = cmath.exp(-s * self.lag)
        other = cmath.exp(-s * self.delay)
        value = self._mechanics(s) + late * (self.damping * s + k * (1.0 + other))
        slope = (
            2.0 * self.inertia * s
            + self.grip_damping
            + late * (self.damping - k * self.delay * other)
            - self.lag * late * (self.damping * s + k * (1.0 + other))
        )
        return value / slope
