"""FicTrac's lines over UDP: a camera that follows the pattern on a sphere.

FicTrac sends one line for each picture, `FT, ` and numbers with commas between them. Numbers 12 to
14 are the orientation of the sphere as a rotation vector in FicTrac's laboratory frame, rad
(FicTrac's `doc/data_header.txt`). It begins at zero in the first picture. FicTrac finds the pattern
again in its map of the sphere, so this orientation does not drift.
"""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator

from .. import turns
from ..turns import Quaternion
from . import Measured

ORIENTATION = slice(12, 15)
"""Where the orientation is in a line, counted from `FT` as 0."""
LARGEST_LINE = 4096
"""Longest datagram that is read, bytes."""


def orientation(line: bytes) -> Quaternion | None:
    """Return the orientation in a line, in FicTrac's frames. None: it is no line of FicTrac."""
    fields = line.split(b",")
    if fields[0].strip() != b"FT" or len(fields) < ORIENTATION.stop:
        return None
    try:
        turn = [float(field) for field in fields[ORIENTATION]]
    except ValueError:
        return None
    # FicTrac's angles are at most pi. This also leaves out what is not a number.
    if not sum(x * x for x in turn) < 100.0:
        return None
    return turns.exp(turn)


class Fictrac:
    """Orientations of the sphere in frame N, one for each line that arrives."""

    def __init__(
        self,
        lines: socket.socket,
        first: Callable[[], Quaternion],
        frame: Quaternion = (1.0, 0.0, 0.0, 0.0),
        sigma: float = 0.02,
        delay: float = 0.0,
    ) -> None:
        """Wait for lines at the bound UDP socket `lines`.

        Args:
            lines: the socket.
            first: called at the first line. Returns the orientation of the sphere in frame N, such
                as `next(rig.states()).q`, because FicTrac's own begins at zero.
            frame: quaternion that turns the axes of FicTrac's laboratory frame into frame N.
            sigma: standard deviation of the error about each axis, rad.
            delay: time from the picture to its line, s.
        """
        self._lines = lines
        self._first = first
        self._frame = frame
        self._sigma = (sigma, sigma, sigma)
        self._delay = delay
        self._body: Quaternion | None = None

    def __iter__(self) -> Iterator[Measured]:
        """Return what the lines say, as they arrive. Ends when the socket times out."""
        while True:
            try:
                line = self._lines.recv(LARGEST_LINE)
            except TimeoutError:
                return
            q = orientation(line)
            if q is not None:
                yield Measured(self._in_n(q), self._sigma, self._delay)

    def _in_n(self, q: Quaternion) -> Quaternion:
        turned = turns.times(self._frame, q)
        if self._body is None:
            self._body = turns.times(turns.conjugate(turned), self._first())
        return turns.times(turned, self._body)
