"""How old is a torque that a client computes? Measured on a simulated rig at 1 kHz.

    cargo build --example stream_torque --bin hbot
    python studies/render_age.py

Clients render a damper or a spring in turn, several rounds each: the blocking and the asyncio
client of this package, and the Rust client. A second connection watches: it takes every state and
notes `client.age_ticks`, the age of the torque that is in force in that tick. Beside them a bare
echo is measured: the round trip of a `ping` over a socket, without this package.

Prints a table for each encoding. CPU time is that of the process that renders, while it renders.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import hbot
from hbot.wire import Encoding, Splitter, encoder

REPOSITORY = Path(__file__).parents[3]
DAMPING = 0.01  # N m s/rad
RATE_HZ = 1000
VALID_MS = 20


def damper(state: hbot.State) -> list[float]:
    """Return the torque of a damper, N m."""
    return [-DAMPING * rate for rate in state.omega]


def render(address: str, encoding: Encoding, seconds: float) -> None:
    """Render with the blocking client. Prints what it did and the CPU time, s."""
    with hbot.connect(address, name="render", encoding=encoding) as rig, rig.lease():
        rig.enable()
        before = time.process_time()
        done = rig.render(damper, valid_ms=VALID_MS, duration=seconds)
        print(json.dumps([done.calls, done.skipped, done.unsent, time.process_time() - before]))


def render_aio(address: str, encoding: Encoding, seconds: float) -> None:
    """Render with the client for asyncio, as `render` does."""

    async def main() -> None:
        connecting = hbot.aio.connect(address, name="render", encoding=encoding)
        async with connecting as rig, rig.lease():
            await rig.enable()
            before = time.process_time()
            done = await rig.render(damper, valid_ms=VALID_MS, duration=seconds)
            print(json.dumps([done.calls, done.skipped, done.unsent, time.process_time() - before]))

    asyncio.run(main())


RENDERERS: dict[str, Callable[[str, Encoding, float], None]] = {
    "hbot": render,
    "hbot.aio": render_aio,
}


def percentile(values: Iterable[float], fraction: float) -> float:
    """Return the value below which `fraction` of the values are."""
    ordered = sorted(values)
    return ordered[min(int(fraction * len(ordered)), len(ordered) - 1)]


class Disturbed(Exception):
    """The machine stopped a program for so long that the round cannot count."""


def quiet_watch(address: str, command: list[str], seconds: float) -> tuple[list[int], float, str]:
    """Watch as `watch` does, and again if the machine disturbed it. Says so."""
    while True:
        try:
            with hbot.connect(address, name="reset") as rig, rig.lease(steal=True):
                rig.reset()
                rig.disable()
            cpu_of_children()
            return watch(address, command, seconds)
        except (Disturbed, hbot.HbotError) as error:
            print(f"again: {error}", file=sys.stderr)
            time.sleep(1.0)  # A fault cannot be reset while its cause is there.


def watch(address: str, command: list[str], seconds: float) -> tuple[list[int], float, str]:
    """Run a program that renders, and watch the age of its torque.

    Returns:
        The ages in ticks while it rendered, the CPU time of the whole program, s, and its output.
    """
    with hbot.connect(address, name="watch", encoding="msgpack") as rig:
        program = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        ages: list[int] = []
        first: int | None = None
        for state in rig.states():
            stream = state.client
            if first is None and stream is not None and stream.seq is not None:
                # The age of an earlier program's last torque is far beyond this.
                first = state.tick if stream.age_ticks < 2 * VALID_MS else None
            if state.mode == "fault":
                program.kill()
                program.communicate()
                raise Disturbed(f"the rig went into the fault {state.fault}")
            if first is not None and stream is not None and state.tick > first + RATE_HZ // 2:
                ages.append(stream.age_ticks)  # Not in the first half second: it starts up.
                if state.tick >= first + (seconds - 0.5) * RATE_HZ:
                    break
        lost = rig.lost.states
    output = program.communicate()[0]
    if program.returncode != 0 or lost > 0:
        raise Disturbed(f"{lost} states lost, the program ended with {program.returncode}")
    return ages, cpu_of_children(), output


_children = 0.0


def cpu_of_children() -> float:
    """Return the CPU time of the children that have ended since the last call, s."""
    global _children
    times = os.times()
    total = times.children_user + times.children_system
    used, _children = total - _children, total
    return used


def echo(address: str, encoding: Encoding, count: int) -> list[float]:
    """Return the round trips of `count` pings over a bare socket, us."""
    host, _, port = address.rpartition(":")
    with socket.create_connection((host, int(port)), timeout=5.0) as line:
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        hello = {"id": 0, "op": "hello", "version": 1, "name": "echo", "encoding": encoding}
        line.sendall(encoder("json")(hello))
        answers = Splitter("json")
        while not answers.push(line.recv(4096)):
            pass
        ping, answers, trips = encoder(encoding)({"id": 1, "op": "ping"}), Splitter(encoding), []
        for _ in range(count):
            before = time.perf_counter()
            line.sendall(ping)
            while not answers.push(line.recv(4096)):
                pass
            trips.append((time.perf_counter() - before) * 1e6)
            time.sleep(0.001)  # The rate of a stream at 1 kHz.
    return trips


def study(address: str, example: Path, seconds: float, rounds: int) -> None:
    """Measure everything and print the tables."""
    encodings: tuple[Encoding, ...] = ("json", "msgpack")
    for encoding in encodings:
        ages: dict[str, list[int]] = {}
        cpu: dict[str, list[float]] = {}
        trips: list[float] = []
        for _ in range(rounds):
            own = [str(Path(__file__).resolve()), "--render"]
            commands = {
                name: [sys.executable, *own, name, encoding, address, str(seconds)]
                for name in RENDERERS
            }
            commands["Rust"] = [str(example), address, str(seconds), encoding]
            for name, command in commands.items():
                seen, used, output = quiet_watch(address, command, seconds)
                if name in RENDERERS:
                    used = json.loads(output)[3]
                ages.setdefault(name, []).extend(seen)
                cpu.setdefault(name, []).append(100.0 * used / seconds)
            trips += echo(address, encoding, int(seconds * 100))
        print(f"\n{encoding}: {rounds} rounds of {seconds:.0f} s\n")
        print("| client | median | 99 % | 99.9 % | oldest | at most 2 ticks | CPU |")
        print("|---|---|---|---|---|---|---|")
        for name, seen in ages.items():
            ticks = " | ".join(f"{percentile(seen, part):.0f}" for part in (0.5, 0.99, 0.999, 1.0))
            young = 100.0 * sum(age <= 2 for age in seen) / len(seen)
            print(f"| {name} | {ticks} | {young:.2f} % | {percentile(cpu[name], 0.5):.0f} % |")
        times = ", ".join(f"{percentile(trips, part):.0f} us" for part in (0.5, 0.99, 0.999))
        print(f"\nbare echo (ping): median, 99 %, 99.9 %: {times}")


def main() -> None:
    """Start a server and measure, or render if the study asks for it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    target = REPOSITORY / "target" / "debug"
    parser.add_argument("--server", type=Path, default=target / "hbot")
    parser.add_argument("--example", type=Path, default=target / "examples" / "stream_torque")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--render", nargs=4, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.render:
        name, encoding, address, seconds = options.render
        RENDERERS[name](address, encoding, float(seconds))
        return
    sys.path.insert(0, str(REPOSITORY / "clients" / "python" / "tests"))
    os.environ["HBOT_PROGRAM"] = str(options.server)
    from serving import Server

    print(f"load before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    with tempfile.TemporaryDirectory() as folder:
        server = Server(Path(folder), rate_hz=RATE_HZ)
        try:
            study(server.address, options.example, options.seconds, options.rounds)
            with hbot.connect(server.address) as rig:
                stats = rig.stats()
        finally:
            server.kill()
    print(
        f"\nserver: {stats.late_ticks} late, {stats.skipped_ticks} skipped of {stats.ticks} ticks"
    )
    print(f"load after: {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
