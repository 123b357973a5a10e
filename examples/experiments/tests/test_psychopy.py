"""The matching experiment in a window of PsychoPy, with keys from xdotool on a virtual screen.

Left out without PsychoPy; `.ci/python.sh` installs it.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from serving import server

if not os.environ.get("HBOT_PSYCHOPY"):
    pytest.importorskip("psychopy", reason="the extra psychopy is installed in CI")

PRESS_S = 0.7
"""Time between two presses of Return, s. Far less than the 10 s after which a trial ends itself."""


@pytest.fixture(scope="module")
def environment() -> Iterator[dict[str, str]]:
    """Start a virtual screen. Returns the environment of programs that use it."""
    with subprocess.Popen(
        ["Xvfb", "-displayfd", "1", "-screen", "0", "1024x900x24"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as screen:
        try:
            assert screen.stdout is not None
            yield {**os.environ, "DISPLAY": f":{screen.stdout.readline().strip()}"}
        finally:
            screen.terminate()


def test_trials_end_when_return_is_pressed(tmp_path: Path, environment: dict[str, str]) -> None:
    command = [sys.executable, "-m", "hbot_experiments.psychopy_matching", "p1"]
    options = ["--folder", str(tmp_path), "--trials", "3"]
    with (
        server() as address,
        subprocess.Popen(
            [*command, "--server", address, *options],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment,
        ) as program,
    ):
        assert program.stdin is not None
        print(file=program.stdin, flush=True)  # "Hold the sphere and press Enter."
        until = time.monotonic() + 90.0
        while program.poll() is None:
            assert time.monotonic() < until, "the trials do not end"
            subprocess.run(["xdotool", "key", "Return"], env=environment, check=True)
            time.sleep(PRESS_S)  # Its subject is time.
        assert program.stdout is not None
        said = program.stdout.read()
    assert program.returncode == 0, said
    with open(tmp_path / "p1-matching.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3, said
    # A trial that nobody ends takes 10 s. With a wrong clock it would have its first state alone,
    # or all of them. A busy machine delays the key.
    durations = [float(row["duration"]) for row in rows]
    assert 0.0 < max(durations) < 9.0, durations


def test_the_time_of_a_state_is_psychopys_time(environment: dict[str, str]) -> None:
    """As the page says: with the variable that the program sets, on CLOCK_MONOTONIC."""
    code = """
import hbot_experiments.psychopy_matching, hbot, sys, psychopy.clock
with hbot.connect(sys.argv[1]) as rig:
    # A simulated rig waits for a busy machine, which moves its tick 0 to a later time.
    before = hbot_experiments.psychopy_matching.tick_0(rig)
    for state in rig.states(every=10, duration=1.0):
        now = psychopy.clock.getTime()
    after = hbot_experiments.psychopy_matching.tick_0(rig)
    print(now - before - state.t, now - after - state.t)
"""
    with server() as address:
        command = [sys.executable, "-c", code, address]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    # The way of the last state to this program; a busy machine needs longer, but not seconds.
    longest, shortest = map(float, done.stdout.split()[-2:])
    assert longest > 0.0
    assert shortest < 0.5
