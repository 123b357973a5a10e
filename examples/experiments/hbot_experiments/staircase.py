"""An adaptive staircase for a two-interval forced choice."""

from __future__ import annotations

from dataclasses import dataclass, field

START = 0.8
"""First difference of stiffness, as a fraction of the standard. Nearly everybody feels it."""
LARGEST = 2.0
"""Largest difference, as a fraction of the standard."""
CORRECT_FOR_HARDER = 3
"""Correct answers in a row that make the task harder. The staircase then stays near the difference
at which 79.4 % of the answers are correct: `0.5 ** (1 / 3)` (Levitt, Transformed up-down methods in
psychoacoustics, J. Acoust. Soc. Am. 49, 1971)."""
COARSE = 2**0.5
"""Factor of a step before the third reversal."""
FINE = 2**0.25
"""Factor of a step from the third reversal on."""


@dataclass
class Staircase:
    """Chooses the difference of each trial from the answers before it.

    Until the first wrong answer, each correct answer halves the difference.
    """

    difference: float = START
    """Difference of the next trial, as a fraction of the standard."""
    reversals: int = 0
    """How often the direction of the steps has changed."""
    _correct_in_a_row: int = 0
    _harder: bool = True
    _missed: bool = field(default=False, repr=False)

    def record(self, correct: bool) -> None:
        """Take the answer of a trial into account."""
        if not correct:
            self._missed = True
            self._correct_in_a_row = 0
            self._step(harder=False)
            return
        self._correct_in_a_row += 1
        if not self._missed or self._correct_in_a_row == CORRECT_FOR_HARDER:
            self._correct_in_a_row = 0
            self._step(harder=True)

    def _step(self, harder: bool) -> None:
        if harder != self._harder:
            self.reversals += 1
            self._harder = harder
        fine = COARSE if self.reversals < 3 else FINE
        factor = fine if self._missed else 2.0
        changed = self.difference / factor if harder else self.difference * factor
        self.difference = min(changed, LARGEST)
