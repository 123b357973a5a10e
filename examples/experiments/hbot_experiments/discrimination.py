"""Measures the smallest difference of stiffness that a person feels.

In each trial the participant feels two springs, one after the other, and says which was stiffer (a
two-interval forced choice). One has the standard stiffness, the other is stiffer. A staircase
chooses the difference. At the end, the psychometric function is fitted and drawn.
"""

from __future__ import annotations

import functools
import math
import random
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import hbot

from . import psychometric, session
from .rotations import logarithm
from .staircase import LARGEST, Staircase
from .trial_log import LogError, TrialLog, column

STANDARD = 1.0
"""Stiffness of the standard, N m/rad: 0.3 N m at 0.3 rad."""
INTERVAL = 2.0
"""Length of an interval, s."""
SETTLE = 0.1
"""Start of an interval that is left out of `felt`, s: a change of stiffness is blended in."""
TRIALS = 80
IDENTITY = [1.0, 0.0, 0.0, 0.0]
HAND = {"amplitude": 0.15, "rate": 1.0}
"""How the simulated participant moves the sphere: amplitude about each axis, rad; frequency, Hz."""


@dataclass(frozen=True)
class Trial:
    """One row of the log."""

    trial: int = column("", "number of the trial, from 1")
    unix_time: float = column("s", "Unix time at which the first interval began")
    difference: float = column("", "(comparison - standard) / standard, in stiffness")
    standard_first: int = column("", "1: the standard was the first interval; 0: the second")
    answer: int = column("", "the interval that the participant called stiffer, 1 or 2")
    correct: int = column("", "1: the answer was correct; 0: it was wrong")
    felt_1: float = column("N m/rad", "stiffness of interval 1, measured from torques and angles")
    felt_2: float = column("N m/rad", "stiffness of interval 2, measured in the same way")
    moved_1: float = column("rad", "root mean square angle from the centre in interval 1")
    moved_2: float = column("rad", "root mean square angle from the centre in interval 2")


@dataclass(frozen=True)
class Felt:
    """What was felt in an interval."""

    stiffness: float
    """Measured stiffness, N m/rad. NaN if the sphere did not move."""
    moved: float
    """Root mean square angle from the centre, rad."""


Judge = Callable[[int, Felt, Felt], int]
"""Returns the interval that is stiffer, 1 or 2. Gets the number of the trial and what was felt."""
Interval = Callable[[float], tuple[Felt, float]]
"""Renders a stiffness, N m/rad. Returns what was felt, and the Unix time of its begin, s."""


def simulated(weber: float, seed: int) -> Judge:
    """Return a participant with this Weber fraction, who judges the stiffness that was measured.

    The noise of a trial depends on the seed and the trial's number alone.
    """
    noise = psychometric.sensation_noise(weber)

    def judge(trial: int, first: Felt, second: Felt) -> int:
        numbers = random.Random(f"sensation {seed} {trial}")
        if not (first.stiffness > 0 and second.stiffness > 0):
            raise LogError("the simulated hand did not move the sphere")
        sensations = [
            math.log(felt.stiffness) + numbers.gauss(0, noise) for felt in (first, second)
        ]
        return 1 if sensations[0] > sensations[1] else 2

    return judge


def asked(trial: int, first: Felt, second: Felt) -> int:
    """Ask the person at the terminal."""
    while True:
        answer = input(f"Trial {trial}: which spring was stiffer, 1 or 2? ").strip()
        if answer in ("1", "2"):
            return int(answer)
        print("Type 1 or 2.")


def scene(simulate: bool) -> dict[str, Any]:
    """Return the scene: one spring to the centre. The simulated hand moves the sphere about it."""
    spring = {
        "id": "spring",
        "kind": "spring",
        "law": "geodesic",
        "stiffness": STANDARD,
        "damping": 0.02,
        "reference": IDENTITY,
    }
    made: dict[str, Any] = {"name": "Stiffness discrimination", "effect": [spring]}
    if simulate:
        made["simulate"] = {"hand": HAND}
    return made


def measure(states: Iterable[hbot.State]) -> Felt:
    """Return the stiffness between torques and angles by least squares, and how far the hand moved.

    Damping does not change the result: over whole swings, its torque is not correlated with the
    angle.
    """
    product = square = 0.0
    count = 0
    for state in states:
        angle = logarithm(state.q)
        product -= sum(a * t for a, t in zip(angle, state.torque, strict=True))
        square += sum(a * a for a in angle)
        count += 1
    if square == 0.0:
        return Felt(math.nan, 0.0)
    return Felt(product / square, math.sqrt(square / count))


