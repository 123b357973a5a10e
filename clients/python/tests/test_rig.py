"""The blocking client against the real server, in both encodings."""

from __future__ import annotations

import itertools
import json
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import create_autospec

import msgpack
import pytest
from serving import PATIENCE_S, RATE_HZ, SCENES, Server, eventually

import hbot
from hbot import connection as connection_module
from hbot import rig as rig_module
from hbot import turns
from hbot.arrays import columns
from hbot.wire import Encoding

DAMPING = 0.01  # N m s/rad
NAMED = (hbot.LeaseEvent, hbot.SceneEvent, hbot.FaultEvent)  # Events that name who asked.


def damper(state: hbot.State) -> list[float]:
    """Return the torque of a damper, N m."""
    return [-DAMPING * rate for rate in state.omega]


@pytest.fixture
def rig(server: Server, encoding: Encoding) -> Iterator[hbot.Rig]:
    """Connect to the shared server."""
    with hbot.connect(server.address, name="me", encoding=encoding) as rig:
        yield rig


def test_the_contract(rig: hbot.Rig) -> None:
    assert rig.info.rig.name == "Hbot prototype"
    assert rig.info.clock is not None
    assert rig.info.clock.unix_ns > 1.7e18, "a time in this century"
    with rig.lease(steal=False):
        loaded = rig.load_scene(SCENES / "spring.toml")
        assert [effect.kind for effect in loaded.effects] == ["spring"]
        assert rig.enable() in ("enabling", "active")
        rig.set("spring", stiffness=2.0)
        rig.reference("spring", q=[1, 0, 0, 0])
        states = list(rig.states(every=5, duration=0.4))
        assert {later.tick - state.tick for state, later in itertools.pairwise(states)} == {5}
        assert len(states) == RATE_HZ * 0.4 / 5
        done = rig.render(damper, every=1, valid_ms=20, duration=0.3)
        assert 0 < done.calls <= done.calls + done.skipped <= RATE_HZ * 0.3
    assert rig.refresh().scene["effect"][0]["stiffness"] == 2.0
    assert rig.estop() == "estop"
    assert rig.ping({"n": [1, 2.5]}).data == {"n": [1, 2.5]}
    stats = rig.stats()
    assert stats.estops >= 1
    assert stats.compute_us.count > 0


def test_the_motor_controllers_report(rig: hbot.Rig) -> None:
    controllers = rig.controllers()
    assert [controller.joint for controller in controllers] == [0, 1, 2, 3]
    for controller in controllers:
        assert controller.protocol == "hbot"
        assert controller.port == "sim"
        assert controller.id is None, "hbot's own protocol has no ids"
        assert controller.firmware is not None
        assert controller.firmware.startswith("hbot-sim ")
        assert controller.temperature_c == 25.0, "what the simulated firmware sends"
        assert controller.flags == ()


def test_a_state_has_the_structure_of_the_rig(rig: hbot.Rig) -> None:
    state = next(rig.states())
    assert len(state.q) == 4
    assert sum(part * part for part in state.q) == pytest.approx(1.0, abs=1e-9)  # rounding of JSON
    assert len(state.joints) == 2 * len(rig.info.rig.wheels)
    assert state.t == pytest.approx(state.tick / RATE_HZ, rel=1e-12)  # rounding of a product
    assert state.timing.compute_us > 0.0
    assert state.reference == (1.0, 0.0, 0.0, 0.0)


def test_a_scene_can_be_a_map_and_arrays_can_be_sent(rig: hbot.Rig) -> None:
    numpy = pytest.importorskip("numpy", reason="the extra numpy is installed in CI")
    spring = {"id": "s", "kind": "spring", "stiffness": numpy.eye(3), "anchor": "here"}
    with rig.lease():
        loaded = rig.load_scene({"name": "From Python", "effect": [spring]})
        assert [effect.id for effect in loaded.effects] == ["s"]
        rig.reference("s", q=numpy.array([1.0, 0.0, 0.0, 0.0]), omega=(0.0, 0.0, 0.1))
        rig.enable()
        rig.render(lambda state: numpy.array(state.omega) * -DAMPING, duration=0.1)
        assert rig.align(next(rig.states()).q, weight=0.0) < 0.5


