"""Clients that attack the op `model`: each gets a clear error, and the loop does not notice."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, closing
from typing import Any

import pytest
from serving import PATIENCE_S, Server, eventually

import hbot

CROWD = 300
"""Connections that are tried at a time. The server takes 64."""
EACH = 200
"""Models that each of the crowd sends."""
PUSH = 0.02
"""Torque of the legal model, N m. So little that no limit of the prototype changes it."""


class Raw:
    """A connection that sends what no client of this package would."""

    def __init__(self, server: Server, name: str) -> None:
        """Connect and say hello."""
        host, port = server.address.split(":")
        self.socket = socket.create_connection((host, int(port)), timeout=PATIENCE_S)
        self._answers = self.socket.makefile("rb")
        self.hello = self.ask(f'{{"id":1,"op":"hello","version":1,"name":"{name}"}}')

    def close(self) -> None:
        """Close the connection."""
        self._answers.close()
        self.socket.close()

    def ask(self, line: str, repeated: int = 1) -> dict[str, Any]:
        """Send a line `repeated` times. Return the first message that is no event."""
        try:
            self.socket.sendall((line + "\n").encode() * repeated)
            while "event" in (message := json.loads(self._answers.readline())):
                pass
            return dict(message)
        except (OSError, ValueError):  # The server has closed the connection.
            return {"error": {"code": "closed", "message": ""}}


@pytest.fixture
def holder(server: Server) -> Iterator[hbot.Rig]:
    """Connect with the lease and an enabled rig, on which only a model acts."""
    with hbot.connect(server.address, name="holder") as rig, rig.lease():
        rig.load_scene({"name": "Nothing", "effect": []})
        rig.enable()
        eventually(lambda: next(rig.states()).mode == "active", "the rig is active")
        yield rig


def untouched(before: hbot.Stats, after: hbot.Stats) -> bool:
    """Return whether no tick was lost, and nothing stopped the rig."""
    same = ("dropped_samples", "missed_ticks", "corrupt_frames", "faults", "estops")
    return after.ticks > before.ticks and all(
        getattr(before, name) == getattr(after, name) for name in same
    )


def refusals(holder: hbot.Rig) -> set[str]:
    """Return why models of the holder were refused, but for being late, as on a busy machine."""
    events = [event for event in holder.events(0.0) if isinstance(event, hbot.RefusedEvent)]
    assert {event.code for event in events} <= {"busy", "out_of_range"}
    late = [event for event in events if "max_age_ticks" in event.message]
    assert all(event in late for event in events if event.code == "out_of_range")
    return {event.message for event in events if event not in late}


def test_a_crowd_without_the_lease_is_refused_while_a_model_acts(
    server: Server, holder: hbot.Rig
) -> None:
    before = holder.stats()
    with ExitStack() as stack:
        crowd = [stack.enter_context(closing(Raw(server, f"crowd {k}"))) for k in range(CROWD)]
        _attack(holder, before, crowd)
    eventually(lambda: can_connect(server), "the server has places again")


def can_connect(server: Server) -> bool:
    """Return whether the server takes a connection."""
    with closing(Raw(server, "again")) as raw:
        return "ok" in raw.hello


def _attack(holder: hbot.Rig, before: hbot.Stats, crowd: list[Raw]) -> None:
    served = [raw for raw in crowd if "ok" in raw.hello]
    assert 40 < len(served) < 64, "the server takes 64 connections, one of them is the holder's"
    turned_away = [raw.hello["error"]["code"] for raw in crowd if "ok" not in raw.hello]
    assert set(turned_away) <= {"busy", "closed"}
    model = '{"op":"model","torque":[0,0,9],"stiffness":50,"damping":1,"valid_ms":1000}'

    def flood(raw: Raw, pong: list[dict[str, Any]]) -> None:
        raw.ask(model + "\n" + '{"id":2,"op":"stats"}')
        pong.append(raw.ask(((model + "\n") * EACH) + '{"id":3,"op":"ping"}'))

    pongs: list[dict[str, Any]] = []
    threads = [threading.Thread(target=flood, args=(raw, pongs)) for raw in served]
    for thread in threads:
        thread.start()
    torques: list[float] = []
    states: list[hbot.State] = []

    def push(state: hbot.State) -> hbot.Model:
        states.append(state)
        if state.client is not None:
            torques.append(state.torque[2])
        return hbot.Model((0.0, 0.0, PUSH), damping=0.01, blend_ms=0, soften=True)

    holder.render(push, valid_ms=500, duration=2.0)
    for thread in threads:
        thread.join(PATIENCE_S)
    assert [pong.get("id") for pong in pongs] == [3] * len(served), "each was served to its end"
    after = holder.stats()
    refused = after.refused["not_holder"] - before.refused.get("not_holder", 0)
    assert refused == len(served) * (EACH + 1)
    assert refusals(holder) == set()
    assert {state.mode for state in states} == {"active"}
    # The model of the holder acts in every tick, and none of the 9 N m that the crowd asks for.
    assert max(torques) < 2 * PUSH
    assert untouched(before, after), (before, after)


def test_eight_models_in_a_tick_are_one_too_many_and_none_waits_long(
    virtual_server: Server,
) -> None:
    """The loop takes seven orders in a tick, and 32 may wait: at most five ticks."""
    with hbot.connect(virtual_server.address) as holder, holder.lease():
        holder.advance(1)
        holder.load_scene({"name": "Nothing", "effect": []})
        holder.enable()
        state = holder.advance(1000)
        before, ages = holder.stats(), []
        for sent in range(100):
            for k in range(8):
                holder.model(
                    100,
                    torque=(0, 0, PUSH),
                    damping=0.01,
                    tick=state.tick,
                    seq=8 * sent + k,
                    wait=False,
                )
            state = holder.advance(1)
            assert state.client is not None
            ages.append(state.client.age_ticks)
        assert 4 <= max(ages) <= 5, ages
        begun = holder.ping().tick
        holder.disable()
        assert holder.ping().tick - begun <= 5, "a disable does not wait longer than they"
        holder.advance(10)
        assert refusals(holder) == {"op model: the loop has not yet taken what it was given before"}
        assert untouched(before, holder.stats()), (before, holder.stats())


ILLEGAL = [
    ('"stiffness":[[1,0.5,0],[0.4,1,0],[0,0,1]]', "bad_request", "symmetric matrix"),
    ('"damping":[[1,2,0],[2,1,0],[0,0,1]]', "bad_request", "eigenvalue"),
    ('"stiffness":-1', "bad_request", '"stiffness" is -1'),
    ('"planes":[{"normal":[1,0,0],"stiffness":-1}]', "bad_request", "planes[0].stiffness"),
    ('"stiffness":NaN', "bad_request", ""),
    ('"stiffness":[1,Infinity,1]', "bad_request", ""),
    ('"torque":[0,0,1e999]', "bad_request", ""),
    ('"stiffness":1e7', "bad_request", '"stiffness" is 10000000'),
    ('"pose":[0,0,0,0]', "bad_request", '"pose" has norm 0'),
    ('"stiffness":100000', "out_of_range", "it may shake the sphere"),
    ('"planes":[' + ",".join(["{}"] * 9) + "]", "bad_request", "at most 8"),
    ('"tick":4000000000', "out_of_range", "future"),
    ('"tick":0', "out_of_range", "max_age_ticks"),
    ('"stiffness":[' * 70 + "]" * 70, "bad_request", ""),
    ('"torque":[' + "0," * 4000 + "0]", "too_large", "2048"),
]


def test_illegal_models_are_named_and_leave_the_one_in_force(server: Server) -> None:
    with hbot.connect(server.address, name="watch") as watch:
        raw = Raw(server, "raw")
        for op in ("acquire", "enable"):
            assert "ok" in raw.ask(f'{{"id":2,"op":"{op}"}}')
        scene = '{"name":"Nothing","effect":[]}'
        assert "ok" in raw.ask(f'{{"id":3,"op":"load_scene","scene":{scene}}}')
        eventually(lambda: next(watch.states()).mode == "active", "the rig is active")
        before = watch.stats()
        legal = f'"torque":[0,0,{PUSH}],"damping":0.01,"blend_ms":0,"seq":7'
        for fields, code, said in ILLEGAL:
            assert "ok" in raw.ask(f'{{"id":4,"op":"model","valid_ms":1000,{legal}}}')
            answer = raw.ask(f'{{"id":5,"op":"model","valid_ms":1000,{fields}}}')
            assert answer.get("error", {}).get("code") == code, (fields[:60], answer)
            assert said in answer["error"]["message"], (fields[:60], answer)
            pong = watch.ping()
            state = next(state for state in watch.states() if state.tick > pong.tick + 1)
            assert (state.mode, state.client and state.client.seq) == ("active", 7)
        assert untouched(before, watch.stats())
        raw.close()
