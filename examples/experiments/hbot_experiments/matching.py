"""Measures how well a person turns the sphere to a target orientation, with and without guidance.

The targets are turns by a fixed angle about directions that are uniformly distributed. The panel of
hbot shows the target beside the sphere. With guidance, a spring pulls the sphere to the target.
Trials with and without guidance alternate in random order.
"""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean
from typing import Any

import hbot

from . import session
from .rotations import (
    Quaternion,
    Vector,
    angle_between,
    direction,
    exponential,
    product,
    turn_between,
)
from .trial_log import LogError, TrialLog, column

ANGLE = 0.4
"""Angle from the centre to each target, rad. Below the angle at which a rig refuses to enable."""
GUIDANCE = 1.0
"""Stiffness of the guiding spring, N m/rad."""
TRIALS = 24
LONGEST = 10.0
"""Longest time for a trial, s."""
HAND = 1.0
"""Stiffness with which the simulated participant holds the sphere where it wants it, N m/rad."""
HAND_DAMPING = 0.08
"""Damping of that grip, N m s/rad."""
MOVEMENT = 1.0
"""Time in which the simulated participant moves to the target, s."""
STILL = 1.0
"""Time that it then waits until it says that the sphere is there, s."""


@dataclass(frozen=True)
class Trial:
    """One row of the log."""

    trial: int = column("", "number of the trial, from 1")
    unix_time: float = column("s", "Unix time at which the target was shown")
    guidance: float = column("N m/rad", "stiffness of the spring to the target; 0: none")
    target_w: float = column("", "target orientation, a quaternion: w")
    target_x: float = column("", "target orientation: x")
    target_y: float = column("", "target orientation: y")
    target_z: float = column("", "target orientation: z")
    error: float = column("rad", "angle from the target at the end")
    error_1: float = column("rad", "rotation vector from the target to the sphere at the end, n1")
    error_2: float = column("rad", "that rotation vector, n2")
    error_3: float = column("rad", "that rotation vector, n3")
    duration: float = column("s", "time from showing the target until the end")
    path: float = column("rad", "angle turned through, along the way")
    torque: float = column("N m", "root mean square of the torque on the sphere")


Participant = Callable[[hbot.Rig, int, Quaternion], list[hbot.State]]
"""Turns the sphere to a target. Gets the trial's number, returns the states from begin to end."""


def simulated(perception: float, seed: int) -> Participant:
    """Return a participant that sees each target with a normal error of `perception` rad per axis.

    It moves in a straight turn to what it has seen. Its hand is a spring and a damper, made by a
    stream of torques. A guiding spring and the hand then rest between the true target and the seen
    one, so guidance reduces the error by the factor `HAND / (HAND + GUIDANCE)`.
    """

    def turn(rig: hbot.Rig, trial: int, target: Quaternion) -> list[hbot.State]:
        numbers = random.Random(f"perception {seed} {trial}")
        wrong = [numbers.gauss(0, perception) for _ in range(3)]
        seen = product(exponential(wrong), target)
        states: list[hbot.State] = []
        start: Quaternion | None = None
        way: Vector = (0.0, 0.0, 0.0)

        def torque(state: hbot.State) -> list[float]:
            nonlocal start, way
            if start is None:
                start, way = state.q, turn_between(state.q, seen)
            states.append(state)
            part = min((state.t - states[0].t) / MOVEMENT, 1.0)
            # A minimum-jerk movement (Flash and Hogan, J. Neurosci. 5, 1985).
            smooth = part**3 * (10 - 15 * part + 6 * part**2)
            wanted = product(exponential([smooth * w for w in way]), start)
            away = turn_between(state.q, wanted)
            return [HAND * a - HAND_DAMPING * w for a, w in zip(away, state.omega, strict=True)]

        rig.render(torque, every=2, valid_ms=50, duration=MOVEMENT + STILL)
        return states

    return turn


def asked(rig: hbot.Rig, trial: int, target: Quaternion) -> list[hbot.State]:
    """Let the person at the terminal turn the sphere, until Enter is pressed or time is up."""
    import select
    import sys

    print(f"Trial {trial}: turn the sphere to the target and press Enter. ", end="", flush=True)
    states = []
    for state in rig.states(every=10, duration=LONGEST):
        states.append(state)
        if select.select([sys.stdin], [], [], 0)[0]:
            if not sys.stdin.readline():
                raise EOFError
            break
    else:
        print("time is up")
    return states


