"""The events that a server sends by itself (docs/api.md, "Events").

Vectors are in the inertial frame N (gravity points along -n3), quaternions are `(w, x, y, z)` and
rotate sphere axes into N. Units are SI, unless the name of a field says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from .decode import decode
from .vectors import Vector

Quaternion: TypeAlias = tuple[float, float, float, float]

Mode: TypeAlias = Literal["unreferenced", "idle", "enabling", "active", "fault", "estop"]
Cause: TypeAlias = Literal[
    "link_lost",
    "link_corrupt",
    "controller_fault",
    "overspeed",
    "overtorque",
    "slip",
    "non_finite",
    "implausible_feedback",
    "deadline",
    "client_lost",
    "thermal",
]


@dataclass(frozen=True, slots=True)
class Joint:
    """One joint in one tick."""

    angle: float
    """Angle from the joint's zero, rad."""
    rate: float
    """Angular rate, rad/s."""
    torque: float
    """Commanded joint torque, N m."""


@dataclass(frozen=True, slots=True)
class Stream:
    """The last stream message that the loop has accepted."""

    seq: int | None
    """The message's own number. None if it had none."""
    age_ticks: int
    """Ticks since the tick that the message named, or since its arrival if it named none."""


@dataclass(frozen=True, slots=True)
class Timing:
    """How long the parts of one tick took, us."""

    lateness_us: float
    """From the deadline to the start of the tick, us."""
    compute_us: float
    """Computing time, us."""
    link_us: float
    """Time spent on the serial line, us."""
    age_us: float
    """From the sampling of the joints until the torque computed from it was sent, us."""
    lead_us: float = 0.0
    """By how much the scene was rendered ahead of its reading, us. 0 without a lead."""


@dataclass(frozen=True, slots=True)
class State:
    """The state of the rig in one tick. All fields belong to this tick."""

    tick: int
    """Number of the tick."""
    t: float
    """Time of the tick since the loop began, s."""
    mode: Mode
    """What the control law is doing."""
    fault: Cause | None
    """Cause of the fault. None unless the mode is `"fault"`."""
    q: Quaternion
    """Orientation of the sphere, unit norm. Its sign never jumps."""
    omega: Vector
    """Angular velocity of the sphere, rad/s."""
    reference: Quaternion | None
    """Orientation to which the first effect with a reference pulls.

    None if the scene has no such effect.
    """
    torque: Vector
    """Applied torque on the sphere after all limits, N m."""
    joints: tuple[Joint, ...]
    """Steer and drive of the first wheel, then of the next."""
    slip: float
    """Largest slip velocity at a contact that the encoders can show, m/s."""
    scale: float
    """Fraction of the wanted torque that is applied after all limits, 0 to 1."""
    traction: float
    """Largest tangential force at a contact as a fraction of what friction holds there, 0 to 1."""
    energy: float
    """Energy given to the hand since the start, J. Negative if more energy came in."""
    client: Stream | None
    """The last stream message that was accepted since the lease changed hands. None before it."""
    timing: Timing
    """How long the parts of the tick took."""
    hand: Vector | None = None
    """Torque of the simulated hand on the sphere, N m. None if no hand holds it, or it is real."""
    orientation_sigma: Vector | None = None
    """Standard deviations of the error of `q` about the axes of frame N, rad.

    None until a measurement with a sigma has been taken.
    """


@dataclass(frozen=True, slots=True)
class Requester:
    """Who asked for what an event reports."""

    name: str
    """Name of the client. `"SIGUSR1"` if that signal stopped the rig."""
    session: int | None
    """Number of the client's connection. None for a signal."""


@dataclass(frozen=True, slots=True)
class FaultEvent:
    """The rig went into a fault or an emergency stop, or left it."""

    tick: int
    """Number of the tick in which the mode changed."""
    t: float
    """Time of that tick since the loop began, s."""
    mode: Mode
    """Mode after the change."""
    fault: Cause | None
    """Cause of the fault. None except in mode `"fault"`."""
    message: str
    """Description for people."""
    by: Requester | None = None
    """Who stopped or reset the rig. None if the rig stopped by itself."""
    found: str | None = None
    """What was found about the fault, and where to look. None without a fault, as the next."""
    remedy: str | None = None
    """What to do about the fault on this rig before a reset."""
    flight_log: str | None = None
    """Path of the flight log about it, on the server's computer. None if there is none."""


