"""Couple the orientations of two rigs, so that a hand on one feels the hand on the other.

    python examples/couple.py HOST:PORT HOST:PORT --stiffness 0.5 --damping 0.02 --delay-ms 0

Each rig gets a spring. The turn that each sphere has made since the start is sent, in every tick,
to the other server, as the reference of its spring. So each hand feels a spring of `--stiffness` to
the other sphere. Nothing pulls at the start, wherever the spheres are.
`--delay-ms` holds the orientations back, to try what a long way between the rigs would do.

Ctrl-C ends the coupling: both motors ramp to zero and both leases are given back. The same happens
if a server ends, a rig goes into a fault, or another client takes a lease. A rig that does not
confirm that its torque is off is named.

docs/coupling.md derives which stiffness is stable for which delay. `--study FOLDER` measures it on
two simulated rigs, which it starts itself.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import FrameType
from typing import Any

import hbot
from hbot.turns import Quaternion, conjugate, times

EFFECT = "other"
"""Id of the spring to the other sphere, in both scenes."""
MAX_DELAY = 1.0
"""Longest delay, s. Far beyond it, no stiffness that a hand can feel is stable."""


class CouplingError(Exception):
    """The coupling cannot go on. The message says why."""


def scene(stiffness: float, damping: float) -> dict[str, Any]:
    """Return the scene of both rigs: a spring to the other sphere, at rest when it is enabled.

    Args:
        stiffness: N m/rad.
        damping: of the sphere's own rotation, N m s/rad. The reference comes without a rate, so
            the damper of the spring acts on the sphere's rotation in frame N.
    """
    spring = {"id": EFFECT, "kind": "spring", "law": "geodesic", "anchor": "here"}
    return {
        "name": "The other sphere",
        "effect": [{**spring, "stiffness": stiffness, "damping": damping}],
    }


@dataclass
class Watch:
    """What was seen of one rig since `clear`, for reports."""

    states: int = 0
    torque: float = 0.0
    """Largest torque on the sphere, N m."""
    delays: list[float] = field(default_factory=list)
    """From a tick of the other rig to a tick of this rig in which its orientation acts, s."""
    energy: float = 0.0
    """Energy given to the hand since the server's start, J."""
    refused: int = 0
    """Orientations that the server refused, because several came in one tick after a stall."""

    def clear(self) -> Watch:
        """Return what was seen, and begin anew."""
        seen = replace(self)
        self.states, self.torque, self.delays, self.refused = 0, 0.0, [], 0
        return seen


class End:
    """One rig of a coupling."""

    def __init__(self, rig: hbot.Rig, address: str) -> None:
        """Use an open connection whose lease this program holds."""
        self.rig = rig
        self.address = address
        self.watch = Watch()
        self.origin: Quaternion = (1.0, 0.0, 0.0, 0.0)
        """Orientation from which the sphere's turn is measured."""
        self.log: list[hbot.State] | None = None
        """If a list: every state is appended to it."""
        self.off: bool | None = None
        """Whether the last `stop` has switched the torque off. None: there was none."""

    def start(self, stiffness: float, damping: float, more: dict[str, Any] | None = None) -> None:
        """Load the scene and begin to render, with the soft start of 0.5 s.

        Args:
            stiffness: N m/rad.
            damping: N m s/rad.
            more: other tables of the scene, such as `simulate`.
        """
        self.rig.disable()
        self.off = None
        if self.rig.reset() == "fault":
            raise CouplingError(f"{self.address} is in a fault whose cause is still there")
        self.rig.load_scene({**scene(stiffness, damping), **(more or {})})
        self.rig.enable()
        self.origin = next(self.rig.states()).q
        self.rig.refresh()

    def stop(self) -> None:
        """Switch the torque off. If the server does not confirm that, says what to do."""
        self.off = False
        try:
            self.rig.disable()
            self.off = True
        except hbot.HbotError as error:
            # A rig whose server still runs can go on to push.
            print(f"{self.address}: not confirmed, cut its power: {error}", file=sys.stderr)

    def begin(self) -> float | None:
        """Return the time of tick 0 on CLOCK_MONOTONIC of the server's machine, s."""
        clock = self.rig.info.clock
        return None if clock is None else clock.monotonic_ns * 1e-9

    def see(self, state: hbot.State, other: End) -> None:
        """Note what a state says, and the age of the other orientation in it.

        Raises:
            CouplingError: the rig does not render any more.
        """
        if state.mode not in ("enabling", "active"):
            what = f"fault {state.fault}" if state.fault else f"mode {state.mode}"
            raise CouplingError(f"{self.address} is in the {what}")
        watch = self.watch
        watch.states += 1
        watch.energy = state.energy
        watch.torque = max(watch.torque, math.hypot(*state.torque))
        here, there = self.begin(), other.begin()
        stream = state.client
        if stream and stream.seq is not None and here is not None and there is not None:
            sent = there + stream.seq / other.rig.hello.rate_hz
            watch.delays.append(here + state.t - sent)
        if self.log is not None:
            self.log.append(state)


