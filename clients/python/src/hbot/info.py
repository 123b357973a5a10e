"""The server's descriptions of itself and of the rig (docs/api.md, "info")."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from .events import FaultEvent, Mode, SceneWarning, ShakingEvent
from .vectors import Vector


@dataclass(frozen=True, slots=True)
class Hello:
    """The server's answer to the first message of a connection."""

    server: str
    """Program and version of the server."""
    version: int
    """Version of the messages."""
    rig: str
    """Name of the rig."""
    rate_hz: float
    """Ticks per second, Hz."""
    session: int
    """Number of this connection."""


@dataclass(frozen=True, slots=True)
class Motor:
    """A joint of a wheel, with the limits of its motor."""

    peak: float
    """Largest joint torque for a short time, N m."""
    continuous: float
    """Joint torque without time limit, N m."""


@dataclass(frozen=True, slots=True)
class Wheel:
    """One wheel of the rig."""

    name: str | None
    """Name of the wheel, if it has one."""
    axis: Vector
    """Steering axis, a unit vector in frame N."""
    cone: float
    """Angle between the steering axis and the contact normal, rad."""
    toe: float
    """Angle by which the rolling direction is turned about the contact normal, rad."""
    radius: float
    """Radius of the wheel, m."""
    steer: Motor
    """The joint that steers the wheel."""
    drive: Motor
    """The joint that rolls the wheel."""


@dataclass(frozen=True, slots=True)
class Sphere:
    """The sphere of the rig."""

    radius: float
    """Radius, m."""
    mass: float
    """Mass, kg."""


@dataclass(frozen=True, slots=True)
class RigInfo:
    """The rig: its sphere and wheels."""

    name: str
    """Name of the rig."""
    simulated: bool
    """Whether the rig is simulated."""
    rate_hz: int
    """Ticks per second, Hz."""
    sphere: Sphere
    """The sphere."""
    wheels: tuple[Wheel, ...]
    """The wheels, in the order of a state's joints."""


@dataclass(frozen=True, slots=True)
class EnergyLimit:
    """Limit on the energy delivered to the hand."""

    burst: float
    """Energy in excess of `power` that can be delivered at once, J."""
    power: float
    """Power without time limit, W."""


@dataclass(frozen=True, slots=True)
class TractionLimit:
    """Friction between wheels and sphere, which limits the torque."""

    mu: float
    """Friction coefficient."""
    normal_force: float
    """Normal force of each wheel, N."""


@dataclass(frozen=True, slots=True)
class PassivityLimit:
    """The energy limit that the passivity controller keeps, and how strongly it acts."""

    allowance: float
    """Energy that can be delivered to the hand in excess of the energy absorbed from it, J."""
    store: float
    """Largest amount of absorbed energy that can be delivered again later, J."""
    damping: float
    """Largest damping that the passivity controller adds, N m s/rad."""


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits that the rig keeps."""

    torque: float
    """Largest torque on the sphere, N m."""
    torque_rate: float
    """Largest rate of change of the torque, N m/s."""
    speed: float
    """Largest angular speed while the motors are on, rad/s."""
    slip: float
    """Largest slip velocity while the motors are on, m/s."""
    enable_max_angle: float
    """Largest distance of an effect from its rest at `enable`, rad."""
    align_rate: float
    """Rate at which `align` corrects the orientation, rad/s."""
    reference_rate: float
    """Largest rate at which a reference moves, rad/s."""
    max_age_ticks: int
    """Largest age of a stream message, ticks since the tick that it names."""
    energy: EnergyLimit | None
    """Limit on energy, or None."""
    traction: TractionLimit | None
    """Limit by friction, or None."""
    passivity: PassivityLimit | None = None
    """Limit kept by the passivity controller, or None if the rig has none."""


@dataclass(frozen=True, slots=True)
class Loop:
    """The loop from a reading of the motion to the torque. It decides what the rig keeps stable."""

    delay_ticks: int
    """Whole ticks from a reading to the torque that is computed from it."""
    lag_s: float
    """Time constant with which the torque follows its command, s."""
    lead_s: float
    """Time by which the scene is rendered ahead of its reading, s."""
    rate_lag_s: float
    """Time constant of the filter of the motor controllers' encoders, s. 0 for none."""
    rate_weights: tuple[float, ...]
    """Weights of the last angles in an estimated rate, 1/s, the newest angle first. Empty if the
    rates are those of the motor controllers."""
    inertia: Vector
    """Inertia of the sphere about each of `axes`, kg m²."""
    axes: tuple[Vector, Vector, Vector]
    """Principal axes of the inertia, unit vectors in frame N."""


