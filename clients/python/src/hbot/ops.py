"""Every request of the API as a value: its op, its fields, and how its answer is read.

`Rig` sends these requests and waits; `aio.Rig` sends them and awaits. docs/api.md, "Ops", describes
each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from .answers import Changed, Controller, Controllers, Loaded, Pong, Stats
from .decode import decode
from .events import Mode
from .info import Info
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


def _numbers(name: str, values: Iterable[float]) -> list[float]:
    """Return the values of the parameter `name` as plain numbers, also those of an array.

    Raises:
        TypeError: the parameter is a text, whose digits would count as numbers.
        ValueError: a value is not finite.
    """
    if isinstance(values, str):
        raise TypeError(f"{name} is the text {values!r}; legal: a list of numbers")
    numbers = [float(value) for value in values]
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"{name} is {numbers}; every number must be finite")
    return numbers


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
    numbers = _numbers("torque", torque)
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
    turning = None if omega is None else _numbers("omega", omega)
    fields = _given(
        effect=effect, q=_numbers("q", q), omega=turning, valid_ms=valid_ms, tick=tick, seq=seq
    )
    return Request("reference", fields, _none)


def align(q: Iterable[float], weight: float, t: float | None = None) -> Request[float]:
    """Correct the server's orientation by a measured one."""
    return Request(
        "align", _given(q=_numbers("q", q), weight=weight, t=t), lambda body: float(body["angle"])
    )


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
        q=_numbers("q", q), over_ms=over_ms, stiffness=stiffness, damping=damping, inertia=inertia
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


def ping(data: Any) -> Request[Pong]:
    """Test the connection."""
    return Request("ping", _given(data=data), lambda body: decode(Pong, body))
