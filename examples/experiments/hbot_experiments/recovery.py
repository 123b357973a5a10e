"""Shows that the stiffness experiment recovers the Weber fraction of simulated participants.

Each run is a whole experiment on the server's simulated rig. Use a server in virtual time, which is
much faster: `hbot server --time virtual`. With `--without-hand`, the participants feel exactly the
stiffness that was set, and no server is needed. The difference is what hand and rig contribute.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import io
import tempfile
from pathlib import Path
from statistics import fmean, stdev

import hbot

from . import session
from .discrimination import (
    HAND,
    TRIALS,
    Felt,
    Interval,
    Trial,
    answers,
    experiment,
    feel,
    scene,
    simulated,
)
from .psychometric import Fit, fit
from .trial_log import LogError, TrialLog

WEBER = (0.1, 0.2, 0.3)
RUNS = 20


def exactly(stiffness: float) -> tuple[Felt, float]:
    """Feel a stiffness without a rig."""
    return Felt(stiffness, HAND["amplitude"]), 0.0


def run(render: Interval, folder: Path, weber: float, seed: int) -> Fit:
    """Run one whole experiment with a simulated participant. Returns the fit."""
    settings = {"weber": weber, "seed": seed}
    with (
        contextlib.redirect_stdout(io.StringIO()),
        TrialLog(folder / f"{weber}-{seed}.csv", Trial, settings) as log,
    ):
        experiment(render, log, TRIALS, seed, simulated(weber, seed), person=False)
        return fit(answers(log.rows))


def recover(render: Interval, runs: int) -> None:
    """Run all experiments and print a table."""
    print(f"{runs} runs of {TRIALS} trials for each Weber fraction, seeds from 1")
    print("true   mean   bias   standard deviation   true value in the 95 % interval")
    with tempfile.TemporaryDirectory() as folder:
        for weber in WEBER:
            fits = [run(render, Path(folder), weber, seed) for seed in range(1, runs + 1)]
            found = [each.weber for each in fits]
            held = sum(each.low <= weber <= each.high for each in fits)
            spread = stdev(found) if len(found) > 1 else 0.0
            print(
                f"{weber:.3f}  {fmean(found):.3f}  {fmean(found) - weber:+.3f}  {spread:.3f}"
                f"{'':16}{held} of {len(fits)}",
                flush=True,
            )


def main() -> None:
    """Run the program from the command line."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument(
        "--server", metavar="HOST:PORT", help="default: HBOT_SERVER or 127.0.0.1:4268"
    )
    options.add_argument("--runs", type=int, default=RUNS, help=f"default: {RUNS}")
    options.add_argument(
        "--without-hand", action="store_true", help="feel the stiffness exactly, without a server"
    )
    given = options.parse_args()
    if given.without_hand:
        return recover(exactly, given.runs)
    with (
        hbot.one_line_errors(LogError),
        hbot.connect(given.server, name="recovery", timeout=30.0) as rig,
        rig.lease(),
    ):
        session.check_rig(rig, simulate=True)
        session.start(rig, scene(simulate=True))
        recover(functools.partial(feel, rig), given.runs)
        rig.disable()


if __name__ == "__main__":
    main()
