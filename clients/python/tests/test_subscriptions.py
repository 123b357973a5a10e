"""Two subscriptions on one connection whose server answers neither of them for a while."""

from __future__ import annotations

import gc
import signal
import threading
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from serving import PATIENCE_S, Server, eventually

import hbot
from hbot.connection import Connection, Options
from hbot.mailbox import Mailbox

EVERY = 7


class Iteration(threading.Thread):
    """Takes states in a thread until an exception, or until it has enough of them."""

    def __init__(self, rig: hbot.Rig, every: int) -> None:
        """Begin to iterate."""
        super().__init__()
        self.ticks: list[int] = []
        self.error: Exception | None = None
        self._states = rig.states(every)
        self.start()

    def run(self) -> None:
        """Take states."""
        try:
            for state in self._states:
                self.ticks.append(state.tick)
                if len(self.ticks) == 10:
                    return
        except hbot.HbotError as error:
            self.error = error


def requests(rig: hbot.Rig, count: int) -> Callable[[], bool]:
    """Return a condition: so many requests wait for an answer."""
    return lambda: len(rig._connection._pending) == count


@pytest.fixture
def two(own_server: Server) -> tuple[hbot.Rig, Iteration, Iteration]:
    """Begin two iterations while the server is stopped."""
    rig = hbot.connect(own_server.address, timeout=PATIENCE_S)
    own_server.signal(signal.SIGSTOP)
    first = Iteration(rig, every=1)
    eventually(requests(rig, 1), "the first has sent its request")
    second = Iteration(rig, every=EVERY)
    eventually(requests(rig, 2), "the second has sent its request")
    return rig, first, second


def test_the_second_ends_the_first_before_any_answer(
    own_server: Server, two: tuple[hbot.Rig, Iteration, Iteration]
) -> None:
    rig, first, second = two
    with rig:
        own_server.signal(signal.SIGCONT)
        first.join(PATIENCE_S)
        second.join(PATIENCE_S)
        assert isinstance(first.error, hbot.SubscriptionTaken)
        assert second.error is None
        assert len(second.ticks) == 10
        steps = {later - tick for tick, later in zip(second.ticks, second.ticks[1:], strict=False)}
        # A stopped server can drop states, but it never sends one between two of a subscription.
        assert all(step % EVERY == 0 for step in steps), steps
        assert all(tick % EVERY == 0 for tick in second.ticks), "no states of the first"


def test_a_lost_server_ends_both(
    own_server: Server, two: tuple[hbot.Rig, Iteration, Iteration]
) -> None:
    _, first, second = two
    own_server.kill()
    for iteration in (first, second):
        iteration.join(PATIENCE_S)
        assert isinstance(iteration.error, hbot.ConnectionLost | hbot.SubscriptionTaken)


def test_a_lost_server_ends_a_mailbox_without_an_answer(own_server: Server) -> None:
    connection = Connection(own_server.address, Options("me"))
    connection.start(Mailbox(1))
    own_server.signal(signal.SIGSTOP)
    states: Mailbox[hbot.State] = Mailbox(1)
    answers: list[Exception | None] = []
    fields = {"every": 1}
    connection.subscribe(states, "subscribe", fields, lambda _body, error: answers.append(error))
    own_server.kill()
    with pytest.raises(hbot.ConnectionLost):
        states.get(PATIENCE_S)
    assert isinstance(answers[0], hbot.ConnectionLost)


def test_the_end_of_the_first_sends_nothing(own_server: Server) -> None:
    with hbot.connect(own_server.address) as rig:
        first, second = rig.states(), rig.states(every=EVERY)
        next(first)
        next(second)
        before = rig.stats().requests
        del first  # CPython ends a generator with its last reference.
        assert rig.stats().requests == before + 1, "only stats itself"
        assert next(second)


class Collecting(dict[int, Any]):
    """A map from which nothing is taken without a run of the garbage collector."""

    def pop(self, *arguments: Any) -> Any:
        """Collect, and take."""
        gc.collect()
        return super().pop(*arguments)


@pytest.mark.parametrize("place", ["reader", "request", "send"])
def test_an_iteration_can_end_wherever_the_garbage_collector_runs(
    server: Server, place: str
) -> None:
    """In the thread that reads, and where a lock is held: that of requests, and that of sending."""
    with hbot.connect(server.address, timeout=PATIENCE_S) as rig:
        connection: Any = rig._connection
        take, line = connection._take, connection._transport._socket
        gc.disable()
        try:
            cycle = SimpleNamespace(states=rig.states())
            cycle.itself = cycle
            next(cycle.states)
            del cycle
            began = time.monotonic()
            if place == "reader":
                connection._take = lambda message: (gc.collect(), take(message))
            elif place == "request":
                connection._pending = Collecting()
            else:
                connection._transport._socket = SimpleNamespace(
                    sendall=lambda data: (gc.collect(), line.sendall(data)),
                    recv=line.recv,
                    shutdown=line.shutdown,
                    close=line.close,
                )
            rig.ping()
            assert time.monotonic() - began < PATIENCE_S / 2
            eventually(lambda: connection._subscriber is None, "the iteration has ended")
        finally:
            gc.enable()
