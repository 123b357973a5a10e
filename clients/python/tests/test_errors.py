"""Every error code of the server arrives as its own exception, in both encodings."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from serving import SCENES, Server

import hbot
from hbot import arrays, wire
from hbot.lsl import streams
from hbot.wire import Encoding


@pytest.fixture
def rig(server: Server, encoding: Encoding) -> Iterator[hbot.Rig]:
    """Connect to the shared server."""
    with hbot.connect(server.address, name="me", encoding=encoding) as rig:
        yield rig


def test_bad_request(rig: hbot.Rig) -> None:
    with rig.lease(), pytest.raises(hbot.BadRequest, match="q") as caught:
        rig.reference("spring", q=[1, 0, 0])
    assert (caught.value.code, caught.value.op) == ("bad_request", "reference")
    assert isinstance(caught.value, hbot.HbotError)


def test_bad_request_names_the_mistakes_of_a_scene(rig: hbot.Rig) -> None:
    effect = {"id": "spring", "kind": "spring", "stifness": 1}
    with rig.lease(), pytest.raises(hbot.BadRequest, match="stifness"):
        rig.load_scene({"name": "Wrong", "effect": [effect]})


def test_unsupported_version(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wire, "VERSION", 99)
    with pytest.raises(hbot.UnsupportedVersion):
        hbot.connect(server.address)


def test_unauthorized_and_both_forms_of_a_token(tmp_path: Path, encoding: Encoding) -> None:
    (tmp_path / "token").write_text("a token that is long enough\n")
    server = Server(tmp_path, api='token_file = "token"')
    try:
        for token in (None, "wrong"):
            with pytest.raises(hbot.Unauthorized):
                hbot.connect(server.address, token=token, encoding=encoding)
        hbot.connect(server.address, token="a token that is long enough").close()
        hbot.connect(server.address, token=tmp_path / "token", encoding=encoding).close()
    finally:
        server.kill()


def test_not_holder(rig: hbot.Rig) -> None:
    with pytest.raises(hbot.NotHolder) as caught:
        rig.enable()
    take = "take it with `rig.lease()` (not_holder)"
    assert str(caught.value) == f"enable: this client does not hold the lease: {take}"
    with pytest.raises(hbot.NotHolder, match="does not hold the lease"):
        rig.render(lambda _state: [0.0, 0.0, 0.0])


def test_not_holder_says_who_has_taken_the_lease(server: Server, rig: hbot.Rig) -> None:
    with rig.lease(), hbot.connect(server.address, name="thief") as thief:
        for steal in ("steal=True", ""):  # The thief holds the lease, and then nobody does.
            if steal:
                thief.acquire(steal=True)
            else:
                thief.release()
            with pytest.raises(hbot.NotHolder) as caught:
                rig.set("spring", stiffness=1.0)
            take = f"take it with `rig.lease({steal})` (not_holder)"
            assert str(caught.value) == f"set: thief has taken the lease: {take}"
            assert caught.value.holder == ("thief" if steal else None)
            with pytest.raises(hbot.NotHolder) as caught:
                rig.reference("spring", q=[1, 0, 0, 0], wait=False)
            assert str(caught.value) == f"reference: thief has taken the lease: {take}"
            assert caught.value.holder == ("thief" if steal else None)
        with hbot.connect(server.address, name="heir") as heir, heir.lease():
            with pytest.raises(hbot.NotHolder) as caught:
                rig.set("spring", stiffness=1.0)
            take = "take it with `rig.lease(steal=True)` (not_holder)"
            state = "thief has taken the lease, and heir holds it now"
            assert str(caught.value) == f"set: {state}: {take}"
            assert caught.value.holder == "heir"


def test_not_holder_names_the_holder(server: Server, rig: hbot.Rig) -> None:
    with (
        hbot.connect(server.address, name="first") as first,
        first.lease(),
        pytest.raises(hbot.NotHolder, match=r"^load_scene: first holds the lease: ") as caught,
    ):
        rig.load_scene({"name": "Nothing", "effect": []})
    assert caught.value.holder == "first"


def test_busy_names_the_holder(server: Server, rig: hbot.Rig) -> None:
    with hbot.connect(server.address, name="first") as first, first.lease():
        with pytest.raises(hbot.Busy) as caught, rig.lease():
            pass
        assert caught.value.holder == "first"
        with rig.lease(steal=True):
            assert rig.refresh().lease.holder == "me"


def test_unknown_effect(rig: hbot.Rig) -> None:
    with rig.lease(), pytest.raises(hbot.UnknownEffect):
        rig.set("no_such_effect", stiffness=1.0)


def test_a_number_that_is_not_finite_is_named(rig: hbot.Rig) -> None:
    told = 'stiffness is nan; every number must be finite|"stiffness" is NaN'
    with rig.lease(), pytest.raises((ValueError, hbot.BadRequest), match=told):
        rig.set("spring", damping=0.01, stiffness=float("nan"))


def test_out_of_range(rig: hbot.Rig) -> None:
    with rig.lease(), pytest.raises(hbot.OutOfRange):
        rig.torque([0, 0, 0], valid_ms=20, tick=10**9)


def test_out_of_range_of_enable_has_the_angle(rig: hbot.Rig) -> None:
    """A spring whose reference is a half turn away."""
    far = {"id": "s", "kind": "spring", "anchor": "absolute", "reference": [0, 1, 0, 0]}
    with rig.lease():
        rig.load_scene({"name": "Far", "effect": [far]})
        with pytest.raises(hbot.OutOfRange) as caught:
            rig.enable()
    assert caught.value.angle is not None
    assert caught.value.angle > rig.info.limits.enable_max_angle


def test_faulted(rig: hbot.Rig) -> None:
    with rig.lease():
        rig.estop()
        with pytest.raises(hbot.Faulted) as caught:
            rig.enable()
        assert str(caught.value) == "enable: the rig was stopped: reset first (faulted)"
        rig.reset()


def test_too_large(rig: hbot.Rig) -> None:
    """The answer has no id. It must still reach the call that was too long."""
    with pytest.raises(hbot.TooLarge) as caught:
        rig.ping("x" * 3000)
    assert caught.value.op == "ping"
    assert rig.ping("short").data == "short"


def test_a_code_of_a_later_server_is_a_refusal() -> None:
    refused = hbot.Refused.of({"code": "new", "message": "why"}, "ping")
    assert (type(refused), refused.code, str(refused)) == (hbot.Refused, "new", "ping: why (new)")


def test_what_is_not_installed_is_named(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    uses: dict[str, tuple[str, Callable[[], object]]] = {
        "msgpack": ("msgpack", lambda: hbot.connect(server.address, encoding="msgpack")),
        "numpy": ("numpy", lambda: arrays.columns([])),
        "pylsl": ("lsl", streams.library),
    }
    for package, (extra, use) in uses.items():
        monkeypatch.setitem(sys.modules, package, None)
        with pytest.raises(hbot.MissingExtra) as caught:
            use()
        assert f"`pip install './clients/python[{extra}]'`" in str(caught.value)
    monkeypatch.setitem(sys.modules, "tomllib", None)
    monkeypatch.setitem(sys.modules, "tomli", None)
    with (
        hbot.connect(server.address) as rig,
        rig.lease(),
        pytest.raises(hbot.MissingExtra, match="pip install tomli"),
    ):
        rig.load_scene(SCENES / "spring.toml")


def test_arguments_that_are_not_legal() -> None:
    with pytest.raises(ValueError, match="the port is '99999'"):
        hbot.connect("127.0.0.1:99999")
    with pytest.raises(hbot.NoServer, match="Start a server with `hbot server`"):
        hbot.connect("127.0.0.1:1")
