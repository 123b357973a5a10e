"""Shows that the stiffness experiment recovers the Weber fraction of simulated participants.

Each run is a whole experiment on the server's simulated rig. Use a server in virtual time, which is
much faster: `hbot server --time virtual`.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from statistics import fmean, stdev

import hbot

from . import session
from .discrimination import TRIALS, Trial, answers, experiment, scene, simulated
from .psychometric import Fit, fit
from .trial_log import TrialLog

WEBER = (0.1, 0.2, 0.3)
RUNS = 20


def run(rig: hbot.Rig, folder: Path, weber: float, seed: int) -> Fit:
    """Run one whole experiment with a simulated participant. Returns the fit."""
    settings = {"weber": weber, "seed": seed}
    with TrialLog(folder / f"{weber}-{seed}.csv", Trial, settings) as log:
        experiment(rig, log, TRIALS, seed, simulated(weber, seed), person=False)
        return fit(answers(log.rows))


def main() -> None:
    """Run all experiments and print a table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--server", default="127.0.0.1:4268", metavar="HOST:PORT")
    options.add_argument("--runs", type=int, default=RUNS, help=f"default: {RUNS}")
    given = options.parse_args()
    print(f"{given.runs} runs of {TRIALS} trials for each Weber fraction, seeds from 1")
    print("true   mean   bias   standard deviation   true value in the 95 % interval")
    with (
        tempfile.TemporaryDirectory() as folder,
        hbot.connect(given.server, name="recovery", timeout=30.0) as rig,
        rig.lease(),
    ):
        session.check_rig(rig, simulate=True)
        session.start(rig, scene(simulate=True))
        for weber in WEBER:
            fits = [run(rig, Path(folder), weber, seed) for seed in range(1, given.runs + 1)]
            found = [each.weber for each in fits]
            held = sum(each.low <= weber <= each.high for each in fits)
            spread = stdev(found) if len(found) > 1 else 0.0
            print(
                f"{weber:.3f}  {fmean(found):.3f}  {fmean(found) - weber:+.3f}  {spread:.3f}"
                f"{'':16}{held} of {len(fits)}",
                flush=True,
            )
        rig.disable()


if __name__ == "__main__":
    main()
