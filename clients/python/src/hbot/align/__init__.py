"""Corrects the orientation of an Hbot by measurements from outside, until it is stopped.

    python -m hbot.align fictrac --port 4290
    ffmpeg -loglevel error -f v4l2 -i /dev/video0 -f rawvideo -pix_fmt gray - |
        python -m hbot.align apriltags --layout tags.toml --size 640x480

The program takes the lease, because only its holder may correct the orientation. A program that
commands the rig itself uses the sources in its own loop:

    for measured in Fictrac(socket):
        rig.align(measured.q, sigma=measured.sigma)

`fictrac` needs nothing but Python. `apriltags` needs the extra `align`.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..turns import Quaternion, Turn


@dataclass(frozen=True, slots=True)
class Measured:
    """An orientation of the sphere that was measured from outside."""

    q: Quaternion
    """The orientation: quaternion (w, x, y, z) that turns the sphere's axes into frame N."""
    sigma: Turn
    """Standard deviations of its error about the axes of frame N, rad."""
    age: float = 0.0
    """Time since the measurement, s."""


__all__ = ["Measured"]