class Coupling:
    """Two rigs, and two threads that send the orientation of each to the other.

    Use it as a context manager. At the end of the block both rigs are disabled.
    """

    def __init__(self, a: End, b: End, delay: float) -> None:
        """Prepare the coupling.

        Args:
            a: a rig whose lease this program holds.
            b: the other.
            delay: s. The orientation of a tick is held back until the state that is so much later.
        """
        if not 0.0 <= delay <= MAX_DELAY:
            raise ValueError(f"a delay of {delay} s; legal: 0 to {MAX_DELAY}")
        self.ends = (a, b)
        self._delay = delay
        self._over = threading.Event()
        self._reason: Exception | None = None
        self._threads = [
            threading.Thread(target=self._carry, args=pair, daemon=True)
            for pair in ((a, b), (b, a))
        ]

    def __enter__(self) -> Coupling:
        """Begin to send orientations. Both rigs must be enabled."""
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        """Stop sending, and switch both torques off at the same time: one may not answer."""
        self._over.set()
        stops = [threading.Thread(target=end.stop, daemon=True) for end in self.ends]
        for thread in stops:
            thread.start()
        for thread in (*stops, *self._threads):
            thread.join()

    def wait(self, seconds: float) -> None:
        """Wait.

        Raises:
            hbot.HbotError, CouplingError: the coupling has ended by itself. Says why.
        """
        if self._over.wait(seconds) and self._reason is not None:
            raise self._reason

    def check_events(self) -> None:
        """Look for events that end the coupling.

        Raises:
            CouplingError: another client has the lease.
        """
        for end in self.ends:
            for event in end.rig.events(0.0):
                if isinstance(event, hbot.LeaseEvent) and event.session != end.rig.hello.session:
                    raise CouplingError(f"{event.holder} has the lease of {end.address}")
                if isinstance(event, hbot.RefusedEvent):
                    end.watch.refused += event.count

    def _carry(self, source: End, target: End) -> None:
        """Send the orientations of `source` to `target` until the end. Runs in a thread."""
        try:
            held: deque[hbot.State] = deque()
            # A turn from the origin of one sphere becomes the same turn, about the same axis of
            # frame N, from the origin of the other.
            between = times(conjugate(source.origin), target.origin)
            states_late = round(self._delay * source.rig.hello.rate_hz)
            for state in source.rig.states():
                if self._over.is_set():
                    return
                source.see(state, target)
                held.append(state)
                if len(held) > states_late:
                    old = held.popleft()
                    q = times(old.q, between)
                    try:
                        target.rig.reference(EFFECT, q=q, seq=old.tick, wait=False)
                    except hbot.NotHolder as error:
                        who = f"{error.holder} has the lease of {target.address}"
                        raise CouplingError(who) from error
        except (hbot.HbotError, CouplingError) as error:
            if not self._over.is_set():
                self._reason = error
                self._over.set()


