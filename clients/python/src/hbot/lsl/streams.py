"""The two streams of the Lab Streaming Layer."""

from __future__ import annotations

import threading
from typing import Any

from ..errors import MissingExtra
from ..events import (
    DroppedEvent,
    Event,
    FaultEvent,
    LeaseEvent,
    LostEvent,
    SceneEvent,
    SetEvent,
    State,
    StoppingEvent,
)
from ..info import Info

SAMPLES = "Hbot"
MARKERS = "HbotMarkers"

_VECTORS = {
    "q": (("w", "x", "y", "z"), "1"),
    "omega": (("n1", "n2", "n3"), "rad/s"),
    "torque": (("n1", "n2", "n3"), "N m"),
}


def library() -> Any:
    """Return the package pylsl.

    Raises:
        MissingExtra: it is not installed, or it finds no library of LSL.
    """
    try:
        import pylsl
    except (ImportError, RuntimeError) as missing:
        raise MissingExtra.of("hbot.lsl", "lsl", missing) from missing
    return pylsl


def channels(info: Info) -> list[tuple[str, str]]:
    """Return name and unit of each channel of the stream of states."""
    names = [("tick", "1"), ("t", "s")]
    for name, (parts, unit) in _VECTORS.items():
        names += [(f"{name}.{part}", unit) for part in parts]
    names.append(("energy", "J"))
    for number, wheel in enumerate(info.rig.wheels):
        for joint in ("steer", "drive"):
            label = f"{wheel.name or chr(ord('A') + number)}.{joint}"
            names += [
                (f"{label}.angle", "rad"),
                (f"{label}.rate", "rad/s"),
                (f"{label}.torque", "N m"),
            ]
    return names


def sample(state: State) -> list[float]:
    """Return the values of the channels for one state."""
    values = [float(state.tick), state.t, *state.q, *state.omega, *state.torque, state.energy]
    for joint in state.joints:
        values += (joint.angle, joint.rate, joint.torque)
    return values


def marker(event: Event) -> str | None:
    """Return the text of the marker for an event. None: the event is not a marker."""
    match event:
        case FaultEvent(mode="fault"):
            return f"fault {event.fault}: {event.message}"
        case FaultEvent(mode="estop"):
            return f"estop: {event.message}"
        case FaultEvent():
            return f"reset: {event.mode}"
        case SceneEvent():
            return f"scene {event.name}"
        case SetEvent():
            values = ", ".join(f"{name} = {value}" for name, value in event.parameters.items())
            return f"set {event.effect}: {values}"
        case LeaseEvent(holder=None):
            return f"lease {event.cause}"
        case LeaseEvent():
            return f"lease {event.cause} by {event.holder}"
        case StoppingEvent():
            return f"stopping: {event.message}"
        case DroppedEvent():
            return f"dropped: {event.total} states so far, by the server"
        case LostEvent():
            return f"lost: {event.states} states so far, by this program"
    return None


class Outlets:
    """Both outlets. Programs that listen see them until this object is gone."""

    def __init__(self, address: str, info: Info, every: int) -> None:
        """Offer the streams of the rig at `address`, with a sample every `every` ticks."""
        pylsl = library()
        self.channels = channels(info)
        rate = info.rig.rate_hz / every
        source = f"hbot-{address}"
        stream = pylsl.StreamInfo(
            SAMPLES, "Haptics", len(self.channels), rate, pylsl.cf_double64, source
        )
        described = stream.desc().append_child("channels")
        for name, unit in self.channels:
            channel = described.append_child("channel")
            channel.append_child_value("label", name)
            channel.append_child_value("unit", unit)
        stream.desc().append_child_value("rig", info.rig.name)
        markers = pylsl.StreamInfo(
            MARKERS, "Markers", 1, pylsl.IRREGULAR_RATE, pylsl.cf_string, f"{source}-markers"
        )
        self._samples = pylsl.StreamOutlet(stream)
        self._markers = pylsl.StreamOutlet(markers)
        self._lock = threading.Lock()
        self.now = pylsl.local_clock

    def push(self, state: State, offset: float) -> None:
        """Publish a state. `offset` is the time of tick 0 on LSL's clock, s."""
        self._samples.push_sample(sample(state), offset + state.t)

    def mark(self, text: str, time: float | None = None) -> None:
        """Publish a marker, at a time on LSL's clock, s (None: now). Any thread may call this."""
        with self._lock:
            self._markers.push_sample([text], self.now() if time is None else time)
