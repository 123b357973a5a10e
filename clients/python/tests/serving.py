"""The real server with a simulated rig, and ways to wait. Does not need pytest."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import hbot

REPOSITORY = Path(__file__).resolve().parents[3]
SCENES = REPOSITORY / "scenes"
PATIENCE_S = 20.0
"""Longest time that a test waits for anything. A busy machine can stop a program for seconds."""
RATE_HZ = 250
"""Ticks per second of the servers in tests. A low rate leaves the processors to the tests."""
RAMP_TICKS = 20 * RATE_HZ // 1000 + 1
"""Ticks until a torque that has expired is zero: the ramp of 20 ms, and the tick that sees it."""


def eventually(condition: Callable[[], object], what: str) -> None:
    """Wait until `condition` returns something true. Fails if it does not within `PATIENCE_S`."""
    until = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < until, f"never: {what}"
        time.sleep(0.01)


def running(states: Iterable[hbot.State]) -> Iterator[hbot.State]:
    """Return the states as they come. Fails at a fault, after which a test would wait in vain."""
    for state in states:
        assert state.mode != "fault", f"the rig is in the fault {state.fault}"
        yield state


def program() -> Path:
    """Return the server's program: `HBOT_PROGRAM`, or what cargo has built."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", REPOSITORY / "target"))
    path = Path(os.environ.get("HBOT_PROGRAM", target / "debug" / "hbot"))
    assert path.exists(), f"{path} is missing: cargo build, or name the program in HBOT_PROGRAM"
    return path


def rig_file(folder: Path, api: str = "", edits: Mapping[str, str] | None = None) -> Path:
    """Write a rig file: the prototype with long time-outs, so that a busy machine is no fault.

    Args:
        folder: where to write it.
        api: lines for the table `[api]`.
        edits: pieces of the prototype's text, each present once, and what replaces them.
    """
    text = (REPOSITORY / "rigs" / "prototype.toml").read_text(encoding="utf-8")
    text, changes = re.subn(
        r"timeout_ticks = 20\b", "timeout_ticks = 1000\nwatchdog_ms = 1000", text
    )
    assert changes == 1, "the prototype's time-out is written otherwise"
    if api:
        text, changes = re.subn(r"(?m)^\[api\]\n(.+\n)*", f"[api]\n{api}\n", text)
        assert changes == 1, "the prototype's table [api] is written otherwise"
    for old, new in (edits or {}).items():
        assert text.count(old) == 1, f"the prototype does not have one {old!r}"
        text = text.replace(old, new)
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return path


class Server:
    """A server with a simulated rig, in a separate process."""

    def __init__(
        self,
        folder: Path,
        api: str = "",
        rate_hz: int = RATE_HZ,
        port: int = 0,
        options: Sequence[str] = (),
        edits: Mapping[str, str] | None = None,
    ) -> None:
        """Start the server and wait until it listens.

        Args:
            folder: its rig file, log and files are here.
            api: lines for the table `[api]` of the rig file.
            rate_hz: ticks per second.
            port: TCP port. 0 stands for any that is free.
            options: more options of the command line.
            edits: changes of the rig file, as `rig_file` takes them.
        """
        self._log = folder / "server.log"
        command = [str(program()), "server", "--rig", str(rig_file(folder, api, edits)), *options]
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                [*command, "--rate", str(rate_hz), "--listen", f"127.0.0.1:{port}"],
                cwd=folder,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, "XDG_STATE_HOME": str(folder)},
            )
        ended = self.process.poll
        eventually(lambda: self._port() or ended() is not None, "the server listens")
        assert self.process.poll() is None, self._log.read_text()
        self.address = f"127.0.0.1:{self._port()}"

    def _port(self) -> str | None:
        found = re.search(r"listen.*?127\.0\.0\.1:(\d+)", self._log.read_text(errors="replace"))
        return found and found.group(1)

    def log(self) -> str:
        """Return what the server has printed."""
        return self._log.read_text(errors="replace")

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to the server."""
        self.process.send_signal(number)

    def kill(self) -> None:
        """Kill the server and wait for its end."""
        self.process.kill()
        self.process.wait(PATIENCE_S)

    def settle(self) -> None:
        """Bring the rig to the start of every test: idle, at the reference of a spring, free."""
        with hbot.connect(self.address, name="settle") as rig:
            rig.acquire(steal=True)
            rig.reset()
            rig.disable()
            rig.load_scene(SCENES / "spring.toml")
            for state in running(rig.states()):
                if state.mode == "idle" and not any(state.torque):
                    break
            rig.align((1.0, 0.0, 0.0, 0.0), 1.0)
            rig.release()
