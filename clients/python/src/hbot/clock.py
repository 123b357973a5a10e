"""Places the times of states on a clock of this machine.

A state carries `t`, the time since tick 0. What is needed is the *offset*: the time of tick 0 on
the clock of this machine, s. There are two ways to it:

`clock`
    `info.clock.monotonic_ns` is this time on CLOCK_MONOTONIC of the server's machine. If server and
    client run on one machine, it is exact. The time of the simulated rig waits while the machine is
    busy, and the clock moves by each wait. So ask for it again from time to time (`told`).

`ping`
    Between two machines, round trips enclose the offset. A ping is sent at s, and its answer
    arrives at r, both on the local clock. The answer names the time t of the last tick, and ticks
    are a period p apart. That tick had begun before the answer arrived, so offset <= r - t. The
    next tick had not begun when the request was sent, so offset >= s - t - p. The estimate is the
    middle between the closest bounds of many round trips. Its error has two parts: half of the
    distance between the bounds, and half of the difference between the ways there and back.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from dataclasses import dataclass

from .errors import VirtualTime
from .rig import Rig

SAME_CLOCK_S = 0.005
"""Two ways to the offset that differ by less than this mean that both machines are one, s.

CLOCK_MONOTONIC counts from the start of a machine. So those of two machines differ by far more.
"""
PINGS = 60
"""Round trips of one estimate."""


@dataclass(frozen=True, slots=True)
class Offset:
    """The time of tick 0 on the local clock."""

    seconds: float
    """Time of tick 0, s."""
    uncertainty: float
    """Half of the distance between the bounds, s. 0 if the clock is shared."""
    shared: bool
    """Whether the server has the same clock."""


def measure(rig: Rig, now: Callable[[], float], pings: int = PINGS) -> Offset:
    """Return the offset by round trips. Takes about two periods of the loop for each ping.

    Args:
        rig: the connection.
        now: the local clock, s.
        pings: number of round trips.
    """
    period = 1.0 / rig.hello.rate_hz
    low, high = float("-inf"), float("inf")
    for _ in range(pings):
        # At moments that do not keep step with the ticks, so that some come close to one.
        time.sleep(random.uniform(0.5, 2.0) * period)
        sent = now()
        pong = rig.ping()
        received = now()
        low = max(low, sent - pong.t - period)
        high = min(high, received - pong.t)
    return Offset((low + high) / 2.0, abs(high - low) / 2.0, shared=False)


def offset(rig: Rig, now: Callable[[], float] = time.monotonic) -> Offset:
    """Return the time of tick 0 on the clock `now`: exact if the server has this clock.

    Stores a new answer to `info` in `rig.info`.

    Args:
        rig: the connection.
        now: the local clock, s. The way `clock` needs a clock that reads CLOCK_MONOTONIC.
    """
    measured = measure(rig, now)
    shared = told(rig)
    if (
        shared is None
        or abs(shared.seconds - measured.seconds) > SAME_CLOCK_S + measured.uncertainty
    ):
        return measured
    return shared


def told(rig: Rig) -> Offset | None:
    """Return what the server says of tick 0 now, on CLOCK_MONOTONIC of its machine.

    Stores a new answer to `info` in `rig.info`. None: the server does not tell its clock.
    """
    answer = rig.refresh().clock
    return None if answer is None else Offset(answer.monotonic_ns * 1e-9, 0.0, shared=True)


def refuse_virtual_time(rig: Rig, what: str) -> None:
    """Raise `VirtualTime` if the server runs in virtual time, where `what` makes no sense.

    Such a server does not wait for a program, so a torque would be many ticks old. It is noticed by
    time that passes more than half as fast again as here. Takes 0.2 s.
    """
    sent = time.monotonic()
    first = rig.ping().t
    time.sleep(0.2)
    passed = rig.ping().t - first
    # The first answer was given after it was asked for, so no more than this has passed.
    longest = time.monotonic() - sent + 1.0 / rig.hello.rate_hz
    if passed > 1.5 * longest:
        raise VirtualTime(
            f"{what} needs a server in real time, but {passed:.1f} s of the rig passed in "
            f"{longest:.1f} s: start the server without `--time virtual`"
        )
