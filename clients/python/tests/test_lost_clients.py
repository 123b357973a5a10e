"""The torque of a client that ends, hangs or raises goes to zero by `valid_ms`."""

from __future__ import annotations

import itertools
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from serving import PATIENCE_S, RAMP_TICKS, RATE_HZ, Server, running

import hbot

VALID_MS = 200
VALID_TICKS = VALID_MS * RATE_HZ // 1000

CLIENT = f"""
import signal
import sys
import hbot


def push(state):
    if len(sys.argv) > 2 and state.mode == "active" and any(state.torque):
        raise RuntimeError("the function of the program fails")
    return [0.05, 0.0, 0.0]

with hbot.connect(sys.argv[1], name="pusher") as rig, rig.lease():
    rig.load_scene({{"name": "Nothing", "effect": []}})
    rig.enable()
    try:
        rig.render(push, valid_ms={VALID_MS})
    except RuntimeError:
        print("raised", flush=True)
        sys.stdin.read()  # The connection and the lease stay.
"""


def ticks_until_zero(rig: hbot.Rig, lose: Callable[[], object]) -> int:
    """Let `lose` take the pusher away while it pushes.

    Returns:
        The number of ticks from the arrival of its last torque to the first tick without torque.
    """
    accepted: int | None = None
    lost = False
    last_seq: int | None = None
    for state in running(rig.states()):
        # After the pusher is gone the lease is free, and no state names a stream.
        if not lost and (state.client is None or state.client.seq is None):
            continue
        if state.client and state.client.seq not in (None, last_seq):
            last_seq, accepted = state.client.seq, state.tick
        if state.mode == "active" and any(state.torque) and not lost:
            lose()
            lost = True
        if lost and not any(state.torque):
            assert accepted is not None
            return state.tick - accepted
    raise AssertionError("the states ended")


@pytest.fixture
def script(tmp_path: Path) -> Path:
    """Write the program that pushes."""
    path = tmp_path / "pusher.py"
    path.write_text(CLIENT, encoding="utf-8")
    return path


# `valid_ms` is counted from the arrival; a message arrives at most one tick before it is accepted.
LONGEST = VALID_TICKS + RAMP_TICKS + 1


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP, signal.SIGINT])
def test_a_program_that_is_stopped_loses_its_torque(
    server: Server, script: Path, number: signal.Signals
) -> None:
    """SIGKILL ends the connection. SIGSTOP leaves it open, and the program reads nothing."""
    pusher = subprocess.Popen([sys.executable, script, server.address], stderr=subprocess.DEVNULL)
    try:
        with hbot.connect(server.address, name="watcher") as rig:
            assert ticks_until_zero(rig, lambda: pusher.send_signal(number)) <= LONGEST
            if number == signal.SIGSTOP:
                assert rig.refresh().lease.holder == "pusher", "it is still connected"
    finally:
        pusher.kill()
        pusher.wait(PATIENCE_S)


def test_a_function_that_raises_loses_its_torque(server: Server, script: Path) -> None:
    pusher = subprocess.Popen(
        [sys.executable, script, server.address, "raise"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    try:
        with hbot.connect(server.address, name="watcher") as rig:
            assert ticks_until_zero(rig, lambda: None) <= LONGEST
            assert pusher.stdout is not None
            assert pusher.stdout.readline() == b"raised\n"
            assert rig.refresh().lease.holder == "pusher", "it is still connected"
            quiet = list(itertools.islice(rig.states(), 20))
            assert not any(any(state.torque) for state in quiet)
    finally:
        pusher.kill()
        pusher.communicate()
