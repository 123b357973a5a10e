"""What a program sees when its server ends, hangs, or is not there."""

from __future__ import annotations

import asyncio
import signal
import threading
import time

import pytest
from serving import PATIENCE_S, Server

import hbot
from hbot import connection
from hbot.wire import Encoding


def test_a_server_that_is_killed_ends_everything(own_server: Server, encoding: Encoding) -> None:
    with hbot.connect(own_server.address, name="me", encoding=encoding) as rig:
        rig.acquire()
        rig.enable()
        calls = 0

        def kill(state: hbot.State) -> list[float]:
            nonlocal calls
            calls += 1
            if calls == 10:
                own_server.kill()
            return [0.0, 0.0, 0.0]

        with pytest.raises(hbot.ConnectionLost):
            rig.render(kill)
        for use in (rig.ping, rig.estop, lambda: next(rig.states()), lambda: list(rig.events())):
            with pytest.raises(hbot.ConnectionLost):
                use()
    with pytest.raises(hbot.NoServer, match="Start a server with `hbot server`"):
        hbot.connect(own_server.address)


def test_a_lease_whose_server_has_ended_says_so(own_server: Server) -> None:
    rig = hbot.connect(own_server.address)
    with pytest.raises(hbot.ConnectionLost), rig.lease():
        own_server.kill()


def test_the_exception_of_a_block_is_not_hidden_by_a_lost_server(own_server: Server) -> None:
    rig = hbot.connect(own_server.address)
    with pytest.raises(RuntimeError, match="of the block"), rig.lease():
        own_server.kill()
        raise RuntimeError("of the block")


def test_a_call_that_waits_is_told(own_server: Server, encoding: Encoding) -> None:
    with hbot.connect(own_server.address, encoding=encoding, timeout=PATIENCE_S) as rig:
        own_server.signal(signal.SIGSTOP)
        killer = threading.Timer(0.3, own_server.kill)
        killer.start()
        with pytest.raises(hbot.ConnectionLost):
            rig.ping()
        killer.join()


def test_a_server_that_stops_says_why(own_server: Server) -> None:
    with hbot.connect(own_server.address) as rig:
        own_server.signal(signal.SIGTERM)
        events = []
        with pytest.raises(hbot.ConnectionLost) as caught:
            for event in rig.events():
                events.append(event)
        stopping = events[-1]
        assert isinstance(stopping, hbot.StoppingEvent)
        assert stopping.message in str(caught.value)


def test_a_server_that_hangs_is_noticed(
    own_server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A call times out first. After a longer silence the connection counts as lost."""
    monkeypatch.setattr(connection, "SILENCE_S", 3.0)
    with hbot.connect(own_server.address, timeout=0.5) as rig:
        own_server.signal(signal.SIGSTOP)
        with pytest.raises(hbot.TimedOut, match="ping: no answer"):
            rig.ping()
        with pytest.raises(hbot.ConnectionLost, match="silent"):
            list(rig.events())
        own_server.signal(signal.SIGCONT)


SILENT_S = 3.0
"""Timeout of a connection whose server hangs. A second wait of as long is told apart from it."""


@pytest.mark.parametrize("use", ["states", "render"])
def test_without_a_state_the_exception_comes_after_the_time_that_it_names(
    own_server: Server, use: str
) -> None:
    """Neither the end of the subscription nor that of the lease waits for the server again."""
    began = 0.0

    def stop(_state: hbot.State) -> None:
        nonlocal began
        if began == 0.0:
            own_server.signal(signal.SIGSTOP)
            began = time.monotonic()

    with hbot.connect(own_server.address, timeout=SILENT_S) as rig:
        with pytest.raises(hbot.TimedOut, match=r"no state for 3\.0 s"), rig.lease():
            if use == "render":
                rig.render(stop)
            for state in rig.states():
                stop(state)
        assert SILENT_S <= time.monotonic() - began < 2.0 * SILENT_S


def test_aio_without_a_state_the_exception_comes_after_the_time_that_it_names(
    own_server: Server,
) -> None:
    async def main() -> None:
        began = 0.0
        async with hbot.aio.connect(own_server.address, timeout=SILENT_S) as rig:
            with pytest.raises(hbot.TimedOut, match=r"no state for 3\.0 s"):
                async with rig.lease():
                    async for _state in rig.states():
                        if began == 0.0:
                            own_server.signal(signal.SIGSTOP)
                            began = time.monotonic()
            assert SILENT_S <= time.monotonic() - began < 2.0 * SILENT_S

    asyncio.run(main())


def test_a_late_answer_goes_to_nobody(own_server: Server) -> None:
    with hbot.connect(own_server.address, timeout=0.5) as rig:
        own_server.signal(signal.SIGSTOP)
        with pytest.raises(hbot.TimedOut):
            rig.ping("late")
        own_server.signal(signal.SIGCONT)
        assert rig.ping("in time").data == "in time"


def test_a_connection_that_is_closed_says_so(server: Server) -> None:
    rig = hbot.connect(server.address)
    assert list(rig.events(-1.0)) == []  # A moment that has passed is no error.
    waiting: list[Exception] = []

    def wait() -> None:
        try:
            list(rig.events())
        except hbot.HbotError as error:
            waiting.append(error)

    threads = [threading.Thread(target=wait, daemon=True) for _ in range(3)]
    for thread in threads:
        thread.start()
    rig.close()
    rig.close()
    for thread in threads:
        thread.join(PATIENCE_S)
    assert ["this program has closed" in str(error) for error in waiting] == [True] * 3
    with pytest.raises(hbot.ConnectionLost, match="this program has closed"):
        rig.ping()


def test_aio_a_server_that_is_killed_ends_everything(
    own_server: Server, encoding: Encoding
) -> None:
    async def main() -> None:
        async with hbot.aio.connect(own_server.address, encoding=encoding) as rig:
            await rig.acquire()
            with pytest.raises(hbot.ConnectionLost):
                async for state in rig.states():
                    if state.tick > 10:
                        own_server.kill()
            with pytest.raises(hbot.ConnectionLost):
                await rig.ping()
            with pytest.raises(hbot.ConnectionLost):
                async for _event in rig.events():
                    pass

    asyncio.run(main())
