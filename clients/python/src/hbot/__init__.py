"""A client for the TCP API of an Hbot server.

    import hbot

    with hbot.connect("127.0.0.1:4268", name="me") as rig:
        with rig.lease():
            rig.load_scene("hinge")
            rig.enable()
            for state in rig.states(every=100, duration=5.0):
                print(state.t, state.q)

Units are SI (m, rad, s, kg, N m); a field with another unit has the unit in its name. Vectors are
in the inertial frame N, whose third axis points up. Quaternions are `(w, x, y, z)` and rotate
sphere axes into N. A torque acts on the sphere. `hbot.aio` has the same names for programs with
asyncio.
"""

from . import aio
from .answers import Changed, Controller, Difference, Distribution, Loaded, Pong, Stats
from .errors import (
    BadRequest,
    Busy,
    ConnectionLost,
    Faulted,
    HbotError,
    IllegalInput,
    MissingExtra,
    NoServer,
    NotHolder,
    NotTrusted,
    OutOfRange,
    ProtocolError,
    Refused,
    SubscriptionTaken,
    TimedOut,
    TooLarge,
    Unauthorized,
    UnknownEffect,
    UnsupportedVersion,
    VirtualTime,
)
from .events import (
    DroppedEvent,
    Effect,
    Event,
    FaultEvent,
    Joint,
    LeaseEvent,
    LostEvent,
    RefusedEvent,
    Requester,
    SceneEvent,
    SceneWarning,
    SetEvent,
    ShakingEvent,
    State,
    StoppingEvent,
    Stream,
    Timing,
)
from .info import Clock, Hello, Info
from .models import Model, Plane
from .opening import connect
from .program import one_line_errors
from .rendering import Computed, Rendered
from .rig import Rig
from .vectors import Vector

__all__ = [
    "BadRequest",
    "Busy",
    "Changed",
    "Clock",
    "Computed",
    "ConnectionLost",
    "Controller",
    "Difference",
    "Distribution",
    "DroppedEvent",
    "Effect",
    "Event",
    "FaultEvent",
    "Faulted",
    "HbotError",
    "Hello",
    "IllegalInput",
    "Info",
    "Joint",
    "LeaseEvent",
    "Loaded",
    "LostEvent",
    "MissingExtra",
    "Model",
    "NoServer",
    "NotHolder",
    "NotTrusted",
    "OutOfRange",
    "Plane",
    "Pong",
    "ProtocolError",
    "Refused",
    "RefusedEvent",
    "Rendered",
    "Requester",
    "Rig",
    "SceneEvent",
    "SceneWarning",
    "SetEvent",
    "ShakingEvent",
    "State",
    "Stats",
    "StoppingEvent",
    "Stream",
    "SubscriptionTaken",
    "TimedOut",
    "Timing",
    "TooLarge",
    "Unauthorized",
    "UnknownEffect",
    "UnsupportedVersion",
    "Vector",
    "VirtualTime",
    "aio",
    "connect",
    "one_line_errors",
]