def scene(simulate: bool) -> dict[str, Any]:
    """Return the scene: a spring to the target, which also tells the panel where the target is."""
    target = {
        "id": "target",
        "kind": "spring",
        "law": "geodesic",
        "stiffness": 0.0,
        "damping": 0.0,
        "reference": [1.0, 0.0, 0.0, 0.0],
    }
    calm = {"id": "calm", "kind": "damper", "damping": 0.01}
    made: dict[str, Any] = {"name": "Orientation matching", "effect": [target, calm]}
    if simulate:
        made["simulate"] = {}
    return made


def targets(seed: int, trials: int) -> list[tuple[Quaternion, float]]:
    """Return the target and the guidance, N m/rad, of each trial.

    Half of the trials have guidance. They depend on the seed alone.
    """
    numbers = random.Random(f"targets {seed}")
    guidance = [GUIDANCE if i % 2 == 0 else 0.0 for i in range(trials)]
    numbers.shuffle(guidance)
    return [(exponential([ANGLE * a for a in direction(numbers)]), k) for k in guidance]


def experiment(
    rig: hbot.Rig, log: TrialLog[Trial], trials: int, seed: int, participant: Participant
) -> None:
    """Run the trials that the log lacks."""
    plan = targets(seed, trials)
    for number in range(len(log.rows) + 1, trials + 1):
        target, guidance = plan[number - 1]
        rig.set("target", stiffness=0.0)
        _show(rig, target)
        rig.set("target", stiffness=guidance)
        states = participant(rig, number, target)
        for state in states:
            if state.mode != "active":
                raise LogError(f"the rig is {state.fault or state.mode}; mend that and start again")
        log.append(_row(rig, number, target, guidance, states))
        print(f"trial {number} of {trials} is done", flush=True)


def _show(rig: hbot.Rig, target: Quaternion) -> None:
    """Move the reference to the target, and wait until it is there: it moves at a limited rate."""
    rig.reference("target", target)
    give_up = time.monotonic() + LONGEST
    for state in rig.states(every=10):
        if state.reference is not None and angle_between(state.reference, target) < 1e-6:
            return
        if time.monotonic() > give_up:
            raise LogError("the reference does not reach the target")


def _row(
    rig: hbot.Rig, number: int, target: Quaternion, guidance: float, states: Sequence[hbot.State]
) -> Trial:
    first, last = states[0], states[-1]
    error = turn_between(target, last.q)
    path = sum(angle_between(a.q, b.q) for a, b in pairwise(states))
    torque = math.sqrt(fmean(sum(t * t for t in state.torque) for state in states))
    began = session.unix_time(rig, first.t)
    duration = last.t - first.t
    return Trial(
        number, began, guidance, *target, math.hypot(*error), *error, duration, path, torque
    )


def summary(rows: Sequence[Trial]) -> str:
    """Return the mean error and duration with and without guidance, as lines of text."""
    lines = []
    for name, guided in (("with guidance", True), ("without guidance", False)):
        part = [row for row in rows if (row.guidance > 0) == guided]
        if part:
            error = math.sqrt(fmean(row.error**2 for row in part))
            took = fmean(row.duration for row in part)
            lines.append(
                f"{name}: root mean square error {error:.4f} rad, mean time {took:.2f} s, "
                f"{len(part)} trials"
            )
    return "\n".join(lines)


def main(person: Callable[[], Participant] = lambda: asked) -> None:
    """Run the experiment from the command line.

    `person` returns how a person takes part, and is not called with `--simulate`.
    """
    parser = session.parser(__doc__.splitlines()[0], TRIALS)
    parser.add_argument(
        "--perception",
        type=float,
        default=0.05,
        help="error of a simulated participant's eye, rad per axis; default: 0.05",
    )
    options = parser.parse_args()
    settings = {
        "experiment": "orientation matching",
        "participant": options.participant,
        "seed": options.seed,
        "trials": options.trials,
        "simulated_perception": options.perception if options.simulate else None,
    }
    participant = simulated(options.perception, options.seed) if options.simulate else person()
    path = options.folder / f"{options.participant}-matching.csv"

    def run(rig: hbot.Rig) -> None:
        with TrialLog(path, Trial, settings) as log:
            if not options.simulate:
                input("Hold the sphere at its centre and press Enter. ")
            session.start(rig, scene(options.simulate))
            experiment(rig, log, options.trials, options.seed, participant)
            print(f"{summary(log.rows)}\nLog: {path}")

    session.run(options, run, "the matching experiment")


if __name__ == "__main__":
    main()
