"""Local models: a torque, and how it changes as the sphere turns (docs/api.md, "Models")."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from .checks import finite

Impedance = float | Iterable[float] | Iterable[Iterable[float]]
"""A number, one for each axis of frame N, or the rows of a symmetric 3x3 matrix."""


@dataclass(frozen=True, slots=True)
class Plane:
    """A half-space of turns that pushes the sphere back, such as a contact. It never pulls."""

    normal: Iterable[float]
    """Axis in frame N about which a turn leads into it."""
    offset: float
    """Turn from the model's pose at which it begins, rad. Negative: the pose is inside."""
    stiffness: float
    """N m/rad."""
    damping: float = 0.0
    """N m s/rad, inside."""


@dataclass(frozen=True, slots=True)
class Model:
    """The torque T = torque - stiffness * turn - damping * omega - planes, near a pose.

    The server renders it in every tick until it expires or the next model comes. All vectors are in
    frame N.
    """

    torque: Iterable[float] = (0.0, 0.0, 0.0)
    """Torque at the pose, N m."""
    stiffness: Impedance = 0.0
    """N m/rad."""
    damping: Impedance = 0.0
    """N m s/rad."""
    pose: Iterable[float] | None = None
    """Quaternion about which the stiffness acts. None: that of the state with the number `tick`."""
    planes: Sequence[Plane] = ()
    """At most eight half-spaces."""
    blend_ms: int | None = None
    """Time in which the torque of before blends into this one, 0 to 200 ms.

    None: the time since the last model, at most 50 ms.
    """
    soften: bool = False
    """Render a model that the loop does not keep stable with less stiffness, not refuse it."""

    def fields(self) -> dict[str, Any]:
        """Return the fields of the message.

        Raises:
            TypeError: a value is of another type.
            ValueError: a number is not finite.
        """
        fields: dict[str, Any] = {
            "torque": finite("torque", self.torque),
            "stiffness": _impedance("stiffness", self.stiffness),
            "damping": _impedance("damping", self.damping),
        }
        if self.pose is not None:
            # All digits: the server takes a unit quaternion as it is.
            fields["pose"] = finite("pose", self.pose)
        if isinstance(self.planes, Plane):
            raise TypeError("planes is one hbot.Plane; legal: a list of them")
        if len(self.planes) > 0:
            fields["planes"] = [_plane(plane) for plane in self.planes]
        if self.blend_ms is not None:
            fields["blend_ms"] = self.blend_ms
        if self.soften:
            fields["soften"] = True
        return fields


def _short(numbers: list[float]) -> list[float]:
    """Round to nine digits, so that a model with eight planes fits into a message."""
    return [float(f"{number:.9g}") for number in numbers]


def _impedance(name: str, value: Impedance) -> float | list[float] | list[list[float]]:
    if isinstance(value, str):
        raise TypeError(f"{name} is the text {value!r}; legal: a number, 3 of them, or 3 rows of 3")
    if not isinstance(value, Iterable):
        return finite(name, [value])[0]
    rows = list(value)
    if any(isinstance(row, Iterable) for row in rows):
        return [_short(finite(name, row)) for row in rows if isinstance(row, Iterable)]
    return _short(finite(name, rows))  # type: ignore[arg-type]


def _plane(plane: Plane) -> dict[str, Any]:
    if not isinstance(plane, Plane):
        raise TypeError(f"planes has {plane!r}; legal: a list of hbot.Plane")
    offset, stiffness, damping = _short(
        finite("plane", [plane.offset, plane.stiffness, plane.damping])
    )
    normal = _short(finite("normal", plane.normal))
    return {"normal": normal, "offset": offset, "stiffness": stiffness, "damping": damping}
