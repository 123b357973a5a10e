"""The client for programs with asyncio. Its names are those of the blocking client, `hbot.Rig`.

A thread of the package reads the connection, as in the blocking client. So a busy event loop
neither stops the heartbeat nor makes the server cut the connection.
"""

from __future__ import annotations

import asyncio
import contextlib
import inspect
from collections.abc import AsyncIterator, Awaitable, Callable, Generator, Sequence
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

from . import ops
from .callbacks import call_back
from .connection import (
    MAX_EVENTS,
    MAX_STATES,
    Answer,
    Connection,
    Options,
    Send,
    ignore,
    no_state,
)
from .environment import server_token
from .errors import ConnectionLost, HbotError, NotHolder, TimedOut
from .events import Event, LostEvent, State
from .info import Hello, Info
from .mailbox import Mailbox
from .models import Model
from .rendering import Computed, Rendered, Rendering
from .request import Request
from .transport import Tls
from .wire import Encoding

T = TypeVar("T")
Made = Sequence[float] | Model | Computed
Torque = Callable[[State], Made | Awaitable[Made | None] | None]
"""Computes a torque from a state, as `hbot.rig.Torque` does. It can be a coroutine function."""


def connect(
    address: str | None = None,
    *,
    name: str = "python",
    token: str | Path | None = None,
    tls: Tls | None = None,
    encoding: Encoding = "json",
    timeout: float = 5.0,
    on_event: Callable[[Event], None] | None = None,
) -> Connecting:
    """Open a connection: `async with hbot.aio.connect(...) as rig`, or `await` it.

    The arguments and exceptions are those of `hbot.connect`. `on_event` is called in the event
    loop.
    """
    options = Options(name, server_token(token), tls, encoding, timeout)
    return Connecting(address, options, on_event)


class Connecting:
    """A connection that is about to be opened."""

    def __init__(
        self, address: str | None, options: Options, on_event: Callable[[Event], None] | None
    ) -> None:
        """Remember the arguments of `connect`."""
        self._address = address
        self._options = options
        self._on_event = on_event
        self._rig: Rig | None = None

    def __await__(self) -> Generator[Any, None, Rig]:
        """Open the connection."""
        return self._open().__await__()

    async def __aenter__(self) -> Rig:
        """Open the connection."""
        self._rig = await self._open()
        return self._rig

    async def __aexit__(self, *_error: object) -> None:
        """Close the connection."""
        assert self._rig is not None
        await self._rig.close()

    async def _open(self) -> Rig:
        connection = await asyncio.to_thread(Connection, self._address, self._options)
        rig = Rig(connection, self._on_event)
        try:
            await rig.refresh()
        except BaseException:
            connection.close()
            raise
        return rig


class _Box(Generic[T]):
    """A mailbox that a coroutine can await."""

    def __init__(self, limit: int) -> None:
        self._loop = asyncio.get_running_loop()
        self._ready = asyncio.Event()
        self._woken = False
        self.mailbox: Mailbox[T] = Mailbox(limit, self._wake)

    def _wake(self) -> None:
        """Wake the coroutine.

        The reading thread calls this for each item, and the loop is asked once.
        """
        if not self._woken:
            self._woken = True
            with contextlib.suppress(RuntimeError):  # The event loop has been closed.
                self._loop.call_soon_threadsafe(self._ready.set)

    async def get(self, timeout: float | None) -> T | None:
        """Return the oldest item, and wait at most `timeout` s for it. None: none came."""
        while True:
            self._ready.clear()
            self._woken = False
            if (item := self.mailbox.take()) is not None:
                return item
            try:
                await asyncio.wait_for(self._ready.wait(), timeout)
            except asyncio.TimeoutError:
                return self.mailbox.take()


