"""Which arrays each topic of a recording gives, and how they are collected.

The names are those of docs/api.md. A field of a field has both names: `timing.age_us` is
`timing_age_us`. What belongs to a joint is named as in `hbot.arrays`: `joint_angle`.
"""

from __future__ import annotations

import json
import math
import sys
from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy

from ..events import read_event

Array: TypeAlias = "numpy.ndarray[Any, Any]"
Kind: TypeAlias = Literal["real", "whole", "text", "object"]

EVENT = "/hbot/event"
EXACT = "/hbot/exact"
STATE = "/hbot/state"


@dataclass(frozen=True)
class Field:
    """One array of a topic."""

    name: str
    kind: Kind
    get: Callable[[Any], Any]
    """Returns the value of a message: a number, or as many as the array is wide."""
    width: int | Literal["joints"] | None = None
    """Length of the second axis. None: there is none."""


def _vector(v: Any) -> tuple[float, ...]:
    return (v.x, v.y, v.z)


def _quaternion(q: Any) -> tuple[float, ...]:
    """Return the order of docs/api.md. Messages of a recording have w last."""
    return (q.w, q.x, q.y, q.z)


_NO_QUATERNION = (math.nan,) * 4


def _reference(state: Any) -> tuple[float, ...]:
    return _quaternion(state.reference) if state.HasField("reference") else _NO_QUATERNION


def _seq(state: Any) -> float:
    known = state.HasField("client") and state.client.HasField("seq")
    return float(state.client.seq) if known else math.nan


def _age(state: Any) -> float:
    return float(state.client.age_ticks) if state.HasField("client") else math.nan


def _lead(state: Any) -> float:
    """Return 0 for a recording that is older than this field."""
    return float(getattr(state.timing, "lead_us", 0.0))


def _frame(name: str) -> Callable[[Any], tuple[float, ...]]:
    """Return the function that finds the orientation of a frame."""

    def get(message: Any) -> tuple[float, ...]:
        for transform in message.transforms:
            if transform.child_frame_id == name:
                return _quaternion(transform.rotation)
        return _NO_QUATERNION

    return get


def event_of(message: Any) -> Any:
    """Return the event as clients receive it, or its fields if this package does not know it."""
    fields = json.loads(message.message)
    return read_event(fields) or fields


_TORQUE = (
    Field("torque", "real", lambda m: _vector(m.sphere), 3),
    Field("joint_torque", "real", lambda m: m.joints, "joints"),
)

TOPICS: dict[str, tuple[Field, ...]] = {
    STATE: (
        Field("tick", "whole", lambda m: m.tick),
        Field("mode", "text", lambda m: m.mode),
        Field("fault", "text", lambda m: m.fault),
        Field("q", "real", lambda m: _quaternion(m.q), 4),
        Field("omega", "real", lambda m: _vector(m.omega), 3),
        Field("reference", "real", _reference, 4),
        Field("torque", "real", lambda m: _vector(m.torque), 3),
        Field("joint_angle", "real", lambda m: m.joint_angle, "joints"),
        Field("joint_rate", "real", lambda m: m.joint_rate, "joints"),
        Field("joint_torque", "real", lambda m: m.joint_torque, "joints"),
        Field("slip", "real", lambda m: m.slip),
        Field("scale", "real", lambda m: m.scale),
        Field("traction", "real", lambda m: m.traction),
        Field("energy", "real", lambda m: m.energy),
        Field("client_seq", "real", _seq),
        Field("client_age_ticks", "real", _age),
        Field("timing_lateness_us", "real", lambda m: m.timing.lateness_us),
        Field("timing_compute_us", "real", lambda m: m.timing.compute_us),
        Field("timing_link_us", "real", lambda m: m.timing.link_us),
        Field("timing_age_us", "real", lambda m: m.timing.age_us),
        Field("timing_lead_us", "real", _lead),
    ),
    "/hbot/joints": (
        Field("angle", "real", lambda m: m.position, "joints"),
        Field("rate", "real", lambda m: m.velocity, "joints"),
        Field("torque", "real", lambda m: m.effort, "joints"),
    ),
    "/tf": (
        Field("sphere", "real", _frame("sphere"), 4),
        Field("reference", "real", _frame("reference"), 4),
    ),
    "/hbot/torque": _TORQUE,
    "/hbot/torque/other": _TORQUE,
    EVENT: (Field("event", "object", event_of),),
    "/hbot/scene": (
        Field("tick", "whole", lambda m: m.tick),
        Field("name", "text", lambda m: m.name),
        Field("scene", "object", lambda m: json.loads(m.json) if m.json else None),
    ),
}
"""The arrays of each topic besides `log_time` and `t`, which all have."""


class Column:
    """Collects the values of one array. Numbers take eight bytes each from the beginning."""

    def __init__(self, field: Field, joints: int) -> None:
        """Create an empty column for a rig with so many joints."""
        self.field = field
        self._width = joints if field.width == "joints" else field.width
        code = {"real": "d", "whole": "q"}.get(field.kind)
        self._values: Any = [] if code is None else array(code)

    def add(self, message: Any) -> None:
        """Take the value of a message.

        Raises:
            ValueError: it has another number of values.
        """
        value = self.field.get(message)
        if self._width is None:
            self._values.append(sys.intern(value) if self.field.kind == "text" else value)
            return
        if len(value) != self._width:
            raise ValueError(f"{self.field.name} has {len(value)} values, not {self._width}")
        self._values.extend(value)

    def array(self) -> Array:
        """Return the values as an array. Numbers are not copied."""
        if self.field.kind == "object":
            values = numpy.empty(len(self._values), dtype=object)
            values[:] = self._values
            return values
        if self.field.kind == "text":
            return numpy.array(self._values, dtype=numpy.str_)
        values = numpy.asarray(self._values)
        return values if self._width is None else values.reshape(-1, self._width)


class Topic:
    """Collects the messages of one topic."""

    def __init__(self, name: str, joints: int) -> None:
        """Create an empty topic for a rig with so many joints."""
        self.log_times = array("q")
        self._columns = [Column(field, joints) for field in TOPICS[name]]

    def add(self, log_time: int, message: Any) -> None:
        """Take a message."""
        self.log_times.append(log_time)
        for column in self._columns:
            column.add(message)

    def arrays(self, start_ns: int) -> dict[str, Array]:
        """Return the arrays of the topic. Tick 0 was at the Unix time `start_ns`."""
        log_time = numpy.asarray(self.log_times)
        arrays = {"log_time": log_time, "t": (log_time - start_ns) * 1e-9}
        return arrays | {column.field.name: column.array() for column in self._columns}


def missing_steps(times: Sequence[int]) -> list[tuple[int, int]]:
    """Return where a series of times lacks some, if the shortest step is its period.

    Returns:
        The index of the first time after each gap, and the number of times that are missing there.
    """
    steps = numpy.diff(numpy.asarray(times, dtype=numpy.int64))
    if len(steps) == 0:
        return []
    missing = numpy.rint(steps / steps.min()).astype(int) - 1
    return [(int(k) + 1, int(missing[k])) for k in numpy.flatnonzero(missing)]
