"""`render` of the blocking client against the real server, in both encodings."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any, cast

import pytest
from serving import RATE_HZ, Server, running

import hbot
from hbot import rig as rig_module
from hbot.rendering import Rendering
from hbot.wire import Encoding

DAMPING = 0.01  # N m s/rad


def damper(state: hbot.State) -> Sequence[float]:
    """Return the torque of a damper, N m."""
    torque: hbot.Vector = -DAMPING * state.omega
    return torque


@pytest.fixture
def rig(server: Server, encoding: Encoding) -> Iterator[hbot.Rig]:
    """Connect to the shared server."""
    with hbot.connect(server.address, name="me", encoding=encoding) as rig:
        yield rig


def test_the_age_of_a_torque_is_counted_from_the_state_it_was_computed_from(rig: hbot.Rig) -> None:
    streams = []

    def remember(state: hbot.State) -> Sequence[float]:
        if state.client is not None and state.client.seq is not None:
            streams.append((state.tick, state.client))
        return [0.0, 0.0, 0.0]

    with rig.lease():
        rig.enable()
        rig.render(remember, duration=0.5)
    assert len(streams) > 10
    for tick, stream in streams:
        assert stream.seq == tick - stream.age_ticks, "render numbers a torque by its state's tick"
        # A torque cannot be in force in the tick from which it was computed.
        assert stream.age_ticks >= 1


@pytest.mark.parametrize("kind", ["torque", "model"])
def test_what_comes_from_an_older_state_is_as_old_as_that_state(rig: hbot.Rig, kind: str) -> None:
    """A function that answers with the torque of the state before, as a worker in a thread does."""
    before: list[hbot.State] = []
    ages = []

    def late(state: hbot.State) -> hbot.Computed | None:
        if state.client is not None and state.client.seq is not None:
            ages.append(state.client.age_ticks)
        before.append(state)
        if len(before) <= 10:
            return None
        old = before[-11]
        made = -DAMPING * old.omega if kind == "torque" else hbot.Model(damping=DAMPING)
        return hbot.Computed(made, old.tick)

    with rig.lease():
        rig.enable()
        rig.render(late, duration=0.5)
    assert len(ages) > 10
    assert min(ages) >= 11


def test_a_rig_that_is_not_enabled_is_one_warning(
    rig: hbot.Rig, caplog: pytest.LogCaptureFixture
) -> None:
    def warnings() -> list[str]:
        return [record.getMessage() for record in caplog.records if record.name == "hbot"]

    with rig.lease():
        rig.render(damper, duration=0.2)
        (warning,) = warnings()
        assert "mode idle" in warning
        assert "rig.enable()" in warning
        rig.enable()
        rig.render(damper, duration=0.2)
    assert warnings() == [warning], "an enabled rig is no reason for a warning"


def test_a_torque_of_none_sends_nothing(rig: hbot.Rig) -> None:
    with rig.lease():
        rig.enable()
        requests = rig.stats().requests
        done = rig.render(lambda _state: None, duration=0.2)
        assert done.calls > 0
        # The two stats are 1; subscribe and unsubscribe are 2.
        assert rig.stats().requests - requests == 3


def test_a_torque_that_is_no_number_is_an_error(rig: hbot.Rig) -> None:
    with rig.lease():
        rig.enable()
        with pytest.raises(ValueError, match="finite"):
            rig.render(lambda _state: [float("nan"), 0.0, 0.0])


def test_a_lease_that_is_stolen_ends_a_render(server: Server, rig: hbot.Rig) -> None:
    with hbot.connect(server.address, name="thief") as thief, rig.lease():
        rig.enable()

        def steal_once(state: hbot.State) -> Sequence[float]:
            if rig_holds(rig):
                thief.acquire(steal=True)
            return damper(state)

        with pytest.raises(hbot.NotHolder, match="thief has taken the lease") as caught:
            rig.render(steal_once)
        assert caught.value.holder == "thief"
    stolen = [event for event in rig.events(0.0) if isinstance(event, hbot.LeaseEvent)]
    assert "stolen" in [event.cause for event in stolen]


def rig_holds(rig: hbot.Rig) -> bool:
    """Return whether the connection holds the lease, as far as it has heard."""
    return rig._connection.holds_lease


def test_a_stop_by_another_client_ends_a_render(server: Server, rig: hbot.Rig) -> None:
    with hbot.connect(server.address, name="other") as other, rig.lease():
        rig.enable()

        def stop_once(state: hbot.State) -> Sequence[float]:
            other.estop()
            return damper(state)

        with pytest.raises(hbot.Faulted, match="estop"):
            rig.render(stop_once)


def render_slowly(rig: hbot.Rig) -> hbot.Rendered:
    """Render for 1 s with a function that needs 0.1 s for each torque."""

    def slow(state: hbot.State) -> Sequence[float]:
        time.sleep(0.1)  # Its subject is time: 25 ticks.
        return damper(state)

    with rig.lease():
        rig.enable()
        done = rig.render(slow, duration=1.0)
    assert done.calls + done.skipped + done.dropped == RATE_HZ, "no state is unaccounted for"
    return done


def test_a_slow_function_gets_the_newest_state(rig: hbot.Rig) -> None:
    done = render_slowly(rig)
    assert 9 * (done.calls - 2) <= done.skipped, "at most one of ten ticks is rendered"


def test_states_that_find_no_room_are_counted_as_skipped(
    rig: hbot.Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rig_module, "MAX_STATES", 3)
    render_slowly(rig)
    assert rig.lost.states > 0, "the mailbox was full"


def test_a_skipped_state_leaves_the_last_torque_in_force(rig: hbot.Rig) -> None:
    """A function that stalls for less than `valid_ms` leaves no tick without its torque."""
    push = 0.02  # N m: a hundredth of what the prototype makes, so no limit changes it.
    stall_s = 0.1
    ticks: list[tuple[int, float]] = []

    def stalls(state: hbot.State) -> Sequence[float]:
        ticks.append((state.tick, state.torque[2]))
        if len(ticks) % 20 == 0:
            time.sleep(stall_s)  # Its subject is time: 25 ticks.
        return [0.0, 0.0, push]

    with rig.lease():
        rig.load_scene({"name": "Nothing", "effect": []})
        rig.enable()
        for state in running(rig.states()):
            if state.mode == "active":
                break
        done = rig.render(stalls, valid_ms=1000, duration=1.0)
        rig.disable()
    assert done.skipped > 0, "the stalls skip states"
    settled = [torque for tick, torque in ticks if tick - ticks[0][0] > RATE_HZ // 10]
    assert len(settled) > 10
    # The allocation and the encoding of JSON round.
    assert all(torque == pytest.approx(push, rel=1e-6) for torque in settled), settled


def test_states_before_the_first_call_are_not_skipped_by_it(rig: hbot.Rig) -> None:
    """The function was not at work yet, and the duration begins with the first state it gets."""
    with rig.lease():
        state = next(rig.states())
        rendering = Rendering(rig._connection, every=1, valid_ms=20, duration=None)
        assert rendering.goes_on(state, skipped=3)
        assert rendering.result.skipped == 0
        rendering.send(state, None)
        assert rendering.goes_on(state, skipped=2)
        assert rendering.result.skipped == 2


def test_refused_torques_are_counted(rig: hbot.Rig, caplog: pytest.LogCaptureFixture) -> None:
    """A function so slow that its state is older than the rig allows, when its torque arrives."""
    late_s = 1.5 * rig.info.limits.max_age_ticks / RATE_HZ

    def slow(_state: hbot.State) -> Sequence[float]:
        time.sleep(late_s)  # Its subject is time: the age of a state.
        return [0.0, 0.0, 0.0]

    with rig.lease():
        rig.enable()
        done = rig.render(slow, duration=2 * late_s)
        refused = [event for event in rig.events(0.0) if isinstance(event, hbot.RefusedEvent)]
        assert 1 <= done.refused <= done.calls
        assert done.refused == refused[-1].total
        assert "max_age_ticks" in refused[-1].message
        (told,) = [line for line in caplog.messages if "refused messages" in line]
        assert "max_age_ticks" in told
        again = rig.render(damper, duration=0.2)
        assert again.refused + done.refused <= done.calls + 1, "an earlier refusal counts once"


def test_a_torque_of_two_numbers_is_refused_before_it_is_sent(server: Server) -> None:
    with hbot.connect(server.address, name="two") as rig, rig.lease():
        with pytest.raises(ValueError, match="2 numbers"):
            rig.torque([0.01, 0.02], valid_ms=20)
        with pytest.raises(ValueError, match="2 numbers"):
            rig.render(lambda state: [0.01, 0.02], duration=1.0)


def test_a_text_in_place_of_numbers_is_refused_before_it_is_sent(server: Server) -> None:
    """The digits of a text are three numbers, too."""
    text: Any = "123"
    with hbot.connect(server.address, name="text") as rig, rig.lease():
        with pytest.raises(TypeError, match="torque is the text '123'; legal: a list of numbers"):
            rig.torque(text, valid_ms=20)
        with pytest.raises(TypeError, match="torque is the text"):
            rig.render(lambda _state: text, duration=1.0)
        with pytest.raises(TypeError, match="q is the text"):
            rig.reference("spring", q=text)
        with pytest.raises(TypeError, match="omega is the text"):
            rig.reference("spring", q=[1.0, 0.0, 0.0, 0.0], omega=text)
        with pytest.raises(TypeError, match="q is the text"):
            rig.align(text, weight=1.0)
        with pytest.raises(TypeError, match="stiffness is the text"):
            rig.model(100, stiffness=text)


def test_values_of_another_type_are_refused_with_their_names(server: Server) -> None:
    number: Any = 0.5
    plane: Any = hbot.Plane((0.0, 0.0, 1.0), 0.1, stiffness=4.0)
    with pytest.raises(hbot.IllegalInput, match="the address is 4268; legal: a text"):
        hbot.connect(cast("Any", 4268))
    with pytest.raises(hbot.IllegalInput, match="legal: HOST or HOST:PORT, without http://"):
        hbot.connect("http://127.0.0.1:4269")
    with hbot.connect(server.address, name="types") as rig, rig.lease():
        with pytest.raises(TypeError, match=r"q is 0\.5; legal: a list of numbers"):
            rig.hand(number)
        with pytest.raises(TypeError, match=r"torque is 0\.5"):
            rig.render(lambda _state: number, duration=1.0)
        with pytest.raises(TypeError, match=r"planes is one hbot\.Plane"):
            rig.model(100, planes=plane)
        with pytest.raises(TypeError, match=r"planes has \{\}; legal: a list of hbot\.Plane"):
            rig.model(100, planes=cast("Any", [{}]))
