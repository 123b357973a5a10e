"""Every request of the API as a value: its op, its fields, and how its answer is read.

`Rig` sends these requests and waits; `aio.Rig` sends them and awaits. docs/api.md, "Ops", describes
each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from .answers import Changed, Controller, Controllers, Loaded, Pong, Stats
from .checks import finite
from .decode import decode
from .events import Mode, State
from .info import Info
from .models import Model
from .scenes import Explain, Scene, open_scene

T = TypeVar("T")


def _as_it_is(error: Exception) -> Exception:
    return error


@dataclass(frozen=True, slots=True)
class Request(Generic[T]):
    """A request whose answer is a `T`."""

    op: str
    fields: dict[str, Any]
    read: Callable[[Any], T]
    explain: Explain = _as_it_is


def _none(_body: Any) -> None:
    return None


def _mode(body: Any) -> Mode:
    return body["mode"]  # type: ignore[no-any-return]


def _given(**fields: Any) -> dict[str, Any]:
    """Return the fields that are not None."""
    return {name: value for name, value in fields.items() if value is not None}


def info() -> Request[Info]:
    """Describe the rig, what it can do, and what runs."""
    return Request("info", {}, lambda body: decode(Info, body))


def subscribe(every: int) -> Request[None]:
    """Ask for a state every `every` ticks."""
    return Request("subscribe", {"every": every}, _none)


def unsubscribe() -> Request[None]:
    """End the subscription."""
    return Request("unsubscribe", {}, _none)


def stats() -> Request[Stats]:
    """Ask how long things took, and how often events happened."""
    return Request("stats", {}, lambda body: decode(Stats, body))


def controllers() -> Request[tuple[Controller, ...]]:
    """Ask what the motor controllers report about themselves."""
    return Request("controllers", {}, lambda body: decode(Controllers, body).controllers)


def acquire(steal: bool) -> Request[None]:
    """Take the lease."""
    return Request("acquire", {"steal": steal}, _none)


def release() -> Request[None]:
    """Give the lease back."""
    return Request("release", {}, _none)


def load_scene(scene: Scene) -> Request[Loaded]:
    """Replace the scene."""
    fields, explain = open_scene(scene)
    return Request("load_scene", {"scene": fields}, lambda body: decode(Loaded, body), explain)


def change(effect: str, parameters: dict[str, Any]) -> Request[Changed]:
    """Change parameters of an effect."""
    fields = {"effect": effect, **parameters}
    return Request("set", fields, lambda body: decode(Changed, body))


def torque(
    torque: Iterable[float], valid_ms: int, tick: int | None = None, seq: int | None = None
) -> Request[None]:
    """Stream a torque.

    Raises:
        ValueError: the torque is not three finite numbers.
    """
    numbers = finite("torque", torque)
    if len(numbers) != 3:
        raise ValueError(f"the torque has {len(numbers)} numbers; legal: 3")
    fields = _given(torque=numbers, valid_ms=valid_ms, tick=tick, seq=seq)
    return Request("torque", fields, _none)


def reference(
    effect: str,
    q: Iterable[float],
    omega: Iterable[float] | None = None,
    valid_ms: int | None = None,
    tick: int | None = None,
    seq: int | None = None,
) -> Request[None]:
    """Move the reference of an effect."""
    turning = None if omega is None else finite("omega", omega)
    fields = _given(
        effect=effect, q=finite("q", q), omega=turning, valid_ms=valid_ms, tick=tick, seq=seq
    )
    return Request("reference", fields, _none)


def model(
    model: Model, valid_ms: int, tick: int | None = None, seq: int | None = None
) -> Request[float]:
    """Stream a local model."""
    fields = {**model.fields(), **_given(valid_ms=valid_ms, tick=tick, seq=seq)}
    return Request("model", fields, lambda body: float(body["stiffness_scale"]))


def align(
    q: Iterable[float],
    weight: float | None = None,
    t: float | None = None,
    sigma: Iterable[float] | None = None,
) -> Request[float]:
    """Correct the server's orientation by a measured one."""
    fields = _given(
        q=finite("q", q),
        weight=weight,
        sigma=None if sigma is None else finite("sigma", sigma),
        t=t,
    )
    return Request("align", fields, lambda body: float(body["angle"]))


def align_direction(
    body: Iterable[float], world: Iterable[float], sigma: float, t: float | None = None
) -> Request[float]:
    """Correct the server's orientation by a measured direction."""
    fields = _given(body=finite("body", body), world=finite("world", world), sigma=sigma, t=t)
    return Request("align_direction", fields, lambda answer: float(answer["angle"]))


def hand(
    q: Iterable[float] | None,
    over_ms: int | None = None,
    stiffness: float | None = None,
    damping: float | None = None,
    inertia: float | None = None,
) -> Request[None]:
    """Move the simulated hand, or let it go."""
    if q is None:
        return Request("hand", {"release": True}, _none)
    fields = _given(
        q=finite("q", q), over_ms=over_ms, stiffness=stiffness, damping=damping, inertia=inertia
    )
    return Request("hand", fields, _none)


def enable() -> Request[Mode]:
    """Begin to render."""
    return Request("enable", {}, _mode)


def disable() -> Request[Mode]:
    """End rendering."""
    return Request("disable", {}, _mode)


def reset() -> Request[Mode]:
    """Leave a fault or an emergency stop."""
    return Request("reset", {}, _mode)


def estop() -> Request[Mode]:
    """Stop the motors."""
    return Request("estop", {}, _mode)


def advance(ticks: int) -> Request[State]:
    """Let virtual time pass."""
    return Request("advance", {"ticks": ticks}, lambda body: decode(State, body))


def ping(data: Any) -> Request[Pong]:
    """Test the connection."""
    return Request("ping", _given(data=data), lambda body: decode(Pong, body))
