"""The example that finds the stiffness of the contacts in a flight log with a tap."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from serving import PATIENCE_S, REPOSITORY, Server, eventually, program

import hbot

pytest.importorskip("tomllib", reason="the example needs Python 3.11")

EXAMPLE = REPOSITORY / "examples" / "ringing.py"
STIFFNESS = 2e4
"""Stiffness of each contact of the simulated rig, N/m."""
PARTS = f"""simulate.compliance.contact_stiffness = {STIFFNESS}
simulate.compliance.contact_damping = 2
simulate.compliance.cage_stiffness = 1e9
"""
SCENE = """name = "Tap"
effect = [{ id = "tap", kind = "pulse", axis = [1, 0.5, 0.7], duration_s = 0.004 }]
simulate.hand.amplitude = 0
"""
"""Nothing but a click that taps. The hand holds still, so that every run has the same posture."""


def run(log: Path, rig: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, EXAMPLE, log, rig], capture_output=True, text=True, timeout=PATIENCE_S
    )


@pytest.fixture
def stopped(tmp_path: Path) -> Callable[[str, bool], Path]:
    """Return a function that returns the flight log of a server, with a tap or without."""

    def log(simulated: str, tap: bool) -> Path:
        (tmp_path / "tap.toml").write_text(SCENE + simulated)
        options = ["--time", "virtual", "--scene", "tap.toml"]
        server = Server(tmp_path, rate_hz=1000, options=options)
        try:
            with hbot.connect(server.address) as rig, rig.lease():
                rig.hand(None)
                rig.advance(1500)
                if tap:
                    rig.set("tap", fire=1)
                rig.advance(500)
                rig.estop()
                rig.advance(500)
            eventually(lambda: list(tmp_path.rglob("*.csv")), "the flight log is written")
        finally:
            server.kill()
        (path,) = tmp_path.rglob("*.csv")
        return path

    return log


def test_a_tap_tells_the_stiffness_of_the_contacts(
    tmp_path: Path, stopped: Callable[[str, bool], Path]
) -> None:
    log = stopped(PARTS, True)
    done = run(log, tmp_path / "rig.toml")
    assert done.returncode == 0, done.stderr
    found = re.match(r"ringing at (\d+) Hz, contacts of (\S+) N/m\n", done.stdout)
    assert found, done.stdout
    # The resolution of the window, 1/0.15 s, is 9 % of the frequency; its peak is found to a tenth.
    assert float(found[2]) == pytest.approx(STIFFNESS, rel=0.02)
    # `rig new` writes angles with their unit. Its other values are the prototype's.
    new = tmp_path / "new.toml"
    subprocess.run([program(), "rig", "new", new], stdin=subprocess.DEVNULL, check=True)
    assert '"10 deg"' in new.read_text()
    assert run(log, new).stdout == done.stdout


@pytest.mark.parametrize(("simulated", "tap"), [(PARTS, False), ("", False), ("", True)])
def test_a_log_in_which_nothing_rings_gives_no_figure(
    tmp_path: Path,
    stopped: Callable[[str, bool], Path],
    simulated: str,
    tap: bool,
) -> None:
    done = run(stopped(simulated, tap), tmp_path / "rig.toml")
    assert (done.returncode, done.stdout) == (1, "")
    assert re.fullmatch(r"no tap found in .*\.csv: tap the sphere harder, .*\n", done.stderr)


def test_a_file_that_is_missing_or_wrong_is_named(tmp_path: Path) -> None:
    rig = REPOSITORY / "rigs" / "prototype.toml"
    other = tmp_path / "other.csv"
    other.write_text("a,b\n1,2\n1,2\n1,2\n")
    bare = tmp_path / "bare.toml"
    bare.write_text(re.sub(r"(?m)^inertia = .*\n", "", rig.read_text("utf-8")))
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(rig.read_text("utf-8").replace("cone = 0.1745", 'cone = "10 degrees"'))
    for log, file, said in [
        (tmp_path / "missing.csv", rig, "missing.csv: No such file"),
        (other, tmp_path / "missing.toml", "missing.toml: No such file"),
        (other, rig, "other.csv has no 'joint1_rate_rad_s'"),
        (other, other, "other.csv: "),
        (rig, other, "other.csv: "),
        (other, bare, "bare.toml: `steer` of wheel 1 needs an `inertia`"),
        (other, wrong, "'10 degrees' is no angle"),
    ]:
        done = run(log, file)
        assert done.returncode == 1
        (line,) = done.stderr.splitlines()
        assert line.startswith("error: ")
        assert said in line
