"""What the experiments have in common: command line, connection, and the end of a session."""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hbot
from hbot.clock import refuse_virtual_time

from .trial_log import LogError

PATIENCE = 30.0
"""Longest time to wait until the sphere is near its centre, s."""


def parser(description: str, trials: int) -> argparse.ArgumentParser:
    """Return a parser with the options that every experiment has.

    Args:
        description: one sentence for the help text.
        trials: default number of trials.
    """
    options = argparse.ArgumentParser(description=description)
    options.add_argument("participant", help="code of the participant; the log is named after it")
    options.add_argument(
        "--server", metavar="HOST:PORT", help="default: HBOT_SERVER or 127.0.0.1:4268"
    )
    options.add_argument(
        "--token-file",
        type=Path,
        help="file with the server's token, if it has one; default: HBOT_TOKEN_FILE",
    )
    options.add_argument("--folder", type=Path, default=Path("data"), help="where logs are written")
    options.add_argument("--trials", type=int, default=trials, help=f"default: {trials}")
    options.add_argument(
        "--seed", type=int, default=1, help="chooses targets and orders; default: 1"
    )
    options.add_argument(
        "--simulate",
        action="store_true",
        help="a simulated participant takes part; the server must have a simulated rig",
    )
    return options


def run(
    options: argparse.Namespace, experiment: Callable[[hbot.Rig], None], real_time: str | None
) -> None:
    """Connect, take the lease, run an experiment, and switch the torque off.

    `real_time` names an experiment that needs a server in real time, because this program streams
    torques or a person takes part. None: any server will do.

    Ends the program: with exit code 0 if the experiment is complete, 130 after Ctrl-C, else 1.
    A session that has ended early continues when the same command is given again.
    """
    token = options.token_file
    try:
        with (
            hbot.one_line_errors(LogError),
            hbot.connect(options.server, name="experiment", token=token) as rig,
            rig.lease(),
        ):
            check_rig(rig, options.simulate)
            if real_time is not None:
                refuse_virtual_time(rig, real_time)
            try:
                experiment(rig)
            except BaseException as error:
                # The first error says more than one of a lost connection.
                with contextlib.suppress(hbot.HbotError):
                    rig.disable()
                if isinstance(error, EOFError):
                    raise LogError("the input has ended") from error
                raise
            rig.disable()
    except KeyboardInterrupt:
        print("\nStopped. The same command continues after the last complete trial.")
        sys.exit(130)
    except SystemExit:
        print("The same command continues after the last complete trial.", file=sys.stderr)
        raise


def check_rig(rig: hbot.Rig, simulate: bool) -> None:
    """Refuse a simulated participant on a real rig.

    Raises:
        LogError: the rig is real and the participant is not.
    """
    if simulate and not rig.info.rig.simulated:
        raise LogError("--simulate needs a server with a simulated rig: `hbot server --port sim`")


def start(rig: hbot.Rig, scene: dict[str, Any]) -> None:
    """Load a scene, enable the rig and wait for full torque. A fault that is there is reset once.

    The sphere must be near its centre. A simulated hand may be far from it, so this waits until the
    hand swings back.

    Raises:
        hbot.OutOfRange: the sphere stays too far from its centre.
        hbot.Faulted, LogError: the rig goes into a fault.
    """
    rig.load_scene(scene)
    if rig.reset() == "fault":
        raise LogError("the rig is in a fault; mend that and start again")
    give_up = time.monotonic() + PATIENCE
    while True:
        try:
            rig.enable()
            break
        except hbot.OutOfRange:
            if time.monotonic() > give_up:
                raise
            time.sleep(0.05)
    for state in rig.states(every=10):
        if state.mode == "active":
            return
        if state.mode != "enabling":
            raise LogError(f"the rig is {state.fault or state.mode}; mend that and start again")


def unix_time(rig: hbot.Rig, t: float) -> float:
    """Return the Unix time of the rig's time `t`, s. NaN if the server does not send its clock."""
    clock = rig.info.clock
    return float("nan") if clock is None else clock.unix_ns * 1e-9 + t
