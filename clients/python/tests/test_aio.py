"""The client for asyncio against the real server, in both encodings."""

from __future__ import annotations

import asyncio
import itertools
import time
from collections.abc import Awaitable, Callable
from typing import TypeAlias

import pytest
from serving import PATIENCE_S, RATE_HZ, SCENES, Server

import hbot
from hbot import aio as aio_module
from hbot.wire import Encoding

Body: TypeAlias = Callable[[hbot.aio.Rig], Awaitable[None]]
Run: TypeAlias = Callable[[Body], None]


@pytest.fixture
def run(server: Server, encoding: Encoding) -> Run:
    """Return a function that runs a coroutine with a connection to the shared server."""

    def run(body: Body) -> None:
        async def main() -> None:
            async with hbot.aio.connect(server.address, name="me", encoding=encoding) as rig:
                await asyncio.wait_for(body(rig), 2 * PATIENCE_S)

        asyncio.run(main())

    return run


def test_the_contract(run: Run) -> None:
    async def body(rig: hbot.aio.Rig) -> None:
        assert rig.info.rig.name == "Hbot prototype"
        async with rig.lease(steal=False):
            await rig.load_scene(SCENES / "spring.toml")
            assert await rig.enable() in ("enabling", "active")
            await rig.set("spring", stiffness=2.0)
            await rig.reference("spring", q=[1, 0, 0, 0])
            await rig.torque([0, 0, 0], valid_ms=20)
            states = [state async for state in rig.states(every=5, duration=0.4)]
            assert {later.tick - state.tick for state, later in itertools.pairwise(states)} == {5}
            assert len(states) == RATE_HZ * 0.4 / 5
            assert await rig.align(states[-1].q, 0.0) < 0.5
            assert await rig.align(states[-1].q, sigma=(1, 1, 1)) < 3.2
            assert await rig.align_direction((0, 0, 1), (0, 0, 1), 3.0) < 3.2
            done = await rig.render(lambda state: [-0.01 * w for w in state.omega], duration=0.3)
            assert 0 < done.calls <= done.calls + done.skipped <= RATE_HZ * 0.3
            assert await rig.disable() in ("active", "idle", "enabling")
        assert (await rig.refresh()).lease.holder is None
        assert await rig.estop() == "estop"
        assert (await rig.ping({"n": 1})).data == {"n": 1}
        assert (await rig.stats()).estops >= 1
        assert [controller.joint for controller in await rig.controllers()] == [0, 1, 2, 3]
        async with rig.lease():
            assert await rig.reset() == "idle"

    run(body)


def test_render_takes_a_coroutine_function(run: Run) -> None:
    async def body(rig: hbot.aio.Rig) -> None:
        async def damper(state: hbot.State) -> list[float]:
            await asyncio.sleep(0)
            return [-0.01 * w for w in state.omega]

        async with rig.lease():
            await rig.enable()
            done = await rig.render(damper, duration=0.2)
        assert done.calls > 0

    run(body)


def test_a_refusal_is_an_exception(run: Run) -> None:
    async def body(rig: hbot.aio.Rig) -> None:
        with pytest.raises(hbot.NotHolder):
            await rig.enable()
        with pytest.raises(RuntimeError, match="of the block"):
            async with rig.lease():
                raise RuntimeError("of the block")
        assert (await rig.refresh()).lease.holder is None
        with pytest.raises(hbot.TooLarge):
            await rig.ping("x" * 3000)

    run(body)


def test_a_lease_that_is_stolen_ends_a_render(server: Server, run: Run) -> None:
    async def body(rig: hbot.aio.Rig) -> None:
        async with hbot.aio.connect(server.address, name="thief") as thief, rig.lease():
            await rig.enable()
            stolen = False

            async def steal_once(_state: hbot.State) -> list[float]:
                nonlocal stolen
                if not stolen:
                    stolen = True
                    await thief.acquire(steal=True)
                return [0.0, 0.0, 0.0]

            said = r"thief has taken the lease: take it with `rig\.lease\(steal=True\)`"
            with pytest.raises(hbot.NotHolder, match=said):
                await rig.render(steal_once)
        events = [event async for event in rig.events(0.0)]
        causes = [event.cause for event in events if isinstance(event, hbot.LeaseEvent)]
        assert causes[:2] == ["acquired", "stolen"]

    run(body)


