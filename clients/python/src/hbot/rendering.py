"""What `Rig.render` and `aio.Rig.render` have in common."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from .connection import Connection
from .errors import Faulted
from .events import State
from .models import Model
from .ops import model_fields, torque_fields

_LOG = logging.getLogger("hbot")


@dataclass(frozen=True, slots=True)
class Rendered:
    """What a `render` did."""

    calls: int
    """How often the function was called."""
    skipped: int
    """States that were skipped because the function was still at work on an older one.

    The last torque goes on acting meanwhile, at most for `valid_ms`.
    """
    unsent: int
    """Torques that were not sent because the connection took no more bytes."""
    refused: int
    """Stream messages of this connection that the server refused, as far as it has reported them.

    It reports them at most once a second. The reason is in the last `RefusedEvent`.
    """
    dropped: int
    """States that the server did not send because this program read too slowly, as far as the
    server has reported them."""


class Computed(NamedTuple):
    """What was computed from an older state than the one that the function was given.

    `state.client.age_ticks` then counts from that older state, and the server refuses what is older
    than the rig's `limits.max_age_ticks`.
    """

    torque: Sequence[float] | Model
    """The torque on the sphere in frame N, N m, or a model."""
    tick: int
    """The tick of the state from which it was computed."""


class Rendering:
    """One `render` in progress."""

    def __init__(
        self, connection: Connection, every: int, valid_ms: int, duration: float | None
    ) -> None:
        """Begin a rendering of `duration` s (None: without end) from every `every`-th tick."""
        if not 1 <= valid_ms <= 1000:
            raise ValueError(f"valid_ms is {valid_ms}; legal: 1 to 1000 ms")
        self._connection = connection
        self._every = every
        self._valid_ms = valid_ms
        self._duration = duration
        self._end: int | None = None
        self._calls = self._skipped = self._unsent = 0
        self._refused_before = connection.refused
        self._dropped_before = connection.dropped

    @property
    def result(self) -> Rendered:
        """What the rendering has done so far."""
        refused = self._connection.refused - self._refused_before
        dropped = self._connection.dropped - self._dropped_before
        return Rendered(self._calls, self._skipped, self._unsent, refused, dropped)

    def goes_on(self, state: State, skipped: int) -> bool:
        """Return whether a torque is wanted for this state.

        Raises:
            NotHolder: this client has lost the lease.
            Faulted: the rig is in a fault or an emergency stop.
        """
        if not self._connection.holds_lease:
            raise self._connection.not_holder("render", self._connection.holder)
        if state.mode in ("fault", "estop"):
            raise Faulted(
                f"the rig is in mode {state.mode}: {state.fault or 'somebody stopped it'}",
                op="render",
            )
        if self._calls == 0 and state.mode not in ("enabling", "active"):
            _LOG.warning(
                "render: the rig is in mode %s and makes no torque: call rig.enable() first",
                state.mode,
            )
        if self._end is None and self._duration is not None:
            self._end = state.tick + round(self._duration * self._connection.hello.rate_hz)
        over = self._end is not None and state.tick >= self._end
        if over and self._end is not None:
            # Some of the skipped states can be later than the end, too.
            skipped = max(0, skipped - (state.tick - self._end) // self._every)
        if self._calls > 0:  # Before the first call, no function was at work.
            self._skipped += skipped
        return not over

    def send(self, state: State, torque: Sequence[float] | Model | Computed | None) -> None:
        """Send the torque or model that was computed from `state`. None: send nothing."""
        self._calls += 1
        if torque is None:
            return
        tick = state.tick
        if isinstance(torque, Computed):
            torque, tick = torque
        op, fields = _message(torque, self._valid_ms, tick, state.tick)
        if not self._connection.post(op, fields):
            self._unsent += 1


def _message(
    torque: Sequence[float] | Model, valid_ms: int, tick: int, seq: int
) -> tuple[str, dict[str, Any]]:
    """Return the op and the fields of the message that sends a torque or a model."""
    if isinstance(torque, Model):
        return "model", model_fields(torque, valid_ms, tick, seq)
    return "torque", torque_fields(torque, valid_ms, tick, seq)