class Rig(ops.Ops):
    """A connection to a server. `hbot.Rig` describes each method, its arguments and its exceptions.

    Only coroutines of one event loop may use it.

    Attributes:
        hello: the server's answer to the first message.
        info: the answer to `info` at the time of connecting or of the last `refresh`.
    """

    info: Info
    _awaited = True

    def __init__(
        self, connection: Connection, on_event: Callable[[Event], None] | None = None
    ) -> None:
        """Use an open connection. Programs call `connect` instead."""
        self._connection = connection
        self._loop = asyncio.get_running_loop()
        self._events: _Box[Event] = _Box(MAX_EVENTS)
        self._on_event = on_event
        self.hello: Hello = connection.hello
        connection.start(self._events.mailbox)
        self._callbacks = (
            None if on_event is None else asyncio.ensure_future(self._call_back(on_event))
        )

    def __str__(self) -> str:
        """Say what the last `refresh` told: name, SIMULATED or LIVE, mode and scene."""
        return str(self.info)

    async def close(self) -> None:
        """Close the connection. The server frees the lease, and this client's torque ends."""
        if self._callbacks is not None:
            self._callbacks.cancel()
        await asyncio.to_thread(self._connection.close)

    @property
    def lost(self) -> LostEvent:
        """What this program was too slow to take or to send, since it connected."""
        return self._connection.lost

    async def refresh(self) -> Info:
        """Ask for `info` again. Returns it and stores it in the attribute `info`."""
        self.info = await self._call(ops.INFO)
        return self.info

    @asynccontextmanager
    async def lease(self, steal: bool = False) -> AsyncIterator[None]:
        """Hold the lease inside an `async with` block.

        It is given back at the end, also after an exception.
        """
        await self.acquire(steal)
        try:
            yield
        except BaseException:
            with contextlib.suppress(HbotError):
                await self._finish(ops.RELEASE)
            raise
        with contextlib.suppress(NotHolder):  # Another client has taken it.
            await self.release()

    async def states(self, every: int = 1, duration: float | None = None) -> AsyncIterator[State]:
        """Iterate over states.

        A later `states` or `render` of this connection ends this iteration.
        """
        async with self._subscription(every) as (states, wait):
            end: int | None = None
            while (state := await states.get(wait)) is not None:
                if end is None and duration is not None:
                    end = state.tick + round(duration * self.hello.rate_hz)
                if end is not None and state.tick >= end:
                    return
                yield state
            raise no_state(wait)

    async def render(
        self, torque: Torque, *, every: int = 1, valid_ms: int = 20, duration: float | None = None
    ) -> Rendered:
        """Compute torques from states and stream them. The function can be a coroutine function.

        It runs in the event loop. If something else keeps the event loop busy for `valid_ms`, the
        torque ends.
        """
        rendering = Rendering(self._connection, every, valid_ms, duration)
        async with self._subscription(every) as (states, wait):
            while True:
                first = await states.get(wait)
                if first is None:
                    raise no_state(wait)
                later, skipped = states.mailbox.newest(0.0)
                state = first if later is None else later
                if not rendering.goes_on(state, skipped + (later is not None)):
                    break
                value = torque(state)
                rendering.send(state, await value if inspect.isawaitable(value) else value)
        return rendering.result

    async def events(self, duration: float | None = None) -> AsyncIterator[Event]:
        """Iterate over the events that were not taken yet.

        Waits at most `duration` s for each (None: no end).
        """
        if self._on_event is not None:
            raise ValueError("on_event gets the events of this connection")
        while (event := await self._events.get(duration)) is not None:
            yield event

    async def _call_back(self, on_event: Callable[[Event], None]) -> None:
        with contextlib.suppress(HbotError):  # The program's next call raises it.
            while (event := await self._events.get(None)) is not None:
                call_back(on_event, event)

    async def _call(self, request: Request[T], send: Send | None = None) -> T:
        if not request.wait:
            self._connection.post(request.op, request.fields)
            return request.read(None)
        answered: asyncio.Future[Any] = self._loop.create_future()

        def settle(body: Any, error: Exception | None) -> None:
            if answered.done():
                return
            if error is None:
                answered.set_result(body)
            else:
                answered.set_exception(request.explain(error))

        def answer(body: Any, error: Exception | None) -> None:
            with contextlib.suppress(RuntimeError):  # The event loop has been closed.
                self._loop.call_soon_threadsafe(settle, body, error)

        await self._send(request, send, answer)
        try:
            body = await asyncio.wait_for(answered, self._connection.timeout)
        except asyncio.TimeoutError:
            raise TimedOut(f"{request.op}: no answer for {self._connection.timeout} s") from None
        return request.read(body)

    async def _finish(self, request: Request[None], send: Send | None = None) -> None:
        """End a block as `hbot.Rig` does."""
        if self._connection.in_vain:
            await self._send(request, send, ignore)
        else:
            await self._call(request, send)

    async def _send(self, request: Request[T], send: Send | None, answer: Answer) -> None:
        send = send or self._connection.request
        if self._connection.writable():
            send(request.op, request.fields, answer)
        else:
            await asyncio.to_thread(send, request.op, request.fields, answer)

    @asynccontextmanager
    async def _subscription(self, every: int) -> AsyncIterator[tuple[_Box[State], float]]:
        states: _Box[State] = _Box(MAX_STATES)
        subscribe = partial(self._connection.subscribe, states.mailbox)
        unsubscribe = partial(self._connection.unsubscribe, states.mailbox)
        try:
            await self._call(ops.subscribe(every), subscribe)
            yield states, self._connection.timeout + every / self.hello.rate_hz
        finally:
            with contextlib.suppress(ConnectionLost, TimedOut):
                await self._finish(ops.UNSUBSCRIBE, unsubscribe)