def feel(rig: hbot.Rig, stiffness: float) -> tuple[Felt, float]:
    """Render one interval. Returns what was felt, and the Unix time of its begin, s."""
    rig.set("spring", stiffness=stiffness)
    states = list(rig.states(every=10, duration=INTERVAL))
    for state in states:
        if state.mode != "active":
            raise LogError(f"the rig is {state.fault or state.mode}; mend that and start again")
    begin = states[0].t
    felt = measure(state for state in states if state.t >= begin + SETTLE)
    return felt, session.unix_time(rig, begin)


def experiment(
    render: Interval, log: TrialLog[Trial], trials: int, seed: int, judge: Judge, person: bool
) -> None:
    """Run the trials that the log lacks."""
    staircase = Staircase()
    for row in log.rows:
        staircase.record(row.correct == 1)
    for number in range(len(log.rows) + 1, trials + 1):
        if person:
            input(f"Trial {number} of {trials}: hold the sphere at its centre and press Enter. ")
        difference = staircase.difference
        standard_first = random.Random(f"order {seed} {number}").random() < 0.5
        pair = [STANDARD, STANDARD * (1 + difference)]
        if not standard_first:
            pair.reverse()
        (first, unix_time), (second, _) = (render(k) for k in pair)
        answer = judge(number, first, second)
        correct = answer == (2 if standard_first else 1)
        staircase.record(correct)
        row = Trial(
            number,
            unix_time,
            difference,
            int(standard_first),
            answer,
            int(correct),
            first.stiffness,
            second.stiffness,
            first.moved,
            second.moved,
        )
        log.append(row)
        print(f"trial {number} of {trials} is done", flush=True)


def interval(rig: hbot.Rig, stiffness: float, person: bool) -> tuple[Felt, float]:
    """Render an interval as `feel` does, and tell a person when to move."""
    if person:
        print("Turn the sphere to and fro.", flush=True)
    result = feel(rig, stiffness)
    if person:
        print("Pause.", flush=True)
        rig.set("spring", stiffness=0.0)
    return result


def answers(rows: Sequence[Trial]) -> list[psychometric.Answer]:
    """Return the differences and answers of a log, for the fit."""
    return [(row.difference, row.correct == 1) for row in rows]


def main() -> None:
    """Run the experiment from the command line."""
    parser = session.parser(__doc__.splitlines()[0], TRIALS)
    parser.add_argument(
        "--weber", type=float, default=0.2, help="Weber fraction of a simulated participant"
    )
    options = parser.parse_args()
    settings = {
        "experiment": "stiffness discrimination",
        "participant": options.participant,
        "seed": options.seed,
        "standard": STANDARD,
        "simulated_weber": options.weber if options.simulate else None,
    }
    judge = simulated(options.weber, options.seed) if options.simulate else asked
    path = options.folder / f"{options.participant}-discrimination.csv"

    def run(rig: hbot.Rig) -> None:
        check(rig)
        with TrialLog(path, Trial, settings) as log:
            if not options.simulate:
                input("Hold the sphere at its centre and press Enter. ")
            session.start(rig, scene(options.simulate))
            person = not options.simulate
            render = functools.partial(interval, rig, person=person)
            experiment(render, log, options.trials, options.seed, judge, person)
            found = psychometric.fit(answers(log.rows))
            picture = path.with_suffix(".svg")
            psychometric.plot(answers(log.rows), found, picture)
        print(
            f"Weber fraction {found.weber:.3f}, 95 % interval {found.low:.3f} to {found.high:.3f}, "
            f"from {found.trials} trials.\nLog: {path}\nPlot: {picture}"
        )

    # A simulated participant feels and compares, but streams nothing.
    session.run(options, run, None if options.simulate else "the experiment with a person")


def check(rig: hbot.Rig) -> None:
    """Refuse a rig that cannot render the stiffest comparison.

    Raises:
        LogError: the rig cannot.
    """
    stiffest = STANDARD * (1 + LARGEST)
    render = rig.info.render
    if render is not None and render.stiffness_stable < stiffest:
        raise LogError(
            f"this rig renders at most {render.stiffness_stable:.1f} N m/rad, "
            f"and the experiment needs {stiffest:.1f}"
        )


if __name__ == "__main__":
    main()