@dataclass(frozen=True, slots=True)
class LeaseEvent:
    """The lease changed hands."""

    holder: str | None
    """Name of the client that has the lease now. None if it is free."""
    session: int | None
    """Number of that client's connection. None if the lease is free."""
    cause: Literal["acquired", "released", "stolen", "disconnected"]
    """Why the lease changed hands."""
    by: Requester | None = None
    """Who took the lease, gave it back, or lost it with the connection."""


@dataclass(frozen=True, slots=True)
class Effect:
    """An effect of a scene with its cost."""

    id: str
    """Id of the effect in the scene."""
    kind: str
    """Kind of the effect, such as `"spring"`."""
    cost_ns: int
    """Computing time of the effect in each tick, ns."""


@dataclass(frozen=True, slots=True)
class SceneEvent:
    """Another scene is rendered."""

    tick: int
    """First tick that renders the scene."""
    name: str
    """Name of the scene."""
    effects: tuple[Effect, ...]
    """Effects of the scene."""
    by: Requester | None = None
    """Who loaded the scene."""


@dataclass(frozen=True, slots=True)
class SceneWarning:
    """A warning about a scene, in the parts of which its sentence is made."""

    effect: str | None
    """Id of the effect. None if it is about no effect."""
    what: str
    """What it warns of."""
    why: str | None
    """Values that lead to it."""
    remedy: str | None
    """What to do about it, a sentence."""
    shakes: bool
    """Whether the scene may shake the sphere."""


@dataclass(frozen=True, slots=True)
class SetEvent:
    """Parameters of an effect have changed."""

    tick: int
    """First tick that renders the change."""
    effect: str
    """Id of the effect."""
    parameters: dict[str, Any]
    """New values by the names of the parameters."""
    warnings: tuple[str, ...]
    """Warnings about the changed scene."""
    by: Requester | None = None
    """Who changed them."""
    advice: tuple[SceneWarning, ...] = ()
    """The same warnings in parts."""


@dataclass(frozen=True, slots=True)
class DroppedEvent:
    """The server dropped states because this client read too slowly."""

    count: int
    """States dropped since the last event of this kind."""
    total: int
    """States dropped on this connection."""


@dataclass(frozen=True, slots=True)
class RefusedEvent:
    """The server refused stream messages of this client."""

    count: int
    """Messages refused since the last event of this kind."""
    total: int
    """Messages refused on this connection."""
    op: str | None
    """Op of the last refused message. None if it could not be read."""
    code: str
    """Error code of the last refusal."""
    message: str
    """Description of the last refusal for people."""


@dataclass(frozen=True, slots=True)
class ShakingEvent:
    """The sphere shakes by itself, or has its full torque again after it did."""

    tick: int
    """Tick in which this was found."""
    t: float
    """Time of that tick since the control loop began, s."""
    shaking: bool
    """Whether the sphere shakes and the torque is lowered."""
    frequency: float
    """Frequency of the shaking, Hz."""
    amplitude: float
    """Largest rate of the sphere about an axis of frame N, rad/s."""
    effect: str | None
    """Id of the effect that gives the most energy. None if it is not known."""
    gain: float
    """Fraction of the torque that was left when this was found, 0 to 1."""
    message: str
    """Description for people."""


@dataclass(frozen=True, slots=True)
class StoppingEvent:
    """The server ends. This is the last event of a connection."""

    message: str
    """Why the server ends."""


@dataclass(frozen=True, slots=True)
class LostEvent:
    """This program was too slow, so the client dropped what it had received.

    The server does not send this event.
    """

    states: int
    """States that `states()` did not take in time, on this connection."""
    events: int
    """Events that `events()` did not take in time, on this connection."""
    sends: int
    """Stream messages that were not sent because the connection took no more bytes."""


Event: TypeAlias = (
    FaultEvent
    | LeaseEvent
    | SceneEvent
    | SetEvent
    | DroppedEvent
    | RefusedEvent
    | ShakingEvent
    | StoppingEvent
    | LostEvent
)

EVENTS: Mapping[str, type[Any]] = {
    "state": State,
    "fault": FaultEvent,
    "lease": LeaseEvent,
    "scene": SceneEvent,
    "set": SetEvent,
    "dropped": DroppedEvent,
    "refused": RefusedEvent,
    "shaking": ShakingEvent,
    "stopping": StoppingEvent,
}
"""The dataclass of each event that a server sends, by the event's name."""


def read_event(message: Mapping[str, Any]) -> State | Event | None:
    """Return the event in a message.

    None if a later server sends an event that this package does not know.
    """
    kind = EVENTS.get(message["event"])
    return None if kind is None else decode(kind, message)
