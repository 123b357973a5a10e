"""The program and its parts, on two real servers with simulated rigs."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

import hbot
from couple import Coupling, CouplingError, End, connected, main, parse, run
from hbot.turns import Quaternion, conjugate, times
from serving import PATIENCE_S, RATE_HZ, Server, eventually

PROGRAM = Path(__file__).parents[2] / "couple.py"
FREE: dict[str, Any] = {"simulate": {}}
DAMPING = 0.02  # N m s/rad
FIRM = 0.3  # N m/rad; a quarter of the border at 250 Hz without added delay
WILD = 2.0  # N m/rad; five times the border with `LATE`
LATE = 0.04  # s
ALLOWANCE = 0.001  # J; the default of `passivity`


@contextmanager
def servers(folder: Path, edits: dict[str, str] | None = None) -> Iterator[list[Server]]:
    with ExitStack() as stack:
        started = []
        for name in ("a", "b"):
            (folder / name).mkdir()
            started.append(Server(folder / name, edits=edits))
            stack.callback(started[-1].kill)
        yield started


@contextmanager
def both(folder: Path, edits: dict[str, str] | None = None) -> Iterator[tuple[End, End]]:
    """Connect to two servers of the test, whose spheres no hand holds."""
    with (
        servers(folder, edits) as (first, second),
        connected(first.address, None) as a,
        connected(second.address, None) as b,
    ):
        for end in (a, b):
            end.log = []
        yield a, b


def angle(q: Quaternion) -> float:
    """Return the angle of a rotation, rad."""
    return 2.0 * math.atan2(math.hypot(*q[1:]), abs(q[0]))


def turn(end: End) -> Quaternion:
    """Return what a sphere has turned since the start."""
    assert end.log
    return times(end.log[-1].q, conjugate(end.origin))


def until(coupling: Coupling, condition: Callable[[], object], what: str) -> None:
    """Wait. Fails if the coupling ends before."""

    def so() -> object:
        coupling.wait(0.0)
        return condition()

    eventually(so, what)


def tap(a: End, b: End) -> None:
    a.rig.torque([0.0, 0.0, 0.05], 20)
    b.rig.torque([0.0, 0.0, -0.05], 20)


def speed(end: End, seconds: float) -> float:
    """Return the largest speed of a sphere in the last states, rad/s."""
    return max(math.hypot(*state.omega) for state in (end.log or [])[-round(seconds * RATE_HZ) :])


def given(end: End) -> float:
    """Return the most energy that a rig has given out since the start, J."""
    log = end.log or []
    return max(state.energy for state in log) - log[0].energy


def test_a_free_sphere_follows_the_sphere_in_a_hand(tmp_path: Path) -> None:
    with both(tmp_path) as (a, b):
        a.start(FIRM, DAMPING, {"simulate": {"hand": {"rate": 0.25}}})
        b.start(FIRM, DAMPING, FREE)
        with Coupling(a, b, 0.0) as coupling:
            until(coupling, lambda: b.log and angle(turn(b)) > 0.2, "the other sphere turns")
            apart = angle(times(turn(a), conjugate(turn(b))))
            # The hand turns at 0.5 rad/s: damping 0.02 N m s/rad then stretches the spring of
            # 0.3 N m/rad by 0.03 rad. A swing of the start adds as much; apart they are 0.2 rad.
            assert apart < 0.1


def test_far_inside_the_border_a_tap_comes_to_rest(tmp_path: Path) -> None:
    with both(tmp_path) as (a, b):
        for end in (a, b):
            end.start(FIRM, DAMPING, FREE)
        with Coupling(a, b, 0.0) as coupling:
            until(coupling, lambda: a.log and a.log[-1].mode == "active", "the soft start ends")
            tap(a, b)
            until(coupling, lambda: speed(a, 0.1) > 0.1, "the tap turns the sphere")
            # A tenth of the tap, and far above the rounding to encoder counts.
            until(coupling, lambda: max(speed(a, 0.5), speed(b, 0.5)) < 0.01, "it comes to rest")
            assert turn(b)[3] * turn(a)[3] >= -1e-3, "they rest together"


def energy_outside(folder: Path, edits: dict[str, str]) -> float:
    """Return the energy that a rig gives out within 3 s of a tap, far beyond the border, J."""
    folder.mkdir()
    with both(folder, edits) as (a, b):
        for end in (a, b):
            end.start(WILD, DAMPING, FREE)
        with Coupling(a, b, LATE) as coupling:
            until(coupling, lambda: a.log and a.log[-1].mode == "active", "the soft start ends")
            tap(a, b)
            last = len(a.log or ()) + 3 * RATE_HZ
            until(coupling, lambda: len(a.log or ()) > last, "3 s pass")
        return max(given(a), given(b))


def test_far_outside_it_swings_and_the_energy_bound_holds_it(tmp_path: Path) -> None:
    # Unstable: many times what the tap puts in, 0.1 mJ.
    assert (
        energy_outside(tmp_path / "off", {"passivity = true": "passivity = false"}) > 10 * ALLOWANCE
    )
    bound = energy_outside(tmp_path / "on", {"passivity = true": "passivity = { strict = true }"})
    # The controller predicts the energy of a tick from the rate of the one before, so it can err
    # by some of the energy of a tick.
    assert bound < 1.5 * ALLOWANCE


def test_an_orientation_is_held_back_for_the_delay(tmp_path: Path) -> None:
    late = round(LATE * RATE_HZ)
    with both(tmp_path) as (a, b):
        held: list[int] = []
        for end in (a, b):
            end.start(FIRM, DAMPING, FREE)
        send = b.rig.reference

        def note(*arguments: Any, seq: int, **rest: Any) -> None:
            assert a.log
            held.append(sum(state.tick > seq for state in a.log))
            send(*arguments, seq=seq, **rest)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(b.rig, "reference", note)
            with Coupling(a, b, LATE) as coupling:
                until(coupling, lambda: len(held) > 2 * late, "orientations are sent")
        assert set(held) == {late}, "each is sent so many states of its rig after its own"


def command(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, str(PROGRAM), *arguments, "--stiffness", "0.3"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def reported(program: subprocess.Popen[str], count: int) -> list[str]:
    """Wait for lines with a measured delay."""
    assert program.stdout is not None
    lines = []
    for line in program.stdout:
        if "delay" in line and "?" not in line:
            lines.append(line)
            if len(lines) == count:
                return lines
    raise AssertionError(f"the program has ended: {program.communicate()[1]}")


def is_off(server: Server) -> bool:
    with hbot.connect(server.address, name="look") as rig:
        state = next(rig.states())
        return rig.info.lease.holder is None and state.mode == "idle" and not any(state.torque)


def test_ctrl_c_switches_both_torques_off(tmp_path: Path) -> None:
    with servers(tmp_path) as (first, second):
        with command(first.address, second.address, "--delay-ms", "80") as program:
            lines = reported(program, 4)
            assert not is_off(first)
            program.send_signal(signal.SIGINT)
            output, errors = program.communicate(timeout=PATIENCE_S)
        assert program.returncode == 0, errors
        assert "Stopped" in output
        # A stall moves the clock of a simulated rig: the delay one way then seems longer, and the
        # other way as much shorter, until the clocks are asked for anew. The mean stays right,
        # and is far above the 10 ms of a coupling without `--delay-ms`, however long the way takes.
        delays = [float(line.split("delay ")[1].split(" ms")[0]) for line in lines]
        assert sum(delays) / len(delays) > 60.0
        eventually(lambda: is_off(first) and is_off(second), "both are off")


def test_a_rig_that_does_not_confirm_its_stop_is_named(tmp_path: Path) -> None:
    with servers(tmp_path) as (first, second):
        with command(first.address, second.address) as program:
            reported(program, 2)
            second.signal(signal.SIGSTOP)
            program.send_signal(signal.SIGINT)
            output, errors = program.communicate(timeout=PATIENCE_S)
        assert program.returncode == 1
        assert "Stopped" not in output
        said = errors.splitlines()
        assert said[0].startswith(f"{second.address}: not confirmed, cut its power: ")
        assert said[1:] == ["The torque of each rig that still answers is off."]
        eventually(lambda: is_off(first), "the other is off")


def test_the_second_rig_does_not_start_and_the_first_is_switched_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with servers(tmp_path) as (first, second):
        answers = iter(["idle", "fault"])
        monkeypatch.setattr(hbot.Rig, "reset", lambda _rig: next(answers))
        ends: list[End] = []
        with pytest.raises(CouplingError, match="in a fault"):
            run(parse([first.address, second.address]), ends)
        assert [end.off for end in ends] == [True, True]
        eventually(lambda: is_off(first), "the first is off")


def test_the_death_of_one_server_releases_the_other(tmp_path: Path) -> None:
    with servers(tmp_path) as (first, second):
        with command(first.address, second.address) as program:
            reported(program, 2)
            first.kill()
            _, errors = program.communicate(timeout=PATIENCE_S)
        assert program.returncode == 1
        said = errors.splitlines()
        assert said[0].startswith(f"{first.address}: not confirmed, cut its power: ")
        assert said[1].startswith("error: ")
        assert said[2:] == ["The torque of each rig that still answers is off."]
        eventually(lambda: is_off(second), "the other is off")


def test_a_missing_server_is_named_without_a_traceback() -> None:
    with command("127.0.0.1:1", "127.0.0.1:1") as program:
        _, errors = program.communicate(timeout=PATIENCE_S)
    assert program.returncode == 1
    assert errors.startswith("error: no connection to 127.0.0.1:1: ")
    assert len(errors.splitlines()) == 2


def test_a_lease_that_is_stolen_ends_the_coupling(tmp_path: Path) -> None:
    with servers(tmp_path) as (first, second):
        with command(first.address, second.address) as program:
            reported(program, 2)
            with hbot.connect(second.address, name="thief") as thief:
                thief.acquire(steal=True)
                _, errors = program.communicate(timeout=PATIENCE_S)
        assert program.returncode == 1
        assert "thief has the lease" in errors
        eventually(lambda: is_off(first), "the other is off")


def test_a_fault_of_one_rig_ends_the_coupling(tmp_path: Path) -> None:
    with both(tmp_path) as (a, b):
        for end in (a, b):
            end.start(FIRM, DAMPING, FREE)
        with Coupling(a, b, 0.0) as coupling:
            until(coupling, lambda: b.log, "it runs")
            with hbot.connect(a.address, name="other") as other:
                other.estop()
            with pytest.raises(CouplingError, match="estop"):
                coupling.wait(PATIENCE_S)
        eventually(lambda: next(b.rig.states()).mode == "idle", "the other rig is disabled")


@pytest.mark.parametrize("arguments", [["127.0.0.1:1"], ["a:1", "b:1", "--delay-ms", "-1"]])
def test_a_wrong_command_line_is_refused(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["couple.py", *arguments])
    with pytest.raises(SystemExit, match="2"):
        main()
