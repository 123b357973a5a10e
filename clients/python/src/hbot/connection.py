"""A connection and the thread that reads it.

The front ends `Rig` and `aio.Rig` share this module.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from . import wire
from .decode import decode
from .environment import server_address
from .errors import (
    ConnectionLost,
    HbotError,
    NoServer,
    NotHolder,
    NotTrusted,
    ProtocolError,
    Refused,
    SubscriptionTaken,
    TimedOut,
    TooLarge,
)
from .events import (
    DroppedEvent,
    Event,
    LeaseEvent,
    LostEvent,
    RefusedEvent,
    State,
    StoppingEvent,
    read_event,
)
from .info import Hello
from .mailbox import Mailbox
from .transport import ALERT, Tls, Transport, open_transport

_LOG = logging.getLogger("hbot")

HEARTBEAT_S = 1.0
"""After this time without a message from the server, the client sends a `ping`, s."""
SILENCE_S = 10.0
"""After this time without a message from the server, the connection counts as lost, s."""
MAX_EVENTS = 4096
"""Largest number of events that wait for `events()`."""
MAX_STATES = 4096
"""Largest number of states that wait for `states()`: those of four seconds at 1 kHz."""

Answer: TypeAlias = Callable[[Any, Exception | None], None]
"""Receives the body of an answer or the reason why there is none. The reading thread calls it."""
Send: TypeAlias = Callable[[str, dict[str, Any], Answer], None]
"""Sends a request: its op, its fields, and what receives the answer."""


@dataclass(frozen=True, slots=True)
class Options:
    """Options of `connect`."""

    name: str
    token: str | Path | None = None
    tls: Tls | None = None
    encoding: wire.Encoding = "json"
    timeout: float = 5.0


@dataclass(slots=True)
class _Pending:
    """A request that waits for its answer."""

    op: str
    size: int
    answer: Answer


class Connection:
    """A connection after its hello. A thread reads it until it ends."""

    def __init__(self, address: str | None, options: Options) -> None:
        """Connect and exchange the hello. `start` must follow.

        Args:
            address: None: what the environment says, as `server_address` describes.
            options: all others.

        Raises:
            NoServer, NotTrusted: there is no connection.
            Refused: the server refused the hello.
            TimedOut: the server did not answer.
        """
        self.timeout = options.timeout
        self.lost = LostEvent(states=0, events=0, sends=0)
        self.refused = 0
        self.refusal = ""
        self.dropped = 0
        self.holds_lease = False
        self.lost_lease_to: str | None = None
        self.holder: str | None = None
        self._encode = wire.encoder(options.encoding)
        self._prefix = wire.LENGTH_BYTES if options.encoding == "msgpack" else 0
        try:
            self._transport = open_transport(server_address(address), options.tls, options.timeout)
        except NoServer as error:
            advice = (
                "name another address in the variable HBOT_SERVER"
                if address is None
                else "give another address"
            )
            raise NoServer(
                f"{error}. Start a server with `hbot server` (`cargo run server` in the project's "
                f"folder), or {advice}"
            ) from error.__cause__
        try:
            self.hello, self._early = _say_hello(self._transport, options)
        except BaseException:
            self._transport.close()
            raise
        self._splitter = wire.Splitter(options.encoding)
        self._pending: dict[int, _Pending] = {}
        # All locks of a connection are re-entrant: wherever a thread is, the garbage collector can
        # end an iteration of states in it, which sends a request.
        self._lock = threading.RLock()
        self._last_id = 0
        self._error: Exception | None = None
        self._heard = time.monotonic()
        self._told_at = -1.0
        self._stopping: str | None = None
        # A subscription is registered and requested under this lock, so the last one that is
        # registered is also the last one that the server hears of.
        self._subscribing = threading.RLock()
        self._subscriber: Mailbox[State] | None = None
        self._states: Mailbox[State] | None = None
        self._events: Mailbox[Event] = Mailbox(MAX_EVENTS)
        self._thread = threading.Thread(target=self._read, name="hbot-reader", daemon=True)

    def start(self, events: Mailbox[Event]) -> None:
        """Start the thread that reads. Events go to the mailbox."""
        self._events = events
        self._thread.start()

    def request(self, op: str, fields: dict[str, Any], answer: Answer) -> None:
        """Send a request. The reading thread calls `answer`, once.

        Raises:
            ConnectionLost: the connection has ended.
            ValueError, TypeError: a field cannot be encoded, for example because a number is not
                finite.
        """
        with self._lock:
            self._last_id += 1
            number = self._last_id
        data = self._encode({"id": number, "op": op, **fields})
        pending = _Pending(op, len(data), answer)
        with self._lock:
            if self._error is None:
                self._pending[number] = pending
        self._send(data)

    def post(self, op: str, fields: dict[str, Any]) -> bool:
        """Send a stream message, which gets no answer.

        Returns:
            False if the connection takes no more bytes. The message is not sent then, because it
            would be old when it arrives; `lost.sends` counts it.

        Raises:
            NotHolder: another client has taken the lease from this one.
            TooLarge: the message is too long. The server's refusal would not name it, and could
                count as the answer to a request.
        """
        if self.lost_lease_to is not None:
            raise self.not_holder(op, self.holder)
        data = self._encode({"op": op, **fields})
        size = len(data) - self._prefix
        if size > wire.MAX_STREAM_BYTES:
            raise TooLarge(f"{size} bytes; legal: at most {wire.MAX_STREAM_BYTES}", op=op)
        if self._error is None and not self._transport.writable():
            self._lose(sends=1)
            return False
        self._send(data)
        return True

    @property
    def in_vain(self) -> bool:
        """Whether this thread would wait in vain for an answer.

        Either nothing has arrived from the server for the timeout of the connection, or this is the
        thread that reads: the garbage collector can end an iteration of states in it.
        """
        silent = time.monotonic() - self._heard >= self.timeout
        return silent or threading.current_thread() is self._thread

    def writable(self) -> bool:
        """Return whether a short message can be sent without waiting."""
        return self._transport.writable()

    def subscribe(
        self, states: Mailbox[State], op: str, fields: dict[str, Any], answer: Answer
    ) -> None:
        """Send a request that subscribes, and put states into this mailbox from its answer on.

        Ends an earlier mailbox, also one whose request has no answer yet.

        Raises:
            ConnectionLost: the connection has ended.
        """

        def begin(body: Any, error: Exception | None) -> None:
            with self._lock:
                if error is None and self._subscriber is states:
                    self._states = states
            answer(body, error)

        with self._subscribing:
            with self._lock:
                before, self._subscriber, self._states = self._subscriber, states, None
            if before is not None:
                before.end(
                    SubscriptionTaken(
                        "a later states() or render() of this connection has replaced this one"
                    )
                )
            self.request(op, fields, begin)

    def unsubscribe(
        self, states: Mailbox[State], op: str, fields: dict[str, Any], answer: Answer
    ) -> None:
        """Put no more states into this mailbox, and send a request that ends the subscription.

        If a later mailbox has replaced this one, nothing is sent, and `answer` is called at once.

        Raises:
            ConnectionLost: the connection has ended.
        """
        with self._subscribing:
            with self._lock:
                last = self._subscriber is states
                if last:
                    self._subscriber = self._states = None
            if last:
                return self.request(op, fields, answer)
        answer(None, None)

    def not_holder(self, op: str, holder: str | None) -> NotHolder:
        """Return the exception for an op that needs the lease, which this client does not hold.

        `holder` is the name of the client that holds it, if that is known.
        """
        if self.lost_lease_to is not None:
            state = f"{self.lost_lease_to} has taken the lease"
            if holder not in (None, self.lost_lease_to):
                state += f", and {holder} holds it now"
        elif holder is not None:
            state = f"{holder} holds the lease"
        else:
            state = "this client does not hold the lease"
        steal = "" if holder is None else "steal=True"
        return NotHolder(f"{state}: take it with `rig.lease({steal})`", op=op, holder=holder)

    def close(self) -> None:
        """End the connection. Calls and iterations that wait raise `ConnectionLost`."""
        self._fail(ConnectionLost("this program has closed the connection"))
        if threading.current_thread() is not self._thread and self._thread.is_alive():
            self._thread.join(self.timeout)

    def _send(self, data: bytes) -> None:
        if self._error is not None:
            raise self._error
        try:
            self._transport.send(data)
        except (OSError, ValueError) as error:
            raise self._fail(
                ConnectionLost(f"the server takes no bytes any more: {error}")
            ) from error

    def _read(self) -> None:
        """Read until the connection ends. Runs in the thread."""
        early, self._early = self._early, b""
        try:
            for message in self._splitter.push(early):
                self._take(message)
            while self._error is None:
                data = self._transport.receive(HEARTBEAT_S)
                if data is None:
                    silence = time.monotonic() - self._heard
                    if silence > SILENCE_S:
                        raise ConnectionLost(f"the server has been silent for {silence:.0f} s")
                    if silence >= HEARTBEAT_S and self._transport.writable():
                        self.request("ping", {}, ignore)
                    continue
                if not data:
                    reason = self._stopping or "it ended, or it cut this client"
                    raise ConnectionLost(f"the server has closed the connection: {reason}")
                self._heard = time.monotonic()
                for message in self._splitter.push(data):
                    self._take(message)
        except HbotError as error:
            self._fail(error)
        except (OSError, ValueError) as error:
            self._fail(ConnectionLost(f"the connection broke: {error}"))
        finally:
            self._fail(ConnectionLost("the thread that reads has ended"))
            self._transport.close()

    def _take(self, message: dict[str, Any]) -> None:
        if "event" not in message:
            return self._take_answer(message)
        event = read_event(message)
        if isinstance(event, State):
            if (states := self._states) is not None and states.put(event):
                self._lose(states=1)
        elif event is not None:
            if isinstance(event, LeaseEvent):
                self._take_lease(event)
            elif isinstance(event, RefusedEvent):
                if self.refused == 0:
                    advice = (
                        "; with fewer states (such as every=5) a slow program keeps up"
                        if "max_age_ticks" in event.message
                        else ""
                    )
                    _LOG.warning(
                        "the server refused messages, the last: %s%s", event.message, advice
                    )
                self.refused, self.refusal = event.total, event.message
            elif isinstance(event, DroppedEvent):
                self.dropped = event.total
            elif isinstance(event, StoppingEvent):
                self._stopping = event.message
            self._put_event(event)

    def _take_answer(self, message: dict[str, Any]) -> None:
        with self._lock:
            number = message.get("id")
            if number is None and self._pending:
                # The server could not read the id. That happens only if the request was too long.
                number = max(self._pending, key=lambda number: self._pending[number].size)
            pending = self._pending.pop(number, None) if isinstance(number, int) else None
        if pending is None:
            return  # The late answer to a call that has timed out.
        if "error" in message:
            try:
                refused = Refused.of(message["error"], pending.op)
            except ProtocolError as error:
                pending.answer(None, error)
                raise
            if isinstance(refused, NotHolder):
                refused = self.not_holder(pending.op, refused.holder)
            pending.answer(None, refused)
        else:
            pending.answer(message.get("ok"), None)

    def _take_lease(self, event: LeaseEvent) -> None:
        self.holder = event.holder
        if event.session == self.hello.session:
            self.holds_lease, self.lost_lease_to = True, None
        elif self.holds_lease:
            self.holds_lease, self.lost_lease_to = False, event.holder

    def _put_event(self, event: Event) -> None:
        if self._events.put(event):
            self._lose(events=1)

    def _lose(self, states: int = 0, events: int = 0, sends: int = 0) -> None:
        """Count what was lost, and put a `LostEvent` among the events, at most once a second."""
        with self._lock:
            lost = self.lost
            self.lost = LostEvent(lost.states + states, lost.events + events, lost.sends + sends)
        now = time.monotonic()
        if now - self._told_at >= 1.0:
            self._told_at = now
            self._events.put(self.lost)

    def _fail(self, error: Exception) -> Exception:
        """End the connection because of `error`, if it has not ended before.

        Return why it has ended.
        """
        with self._lock:
            if self._error is not None:
                return self._error
            self._error = error
            pending, self._pending = list(self._pending.values()), {}
            subscriber = self._subscriber
        self._transport.shutdown()
        for waiting in pending:
            with contextlib.suppress(Exception):
                waiting.answer(None, error)
        self._events.end(error)
        if subscriber is not None:
            subscriber.end(error)
        return error


def ignore(_body: Any, _error: Exception | None) -> None:
    """Take an answer that nobody waits for."""


def no_state(wait: float) -> TimedOut:
    """Return the exception for a wait of `wait` s in which no state came."""
    return TimedOut(f"no state for {wait:.1f} s: does the server's loop run?")


def _say_hello(transport: Transport, options: Options) -> tuple[Hello, bytes]:
    """Open the session. Returns the answer, and the bytes that arrived after it."""
    fields: dict[str, Any] = {
        "version": wire.VERSION,
        "name": options.name,
        "encoding": options.encoding,
    }
    if options.token is not None:
        text = options.token
        fields["token"] = (
            text.read_text(encoding="utf-8").strip() if isinstance(text, Path) else text
        )
    hello = wire.encode_json({"id": 0, "op": "hello", **fields})
    try:
        return _exchange_hello(transport, hello, options.timeout)
    except (OSError, ValueError) as error:
        if isinstance(error, HbotError):
            raise
        raise ConnectionLost(f"the connection broke before the answer to hello: {error}") from error


def _exchange_hello(transport: Transport, hello: bytes, timeout: float) -> tuple[Hello, bytes]:
    """Send the hello. Returns the answer, and the bytes that arrived after it."""
    transport.send(hello)
    received = b""
    until = time.monotonic() + timeout
    while (left := until - time.monotonic()) > 0:
        data = transport.receive(left)
        if data is None:
            continue
        if data.startswith(ALERT):
            raise NotTrusted("the server encrypts: name its certificate with tls=")
        if not data:
            raise ConnectionLost(
                "the server has closed the connection before its answer to hello: is this the port "
                "that it prints after `listen`?"
            )
        received += data
        received = received.lstrip(b"\r\n")
        # The answer is JSON. What follows it is in the encoding that was asked for.
        line, newline, rest = received.partition(b"\n")
        for message in wire.Splitter("json").push(line + newline):
            if "error" in message:
                raise Refused.of(message["error"], "hello")
            if "ok" in message:
                return decode(Hello, message["ok"]), rest
            raise ProtocolError("the server sent an event before its answer to hello")
    raise TimedOut(f"hello: no answer for {timeout} s")