@contextlib.contextmanager
def connected(address: str, token: Path | None) -> Iterator[End]:
    """Connect to a server and hold its lease for the time of a block. Then the torque is off."""
    with hbot.connect(address, name="couple", token=token) as rig, rig.lease():
        end = End(rig, address)
        try:
            yield end
        finally:
            if end.off is None:
                end.stop()


def describe(end: End) -> str:
    """Return what limits the energy of a rig, as far as its server tells."""
    limits = end.rig.info.limits
    energy = limits.energy
    bound = (
        "no limit on energy"
        if energy is None
        else (f"energy at most {energy.burst} J at once and {energy.power} W")
    )
    return f"{end.address}: {end.rig.info.rig.name}, {limits.torque} N m, {bound}"


def report(end: End, seconds: float) -> str:
    """Return one line on what happened at a rig since the last report."""
    seen = end.watch.clear()
    delay = f"{1e3 * sorted(seen.delays)[len(seen.delays) // 2]:.1f}" if seen.delays else "?"
    return (
        f"{end.address}: {seen.states / seconds:5.0f} states/s, delay {delay} ms, "
        f"torque <= {seen.torque:.3f} N m, energy {seen.energy:+.4f} J"
        + (f", {seen.refused} orientations refused" if seen.refused else "")
    )


def run(options: argparse.Namespace, ends: list[End]) -> None:
    """Couple two servers until Ctrl-C. Adds both rigs to `ends`."""
    with contextlib.ExitStack() as stack:
        for server in options.servers:
            ends.append(stack.enter_context(connected(server, options.token_file)))
        a, b = ends
        for end in ends:
            print(describe(end), flush=True)
            end.start(options.stiffness, options.damping)
        with Coupling(a, b, options.delay_ms * 1e-3) as coupling:
            last = time.monotonic()
            while True:
                coupling.wait(1.0)
                coupling.check_events()
                now = time.monotonic()
                for end in ends:
                    print(report(end, now - last), flush=True)
                    end.rig.refresh()  # The clock of a simulated rig moves.
                last = now


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """Read the command line. Ends the program if it is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("servers", nargs="*", metavar="HOST:PORT", help="the two servers")
    parser.add_argument("--stiffness", type=float, default=0.5, help="N m/rad; default: 0.5")
    parser.add_argument("--damping", type=float, default=0.02, help="N m s/rad; default: 0.02")
    parser.add_argument("--delay-ms", type=float, default=0.0, help="added each way; default: 0")
    parser.add_argument("--token-file", type=Path, help="file with the token of both servers")
    parser.add_argument("--study", type=Path, metavar="FOLDER", help="measure on simulated rigs")
    options = parser.parse_args(arguments)
    if options.study is None and len(options.servers) != 2:
        parser.error("name two servers, such as 127.0.0.1:4268 127.0.0.1:4280")
    if not 0.0 <= options.delay_ms <= 1e3 * MAX_DELAY:
        parser.error(f"--delay-ms must be from 0 to {1e3 * MAX_DELAY:.0f}")
    return options


def interrupt(_number: int, _frame: FrameType | None) -> None:
    """End as Ctrl-C does."""
    raise KeyboardInterrupt


def main() -> None:
    """Run the program.

    Exit code: 0 after Ctrl-C; 1 if the coupling ended by itself or a torque may not be off.
    """
    options = parse()
    # A shell that starts this program in the background makes it ignore SIGINT. A stop must work
    # there too.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, interrupt)
    if options.study is not None:
        from coupling import study

        study.run(options.study)
        return
    ends: list[End] = []
    with contextlib.suppress(SystemExit):
        try:
            with hbot.one_line_errors(CouplingError):
                run(options, ends)
        except KeyboardInterrupt:
            if all(end.off for end in ends):
                print("\nStopped. The torque of both rigs is off.")
                return
    print("The torque of each rig that still answers is off.", file=sys.stderr)
    sys.exit(1)


if __name__ == "__main__":
    main()