def test_an_iteration_can_be_left_and_begun_again(run: Run) -> None:
    """The end of an asynchronous iteration that was left comes late. It must not end the next."""

    async def body(rig: hbot.aio.Rig) -> None:
        for every in (1, 2, 3):
            ticks = []
            async for state in rig.states(every=every):
                ticks.append(state.tick)
                if len(ticks) == 3:
                    break
            assert ticks[2] - ticks[0] == 2 * every

    run(body)


def test_a_busy_event_loop_does_not_stop_the_reading(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(aio_module, "MAX_STATES", 5)

    async def body(rig: hbot.aio.Rig) -> None:
        states = rig.states()
        first = await anext(states)
        until = time.monotonic() + PATIENCE_S
        while rig.lost.states < 20:  # The event loop does nothing else.
            assert time.monotonic() < until
        later = await anext(states)
        assert later.tick - first.tick > 15
        events = [event async for event in rig.events(0.0)]
        assert any(isinstance(event, hbot.LostEvent) for event in events)

    run(body)


def test_events_come_by_a_callback(server: Server, encoding: Encoding) -> None:
    async def main() -> None:
        events: list[hbot.Event] = []
        rig = await hbot.aio.connect(
            server.address, name="me", encoding=encoding, on_event=events.append
        )
        async with rig.lease():
            pass
        until = time.monotonic() + PATIENCE_S
        while len(events) < 2 and time.monotonic() < until:
            await asyncio.sleep(0.01)
        causes = [event.cause for event in events if isinstance(event, hbot.LeaseEvent)]
        assert causes == ["acquired", "released"]
        with pytest.raises(ValueError, match="on_event"):
            await anext(rig.events())
        await rig.close()
        with pytest.raises(hbot.ConnectionLost):
            await rig.ping()

    asyncio.run(main())


def test_a_callback_that_raises_is_logged_and_gets_the_next_event(
    server: Server, encoding: Encoding, caplog: pytest.LogCaptureFixture
) -> None:
    async def main() -> None:
        events: list[hbot.Event] = []

        def wrong(event: hbot.Event) -> None:
            events.append(event)
            if len(events) == 1:
                raise RuntimeError("of the callback")

        async with hbot.aio.connect(server.address, encoding=encoding, on_event=wrong) as rig:
            async with rig.lease():
                pass
            until = time.monotonic() + PATIENCE_S
            while len(events) < 2:
                assert time.monotonic() < until, "no event comes after the exception"
                await asyncio.sleep(0.01)

    asyncio.run(main())
    (record,) = (record for record in caplog.records if record.name == "hbot")
    assert record.exc_info is not None
    assert "of the callback" in str(record.exc_info[1])


def test_refused_torques_are_counted(run: Run) -> None:
    """A function so slow that its state is older than the rig allows, when its torque arrives."""

    async def body(rig: hbot.aio.Rig) -> None:
        late_s = 1.5 * rig.info.limits.max_age_ticks / RATE_HZ

        async def slow(_state: hbot.State) -> list[float]:
            await asyncio.sleep(late_s)  # Its subject is time: the age of a state.
            return [0.0, 0.0, 0.0]

        async with rig.lease():
            await rig.enable()
            done = await rig.render(slow, duration=2 * late_s)
        events = [event async for event in rig.events(0.0)]
        refused = [event for event in events if isinstance(event, hbot.RefusedEvent)]
        assert 1 <= done.refused <= done.calls
        assert done.refused == refused[-1].total

    run(body)


def test_many_coroutines_can_use_one_connection(run: Run) -> None:
    async def body(rig: hbot.aio.Rig) -> None:
        pongs = await asyncio.gather(*(rig.ping(number) for number in range(200)))
        assert [pong.data for pong in pongs] == list(range(200))

    run(body)


def test_no_server_is_an_exception() -> None:
    async def main() -> None:
        with pytest.raises(hbot.NoServer):
            await hbot.aio.connect("127.0.0.1:1")

    asyncio.run(main())
