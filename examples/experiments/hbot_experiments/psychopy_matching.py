"""The orientation-matching experiment in a window of PsychoPy, which shows sphere and target.

The axes of the sphere are thick lines, those of the target thin ones; both are seen from the person
and from slightly above. The person turns the sphere and presses Return.

PsychoPy's time is CLOCK_MONOTONIC here, so the time of a state is `info.clock.monotonic_ns * 1e-9 +
t` on it, and each trial ends with the last state before the key went down. psychtoolbox, on which
PsychoPy builds, would take the Unix time by default: the variable chooses, before it is loaded.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Sequence
from typing import Any

os.environ.setdefault("PSYCH_GETSECS_CLOCK", "1")

import psychopy.clock
from psychopy import visual
from psychopy.hardware import keyboard

import hbot

from . import matching
from .rotations import Quaternion, rotated
from .trial_log import LogError

FRAME_S = 1 / 60
"""Time between two pictures, s."""
SIZE = 0.35
"""Length of an axis, as a fraction of the window's height."""
ABOVE = math.radians(25)
"""Angle from which the person looks down, rad."""
COLOURS = ("red", "green", "blue")


def seen(v: Sequence[float]) -> tuple[float, float]:
    """Return where a vector of frame N is in the window. The person looks along n2."""
    n1, n2, n3 = v
    return SIZE * n1, SIZE * (n3 * math.cos(ABOVE) + n2 * math.sin(ABOVE))


def tick_0(rig: hbot.Rig) -> float:
    """Return the time of tick 0 in PsychoPy's time, s.

    Raises:
        LogError: PsychoPy has another clock than the server, or the server does not tell its own.
    """
    if abs(psychopy.clock.getTime() - time.monotonic()) > 1e-3:
        raise LogError(
            "PsychoPy's time is not CLOCK_MONOTONIC: set PSYCH_GETSECS_CLOCK=1 before it is loaded"
        )
    clock = rig.refresh().clock
    if clock is None:
        raise LogError("the server does not tell its clock: use one of the version of this program")
    return clock.monotonic_ns * 1e-9


class Window:
    """The window, in which a person takes part."""

    def __init__(self) -> None:
        """Open the window."""
        # A picture must not wait for the screen, because states come meanwhile.
        self._window: Any = visual.Window((800, 800), units="height", waitBlanking=False)
        self._keyboard: Any = keyboard.Keyboard()
        self._lines = [
            visual.Line(self._window, lineColor=colour, lineWidth=width)
            for width in (8, 2)
            for colour in COLOURS
        ]

    def show(self, sphere: Quaternion, target: Quaternion) -> None:
        """Draw both orientations."""
        axes = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
        ends = [rotated(q, axis) for q in (sphere, target) for axis in axes]
        for line, end in zip(self._lines, ends, strict=True):
            line.end = seen(end)
            line.draw()
        self._window.flip()

    def trial(self, rig: hbot.Rig, _number: int, target: Quaternion) -> list[hbot.State]:
        """Let the person turn the sphere, until Return is pressed or time is up."""
        begin = tick_0(rig)
        states: list[hbot.State] = []
        shown = -math.inf
        self._keyboard.clearEvents()
        for state in rig.states(every=10, duration=matching.LONGEST):
            states.append(state)
            if state.t - shown >= FRAME_S:
                shown = state.t
                self.show(state.q, target)
            if pressed := self._keyboard.getKeys(["return"], waitRelease=False):
                at = self._keyboard.clock.getLastResetTime() + pressed[0].rt
                before = [state for state in states if begin + state.t <= at]
                return before or states[:1]
        return states


if __name__ == "__main__":
    matching.main(lambda: Window().trial)