@dataclass(frozen=True, slots=True)
class Render:
    """What the rig can be expected to render."""

    stiffness_stable: float
    """Largest stiffness at which a spring with `damping` is stable, N m/rad."""
    damping: float
    """Damping to which `stiffness_stable` belongs, N m s/rad."""
    stiffness_most: float
    """Stiffness above which no spring is stable, N m/rad."""
    inertia: float
    """Smallest apparent inertia of the sphere, kg m²."""
    damping_most: float | None = None
    """Damping above which the damping alone is unstable, N m s/rad. None with an older server."""
    loop: Loop | None = None
    """The loop from which these numbers follow. None with an older server."""
    border: tuple[tuple[float, float], ...] = ()
    """Pairs of the damping of one spring alone, N m s/rad, and the largest stiffness that is stable
    with it, N m/rad. Empty with an older server."""
    rate_pick: str | None = None
    """Which estimate of the joint rates the rig has picked by itself and why. None if the rig file
    names the estimate."""


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of effect, or a phenomenon of the simulated rig."""

    name: str
    """Name in scene files."""
    description: str
    """What it does, for people."""
    schema: dict[str, Any]
    """JSON schema of the parameters, extended by `unit`."""


@dataclass(frozen=True, slots=True)
class ReadyScene:
    """A ready-made scene of the server."""

    file: str
    """Name that `load_scene` takes."""
    name: str
    """Name of the scene."""
    description: str
    """What it feels like, one sentence."""


@dataclass(frozen=True, slots=True)
class StableStiffness:
    """The largest stiffness of an effect with which the running scene is stable."""

    effect: str
    """Id of the effect."""
    axis: int | None
    """Axis of the effect's reference, 1 to 3, if its stiffness is a matrix. None: all axes."""
    stiffness: float
    """The stiffness, N m/rad."""


@dataclass(frozen=True, slots=True)
class ModeWords:
    """What a mode of the rig means, for people."""

    name: str
    """Name of the mode."""
    sentence: str
    """What it means."""


@dataclass(frozen=True, slots=True)
class FaultWords:
    """What a fault means, for people."""

    name: str
    """Name of the fault."""
    sentence: str
    """What happened."""
    remedy: str
    """What to do about it."""


@dataclass(frozen=True, slots=True)
class Holder:
    """The client that holds the lease. Both fields are None if the lease is free."""

    holder: str | None
    """Name of the client."""
    session: int | None
    """Number of its connection."""


@dataclass(frozen=True, slots=True)
class Clock:
    """The time of tick 0 on two clocks of the rig PC.

    Add `state.t` to place a state in their time.
    """

    monotonic_ns: int
    """CLOCK_MONOTONIC at tick 0, ns."""
    unix_ns: int
    """CLOCK_REALTIME at tick 0, ns since 1970."""


@dataclass(frozen=True, slots=True)
class Info:
    """The rig, what it can do, and what runs, at the moment of the answer.

    `Rig.refresh` asks for the present one.
    """

    rig: RigInfo
    """The rig."""
    limits: Limits
    """The limits that the rig keeps."""
    render: Render | None
    """What the rig can be expected to render, or None."""
    accuracy: str
    """Preset of numerical methods: `fast`, `balanced`, `exact` or `custom`."""
    on_client_lost: Literal["ramp", "keep", "fault"]
    """What happens if the connection of the lease holder ends."""
    effects: tuple[Kind, ...]
    """Kinds of effects."""
    scene: dict[str, Any]
    """The running scene, in the form that `load_scene` takes."""
    capability: Vector | None
    """Largest torque about n1, n2, n3 at the present steer angles, N m.

    None before the first tick.
    """
    lease: Holder
    """The client that holds the lease."""
    phenomena: tuple[Kind, ...] | None = None
    """Phenomena of the simulated rig. None with a real rig."""
    clock: Clock | None = None
    """The time of tick 0. None from a server of version 0.1."""
    scenes: tuple[ReadyScene, ...] = ()
    """The ready-made scenes. Empty with an older server, as the next three."""
    modes: tuple[ModeWords, ...] = ()
    """What each mode means."""
    faults: tuple[FaultWords, ...] = ()
    """What each fault means, and what to do about it."""
    warnings: tuple[str, ...] = ()
    """Warnings about the running scene, as in the answer to `load_scene`."""
    advice: tuple[SceneWarning, ...] = ()
    """The same warnings in parts."""
    stable: tuple[StableStiffness, ...] | None = None
    """Largest stiffness of each effect with which the running scene is stable.

    None until the server has computed it: ask again after a second.
    """
    curves: tuple[tuple[tuple[float, float], ...], ...] | None = None
    """Torque of the running scene against angle about n1, n2 and n3: pairs of rad and N m.

    From minus half a turn from the scene's anchor to half a turn and back. None as `stable`.
    """
    mode: Mode | None = None
    """Mode of the rig in the newest tick. None before the first."""
    incident: FaultEvent | None = None
    """The fault or the emergency stop in which the rig is now. None in other modes."""
    shaking: ShakingEvent | None = None
    """What shakes the sphere by itself, while the torque is lowered for it. None otherwise."""

    def __str__(self) -> str:
        """Say the rig's name, whether its motors can push, its mode and its scene."""
        kind = "SIMULATED" if self.rig.simulated else "LIVE"
        scene = self.scene.get("name")
        return f"{self.rig.name} ({kind}): {self.mode or 'mode not known'}, scene {scene!r}"
