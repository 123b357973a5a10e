"""The blocking client."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar

from . import ops
from .callbacks import call_back
from .connection import MAX_EVENTS, MAX_STATES, Connection, Send, ignore, no_state
from .errors import ConnectionLost, HbotError, NotHolder, TimedOut
from .events import Event, LostEvent, State
from .info import Hello, Info
from .mailbox import Mailbox
from .models import Model
from .rendering import Computed, Rendered, Rendering
from .request import Request

T = TypeVar("T")
Torque = Callable[[State], Sequence[float] | Model | Computed | None]
"""Computes a torque on the sphere (three numbers in frame N, N m) or a local model from a state.

`Computed` also names the tick of an older state that it used. None: send no torque this time.
"""


class Rig(ops.Ops):
    """A connection to a server. Any thread may call its methods.

    A thread of the package reads the connection as bytes arrive. So the server sees a quick reader
    and a heartbeat however slow the program is. What the program does not take in time is dropped,
    the oldest first; `lost` counts it, and a `LostEvent` tells it.

    Attributes:
        hello: the server's answer to the first message.
        info: the answer to `info` at the time of connecting or of the last `refresh`. Later changes
            are not in it: `refresh().scene` is the running scene.
    """

    def __init__(
        self, connection: Connection, on_event: Callable[[Event], None] | None = None
    ) -> None:
        """Use an open connection. Programs call `connect` instead."""
        self._connection = connection
        self._events: Mailbox[Event] = Mailbox(MAX_EVENTS)
        self._on_event = on_event
        self.hello: Hello = connection.hello
        connection.start(self._events)
        try:
            self.info: Info = self._call(ops.INFO)
        except BaseException:
            connection.close()
            raise
        if on_event is not None:
            threading.Thread(target=self._call_back, name="hbot-events", daemon=True).start()

    def __enter__(self) -> Rig:
        """Return the connection itself."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Close the connection."""
        self.close()

    def __str__(self) -> str:
        """Say the rig's name, SIMULATED or LIVE, the mode and the scene. Asks the server for them.

        After the connection has ended, it says what was last known.
        """
        with contextlib.suppress(HbotError):
            self.refresh()
        return str(self.info)

    def close(self) -> None:
        """Close the connection. The server frees the lease, and this client's torque ends."""
        self._connection.close()

    @property
    def lost(self) -> LostEvent:
        """What this program was too slow to take or to send, since it connected."""
        return self._connection.lost

    def refresh(self) -> Info:
        """Ask for `info` again. Returns it and stores it in the attribute `info`."""
        self.info = self._call(ops.INFO)
        return self.info

    @contextmanager
    def lease(self, steal: bool = False) -> Iterator[None]:
        """Hold the lease inside a `with` block.

        It is given back at the end, also after an exception.

        Raises:
            Busy: another client, named in `holder`, has the lease, and `steal` is false.
        """
        self.acquire(steal)
        try:
            yield
        except BaseException:
            # The exception of the block says more. The server frees the lease of a lost connection.
            with contextlib.suppress(HbotError):
                self._finish(ops.RELEASE)
            raise
        with contextlib.suppress(NotHolder):  # Another client has taken it.
            self.release()

    def states(self, every: int = 1, duration: float | None = None) -> Iterator[State]:
        """Iterate over states.

        A connection has one subscription: a later `states` or `render` ends this one.

        If the program is more than 4096 states behind, the oldest are dropped; `lost.states` counts
        them.

        Args:
            every: ticks from one state to the next, 1 to 1000000.
            duration: time of the rig until the iteration ends, s. None: no end.

        Raises:
            TimedOut: no state came within the timeout of the connection.
            ConnectionLost: the connection has ended.
        """
        with self._subscription(every) as (states, wait):
            end: int | None = None
            while (state := states.get(wait)) is not None:
                if end is None and duration is not None:
                    end = state.tick + round(duration * self.hello.rate_hz)
                if end is not None and state.tick >= end:
                    return
                yield state
            raise no_state(wait)

    def render(
        self, torque: Torque, *, every: int = 1, valid_ms: int = 20, duration: float | None = None
    ) -> Rendered:
        """Compute torques from states and stream them.

        Needs the lease; the rig must be enabled to feel it. If it is not when this begins, the
        logger `hbot` logs a warning.

        The function always gets the newest state. If it is slow, older states are skipped and
        counted. The torque ends by itself `valid_ms` after the last message (and 20 ms of ramp),
        whatever happens to this program.

        Args:
            torque: computes the torque on the sphere in frame N, N m, or a `Model`, from a state. A
                function that returns the torque or model of an older state returns
                `hbot.Computed(torque, tick)` with that state's tick, so that
                `state.client.age_ticks` is true. None: send nothing this time.
            every: ticks from one state to the next, 1 to 1000000.
            valid_ms: how long each torque is valid, 1 to 1000 ms. Choose several periods of
                `every`.
            duration: time of the rig until this returns, s. None: no end.

        Raises:
            NotHolder: this client does not hold the lease, or another client has taken it.
            Faulted: the rig went into a fault or an emergency stop.
            TimedOut, ConnectionLost: no state came.
            ValueError, TypeError: the torque is not three finite numbers.
            TooLarge: a model has more than 2048 bytes in the encoding of the connection.
        """
        rendering = Rendering(self._connection, every, valid_ms, duration)
        with self._subscription(every) as (states, wait):
            while True:
                state, skipped = states.newest(wait)
                if state is None:
                    raise no_state(wait)
                if not rendering.goes_on(state, skipped):
                    break
                rendering.send(state, torque(state))
        return rendering.result

    def events(self, duration: float | None = None) -> Iterator[Event]:
        """Iterate over the events that were not taken yet, since the connection began.

        Args:
            duration: longest time to wait for each event, s. 0: only events that have arrived.
                None: no end.

        Raises:
            ConnectionLost: the connection has ended, after the last event.
            ValueError: `connect` was given `on_event`, which gets the events instead.
        """
        if self._on_event is not None:
            raise ValueError("on_event gets the events of this connection")
        while (event := self._events.get(duration)) is not None:
            yield event

    def _call_back(self) -> None:
        """Pass events to the program's function until the connection ends.

        Runs in a separate thread.
        """
        assert self._on_event is not None
        try:
            while (event := self._events.get(None)) is not None:
                call_back(self._on_event, event)
        except HbotError:
            pass  # The program's next call raises it.

    def _call(self, request: Request[T], send: Send | None = None) -> T:
        if not request.wait:
            self._connection.post(request.op, request.fields)
            return request.read(None)
        answers: queue.SimpleQueue[tuple[Any, Exception | None]] = queue.SimpleQueue()
        send = send or self._connection.request
        send(request.op, request.fields, lambda body, error: answers.put((body, error)))
        try:
            body, error = answers.get(timeout=self._connection.timeout)
        except queue.Empty:
            raise TimedOut(f"{request.op}: no answer for {self._connection.timeout} s") from None
        if error is not None:
            raise request.explain(error)
        return request.read(body)

    def _finish(self, request: Request[None], send: Send | None = None) -> None:
        """Send the request that ends a block, and wait for its answer unless that is in vain.

        A block that ends because the server is silent would otherwise take as long again.
        """
        if self._connection.in_vain:
            (send or self._connection.request)(request.op, request.fields, ignore)
        else:
            self._call(request, send)

    @contextmanager
    def _subscription(self, every: int) -> Iterator[tuple[Mailbox[State], float]]:
        """Subscribe for the time of a block.

        Returns the states, and the longest time to wait for one, s.
        """
        states: Mailbox[State] = Mailbox(MAX_STATES)
        try:
            self._call(ops.subscribe(every), partial(self._connection.subscribe, states))
            yield states, self._connection.timeout + every / self.hello.rate_hz
        finally:
            with contextlib.suppress(ConnectionLost, TimedOut):
                self._finish(ops.UNSUBSCRIBE, partial(self._connection.unsubscribe, states))
