"""Do the time stamps of LSL agree with the server's clock? Measured for 60 s at 1 kHz.

    cargo build --bin hbot
    python studies/lsl_time.py

A simulated rig runs at 1 kHz behind a pseudo-terminal: there it keeps to the clock as a real rig
does, and its time never waits. `python -m hbot.lsl` publishes it, and this program receives the
stream, as a recorder in another process does. LSL's own correction (`time_correction`) is added to
each time stamp. The result is compared with the server's clock: `info.clock.monotonic_ns` plus `t`
of the sample. This is done twice: with the offset that `hbot.clock` takes from `info.clock`, and
with the one that it finds by round trips, as it must between two machines.

Prints a table: samples received, ticks lost, the differences, and how long samples were on the way.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import hbot
from hbot.clock import told

REPOSITORY = Path(__file__).parents[3]
TESTS = REPOSITORY / "clients" / "python" / "tests"
RATE_HZ = 1000


@dataclass
class Received:
    """What one run received."""

    ticks: list[float]
    errors: list[float]
    """Corrected time stamp minus the server's clock, s."""
    ways: list[float]
    """Time from a tick to the arrival of its sample here, s."""


def receive(address: str, truth: float, clock: str, seconds: float) -> Received:
    """Publish the server at `address`, and receive for `seconds`. `truth` is its tick 0, s."""
    import pylsl

    command = [sys.executable, "-m", "hbot.lsl", address, "--markers", "127.0.0.1:0"]
    program = subprocess.Popen([*command, "--clock", clock], stderr=subprocess.DEVNULL)
    try:
        query = f"name='Hbot' and source_id='hbot-{address}'"
        inlet = pylsl.StreamInlet(pylsl.resolve_bypred(query, 1, 30.0)[0], recover=False)
        correction = inlet.time_correction(30.0)
        received = Received([], [], [])
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            samples, stamps = inlet.pull_chunk(0.01)
            now = pylsl.local_clock()
            for sample, stamp in zip(samples, stamps, strict=True):
                received.ticks.append(sample[0])
                received.errors.append(stamp + correction - (truth + sample[1]))
                received.ways.append(now - (truth + sample[1]))
            # LSL measures its correction all the time; this returns the newest without waiting.
            correction = inlet.time_correction(1.0)
        inlet.close_stream()
        return received
    finally:
        program.kill()
        program.wait()


def row(clock: str, received: Received) -> str:
    """Return one row of the table."""
    ticks = received.ticks
    lost = int(ticks[-1] - ticks[0]) + 1 - len(ticks)
    errors = sorted(1e3 * abs(error) for error in received.errors)
    ways = sorted(1e3 * way for way in received.ways)

    def part(values: list[float], fraction: float) -> str:
        return f"{values[min(int(fraction * len(values)), len(values) - 1)]:.3f}"

    figures = [part(errors, fraction) for fraction in (0.5, 0.99, 1.0)]
    figures += [part(ways, fraction) for fraction in (0.5, 0.99)]
    return f"| {clock} | {len(ticks)} | {lost} | {' | '.join(figures)} |"


def main() -> None:
    """Measure both ways to the offset."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--server", type=Path, default=REPOSITORY / "target" / "debug" / "hbot")
    parser.add_argument("--seconds", type=float, default=60.0)
    options = parser.parse_args()
    sys.path.insert(0, str(TESTS))
    os.environ["HBOT_PROGRAM"] = str(options.server)
    os.environ["LSLAPICFG"] = str(TESTS / "lsl_api.cfg")
    from serving import Server

    with tempfile.TemporaryDirectory() as folder:
        server = Server(Path(folder), rate_hz=RATE_HZ, options=["--port", "sim:pty"])
        try:
            with hbot.connect(server.address) as rig:
                tick_0 = told(rig)
                assert tick_0 is not None
                truth = tick_0.seconds
            runs = {
                clock: receive(server.address, truth, clock, options.seconds)
                for clock in ("auto", "ping")
            }
            with hbot.connect(server.address) as rig:
                assert told(rig) == tick_0, "the clock has moved"
                stats = rig.stats()
        finally:
            server.kill()
    print("\n| `--clock` | samples | lost | error: median, ms | 99 % | largest | ", end="")
    print("on the way: median, ms | 99 % |\n|---|---|---|---|---|---|---|---|")
    for clock, received in runs.items():
        print(row(clock, received))
    print(f"\nserver: {stats.skipped_ticks} ticks skipped, {stats.dropped_states} states dropped")
    print(f"load: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")


if __name__ == "__main__":
    main()