def test_measurements_with_a_sigma_make_the_uncertainty_known(rig: hbot.Rig) -> None:
    with rig.lease():
        state = next(rig.states())
        # The shared server keeps the uncertainty that an earlier test has made known.
        found = rig.align(state.q, sigma=(0.1, 0.1, 0.1), t=state.t)
        assert found < 0.1
        assert found.used
        far = turns.times(turns.exp((3.0, 0.0, 0.0)), state.q)
        assert not rig.align(far, sigma=(1e-3, 1e-3, 1e-3)).used
        assert rig.align_direction((0, 0, -1), (0, 0, -2), sigma=3.0) < 3.2
        sigma = next(rig.states()).orientation_sigma
        assert sigma is not None
        assert all(0.0 < x < 0.2 for x in sigma)


def test_states_become_arrays(rig: hbot.Rig) -> None:
    numpy = pytest.importorskip("numpy", reason="the extra numpy is installed in CI")
    states = list(rig.states(duration=0.1))
    arrays = columns(states)
    assert arrays["q"].shape == (RATE_HZ // 10, 4)
    assert arrays["joint_torque"].shape == (RATE_HZ // 10, 4)
    assert numpy.all(numpy.diff(arrays["tick"]) == 1)
    assert arrays["mode"][0] == "idle"
    assert arrays["joint_angle"][-1, 3] == states[-1].joints[3].angle


def test_an_error_about_arguments_names_the_method(rig: hbot.Rig) -> None:
    call: Any = rig.enable
    with pytest.raises(TypeError, match=r"^Rig\.enable\(\) takes 1 positional argument"):
        call(3)


def test_printing_a_rig_says_what_it_is_and_does(rig: hbot.Rig) -> None:
    assert str(rig) == "Hbot prototype (SIMULATED): idle, scene 'Spring'"
    with rig.lease():
        rig.load_scene("clay")
        rig.estop()
        assert str(rig) == "Hbot prototype (SIMULATED): estop, scene 'Clay'"
        incident = rig.info.incident
        assert incident is not None
        assert incident.by is not None
        assert incident.by.name == "me"
        rig.reset()
        assert rig.refresh().incident is None
    rig.close()
    assert str(rig) == "Hbot prototype (SIMULATED): idle, scene 'Clay'"


def test_info_is_a_snapshot_until_it_is_refreshed(rig: hbot.Rig) -> None:
    before = rig.info
    with rig.lease():
        rig.load_scene(SCENES / "compass.toml")
        assert rig.info is before
        assert rig.info.scene["name"] == "Spring"
        assert rig.refresh().scene["name"] == "Compass"
        assert rig.info.scene["name"] == "Compass"


def test_the_lease_is_given_back_after_an_exception(rig: hbot.Rig) -> None:
    with pytest.raises(RuntimeError, match="of the block"), rig.lease():
        assert rig.refresh().lease.session == rig.hello.session
        raise RuntimeError("of the block")
    assert rig.refresh().lease.holder is None


def test_events_come_by_iteration(rig: hbot.Rig) -> None:
    with rig.lease():
        rig.load_scene(SCENES / "compass.toml")
        rig.estop()
    kinds = {hbot.LeaseEvent, hbot.SceneEvent, hbot.FaultEvent}
    events = []
    for event in rig.events():
        events.append(event)
        kinds.discard(type(event))
        if not kinds:
            break
    scene = next(event for event in events if isinstance(event, hbot.SceneEvent))
    assert scene.name == rig.refresh().scene["name"]
    fault = next(event for event in events if isinstance(event, hbot.FaultEvent))
    assert (fault.mode, fault.fault) == ("estop", None)
    assert "me" in fault.message


def test_events_name_who_asked(server: Server, rig: hbot.Rig) -> None:
    me = hbot.Requester("me", rig.hello.session)
    with hbot.connect(server.address, name="other") as other:
        rig.acquire()
        rig.load_scene(SCENES / "compass.toml")
        other.estop()
        rig.reset()
        rig.release()
        stopper = hbot.Requester("other", other.hello.session)
    wanted = [(hbot.LeaseEvent, me), (hbot.SceneEvent, me), (hbot.FaultEvent, stopper)]
    wanted += [(hbot.FaultEvent, me), (hbot.LeaseEvent, me)]
    named = (event for event in rig.events(duration=20.0) if isinstance(event, NAMED))
    assert [(type(event), event.by) for event in itertools.islice(named, 5)] == wanted


def test_events_come_by_a_callback_however_slow_it_is(server: Server, encoding: Encoding) -> None:
    events, go_on = [], threading.Event()

    def slow(event: hbot.Event) -> None:
        assert go_on.wait(PATIENCE_S)
        events.append(event)

    with hbot.connect(server.address, name="me", encoding=encoding, on_event=slow) as rig:
        with rig.lease():  # The first event blocks the callback.
            rig.ping()
            rig.enable()
        assert not events
        go_on.set()
        eventually(lambda: len(events) >= 2, "both lease events")
        assert isinstance(events[0], hbot.LeaseEvent)
        assert events[0].cause == "acquired"
        with pytest.raises(ValueError, match="on_event"):
            next(rig.events())


def test_a_callback_that_raises_is_logged_and_gets_the_next_event(
    server: Server, encoding: Encoding, caplog: pytest.LogCaptureFixture
) -> None:
    events: list[hbot.Event] = []

    def wrong(event: hbot.Event) -> None:
        events.append(event)
        if len(events) == 1:
            raise RuntimeError("of the callback")

    with hbot.connect(server.address, name="me", encoding=encoding, on_event=wrong) as rig:
        with rig.lease():
            pass
        eventually(lambda: len(events) == 2, "the second event comes after the exception")
    (record,) = (record for record in caplog.records if record.name == "hbot")
    assert "on_event" in record.getMessage()
    assert record.exc_info is not None
    assert "of the callback" in str(record.exc_info[1])


def test_what_a_slow_program_loses_is_counted_and_told(
    rig: hbot.Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rig_module, "MAX_STATES", 5)
    states = rig.states()
    first = next(states)
    eventually(lambda: rig.lost.states >= 20, "20 states are lost")
    later = next(states)
    assert later.tick - first.tick > 15
    told = [event for event in rig.events(0.0) if isinstance(event, hbot.LostEvent)]
    assert told
    assert told[0].states >= 1
    assert rig.ping("still there").data == "still there"


def test_the_oldest_events_are_dropped_and_counted(
    server: Server, encoding: Encoding, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rig_module, "MAX_EVENTS", 3)
    with hbot.connect(server.address, name="me", encoding=encoding) as rig:
        for _ in range(4):
            with rig.lease():
                pass
        eventually(lambda: rig.lost.events >= 5, "events are lost")
        assert len(list(rig.events(0.0))) == 3


def test_a_second_iteration_replaces_the_first(rig: hbot.Rig) -> None:
    first = rig.states()
    next(first)
    second = rig.states(every=7)
    ticks = [next(second).tick, next(second).tick]
    assert ticks[1] - ticks[0] == 7
    with pytest.raises(hbot.SubscriptionTaken, match="replaced"):
        list(first)
    assert next(second).tick - ticks[1] == 7, "the end of the first does not end the second"


def test_the_subscription_ends_with_the_iteration(
    rig: hbot.Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    for _state in rig.states():
        break
    heard: list[object] = []
    monkeypatch.setattr(rig._connection, "_take", heard.append)
    time.sleep(10 / RATE_HZ)  # Its subject is time: ten ticks.
    assert not heard, "no state comes any more"


def test_many_threads_can_use_one_connection(rig: hbot.Rig) -> None:
    wrong: list[object] = []

    def work(number: int) -> None:
        for count in range(50):
            data = rig.ping([number, count]).data
            if data != [number, count]:
                wrong.append(data)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE_S)
        assert not thread.is_alive()
    assert not wrong


def test_a_refused_stream_message_comes_as_an_event(rig: hbot.Rig) -> None:
    rig.torque([0, 0, 0], valid_ms=20, wait=False)
    event = next(event for event in rig.events() if isinstance(event, hbot.RefusedEvent))
    assert (event.op, event.code) == ("torque", "not_holder")


def test_a_stream_message_that_is_too_long_is_not_sent(rig: hbot.Rig, encoding: Encoding) -> None:
    """The server could not tell which message it refuses, because it does not read the id."""
    with rig.lease():
        fits = 2048 - len(rig._connection._encode({"op": "hand", "data": "x" * 1000})) + 1000
        for more in (0, 1):
            data = "x" * (fits + more + (4 if encoding == "msgpack" else 0))
            if more:
                with pytest.raises(hbot.TooLarge, match="2049 bytes; legal: at most 2048"):
                    rig._connection.post("hand", {"data": data})
            else:
                rig._connection.post("hand", {"data": data})
            assert rig.set("spring", stiffness=1.0).warnings == ()


def test_a_stream_message_is_not_sent_late(rig: hbot.Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """A connection that takes no bytes makes `wait=False` drop the message instead of waiting."""
    with rig.lease():
        monkeypatch.setattr(rig._connection._transport, "writable", lambda: False)
        rig.torque([0, 0, 0], valid_ms=20, wait=False)
        assert rig.lost.sends == 1
        monkeypatch.undo()
    assert [event for event in rig.events(0.0) if isinstance(event, hbot.LostEvent)]


def test_a_silent_connection_is_kept_by_a_heartbeat(
    rig: hbot.Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = rig.stats().requests
    assert connection_module.HEARTBEAT_S == 1.0
    time.sleep(2.5)  # Its subject is time: two heartbeats.
    assert rig.stats().requests - before >= 3, "two heartbeats and the second stats"


def test_a_scene_file_that_is_not_toml_is_named(rig: hbot.Rig, tmp_path: Path) -> None:
    (tmp_path / "wrong.toml").write_text("name = ")
    with pytest.raises(ValueError, match=r"wrong\.toml: Invalid value"):
        rig.load_scene(tmp_path / "wrong.toml")


def raw_info(address: str) -> object:
    """Return the answer to `info` as the real server sends it."""
    host, _, port = address.rpartition(":")
    with socket.create_connection((host, int(port))) as peer, peer.makefile("rw") as lines:
        lines.write(
            '{"id": 0, "op": "hello", "version": 1, "name": "raw"}\n{"id": 1, "op": "info"}\n'
        )
        lines.flush()
        answers = (json.loads(line) for line in lines)
        return next(answer["ok"] for answer in answers if answer.get("id") == 1)


def test_events_that_arrive_with_the_answer_to_hello_are_not_lost(
    server: Server, encoding: Encoding
) -> None:
    """A server of this test sends the answer, an event and the start of another in one piece."""
    info = raw_info(server.address)
    hello = {"server": "s", "version": 1, "rig": "r", "rate_hz": 1000.0, "session": 1}
    event = {"event": "lease", "holder": "b", "session": 2, "cause": "acquired"}

    def wire(message: object) -> bytes:
        if encoding == "json":
            return json.dumps(message).encode() + b"\n"
        body = msgpack.packb(message)
        return len(body).to_bytes(4, "big") + bytes(body)

    def serve(listener: socket.socket) -> None:
        peer, _ = listener.accept()
        peer.recv(4096)
        second = wire(event)
        answer = json.dumps({"id": 0, "ok": hello}).encode() + b"\n"
        peer.sendall(answer + wire(event) + second[:9])
        peer.recv(4096)  # The request `info`, which has the id 1.
        peer.sendall(second[9:] + wire({"id": 1, "ok": info}))
        peer.recv(4096)
        peer.close()

    with socket.create_server(("127.0.0.1", 0)) as listener:
        threading.Thread(target=serve, args=(listener,), daemon=True).start()
        address = f"127.0.0.1:{listener.getsockname()[1]}"
        with hbot.connect(address, name="early", encoding=encoding) as rig:
            found = list(itertools.islice(rig.events(duration=20.0), 2))
    assert [event.holder for event in found if isinstance(event, hbot.LeaseEvent)] == ["b", "b"]


def test_a_mock_of_a_rig_takes_what_a_rig_takes() -> None:
    rig = create_autospec(hbot.Rig, instance=True)
    rig.enable()
    rig.torque([0.0, 0.0, 0.0], 10)
    with pytest.raises(TypeError, match="valid_mss"):
        rig.torque([0.0, 0.0, 0.0], 10, valid_mss=10)
