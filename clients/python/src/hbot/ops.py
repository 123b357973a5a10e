"""Every op of the API: its parameters, what it does, its request, and how its answer is read.

docs/api.md, "Ops", describes the messages.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

from .answers import Changed, Controller, Controllers, Difference, Loaded, Pong, Stats
from .checks import finite
from .decode import decode
from .events import Mode, State
from .info import Info
from .models import Impedance, Model, Plane
from .request import Op, Request
from .scenes import Scene, open_scene


def _none(_body: Any) -> None:
    return None


def _mode(body: Any) -> Mode:
    return body["mode"]  # type: ignore[no-any-return]


def _stiffness_scale(body: Any) -> float | None:
    return None if body is None else float(body["stiffness_scale"])


def _given(**fields: Any) -> dict[str, Any]:
    """Return the fields that are not None."""
    return {name: value for name, value in fields.items() if value is not None}


INFO = Request("info", {}, lambda body: decode(Info, body))
"""Asks for the rig, what it can do, and what runs."""
UNSUBSCRIBE = Request("unsubscribe", {}, _none)
"""Ends the subscription."""
RELEASE = Request("release", {}, _none)
"""Gives the lease back."""


def subscribe(every: int) -> Request[None]:
    """Ask for a state every `every` ticks."""
    return Request("subscribe", {"every": every}, _none)


def torque_fields(
    torque: Iterable[float], valid_ms: int, tick: int | None, seq: int | None
) -> dict[str, Any]:
    """Return the fields of a message that streams a torque.

    Raises:
        ValueError: the torque is not three finite numbers.
    """
    numbers = finite("torque", torque)
    if len(numbers) != 3:
        raise ValueError(f"the torque has {len(numbers)} numbers; legal: 3")
    return _given(torque=numbers, valid_ms=valid_ms, tick=tick, seq=seq)


def model_fields(model: Model, valid_ms: int, tick: int | None, seq: int | None) -> dict[str, Any]:
    """Return the fields of a message that streams a local model."""
    return {**model.fields(), **_given(valid_ms=valid_ms, tick=tick, seq=seq)}


class Ops:
    """The ops that are methods of `Rig` and of `aio.Rig`. A new op is a method here."""

    _awaited: ClassVar[bool] = False
    """Whether the methods are awaited: those of `aio.Rig` are."""

    def __init_subclass__(cls) -> None:
        """Give the class its methods."""
        super().__init_subclass__()
        for name, op in vars(Ops).items():
            if isinstance(op, Op) and name not in vars(cls):
                setattr(cls, name, op.call_awaited if cls._awaited else op.call)

    @Op
    def stats(self) -> Request[Stats]:
        """Return how long things took, and how often events happened, since the server began."""
        return Request("stats", {}, lambda body: decode(Stats, body))

    @Op
    def controllers(self) -> Request[tuple[Controller, ...]]:
        """Return what the motor controller of each joint reports, in the order of the joints.

        Current, temperature, complaints and firmware; a value that it does not report is None.
        """
        return Request("controllers", {}, lambda body: decode(Controllers, body).controllers)

    @Op
    def acquire(self, steal: bool = False) -> Request[None]:
        """Take the lease, the right to command. `lease` does this for the time of a block.

        Args:
            steal: take the lease also from another client.

        Raises:
            Busy: another client, named in `holder`, has the lease.
        """
        return Request("acquire", {"steal": steal}, _none)

    @Op
    def release(self) -> Request[None]:
        """Give the lease back. This client's torque ramps to zero, and the scene continues."""
        return RELEASE

    @Op
    def load_scene(self, scene: Scene) -> Request[Loaded]:
        """Replace the scene. The change is blended in. `info.scene` is that of before.

        Args:
            scene: path of a scene file (TOML), or the name of a ready-made scene such as `"hinge"`,
                which the server knows; or a map of the structure of a scene file. Recorded paths
                (CSV) that a scene file names are read from this machine.

        Raises:
            OSError, IllegalInput: a file cannot be read; the message names it.
            BadRequest, OutOfRange: the scene is not legal; the message names every mistake, with
                its line and column if the scene is a file.
            TooLarge: the scene has more than 65536 bytes. `encoding="msgpack"` needs fewer.
            NotHolder: this client does not hold the lease.
        """
        fields, explain = open_scene(scene)
        return Request("load_scene", {"scene": fields}, lambda body: decode(Loaded, body), explain)

    @Op
    def set(self, effect: str, /, **parameters: Any) -> Request[Changed]:
        """Change parameters of an effect while the loop runs. Returns warnings about the scene.

        docs/effects.md lists them with their units.

        Raises:
            UnknownEffect, BadRequest, OutOfRange, NotHolder: the server refused the change.
        """
        fields = {"effect": effect, **parameters}
        return Request("set", fields, lambda body: decode(Changed, body))

    @Op
    def torque(
        self,
        torque: Iterable[float],
        valid_ms: int,
        *,
        tick: int | None = None,
        seq: int | None = None,
        wait: bool = True,
    ) -> Request[None]:
        """Send one torque, which is added to that of the scene. `render` sends a stream of them.

        Args:
            torque: three numbers in frame N, N m, acting on the sphere.
            valid_ms: time from its arrival until it ends, 1 to 1000 ms. Then it ramps to zero over
                20 ms.
            tick: the tick of the state from which it was computed.
            seq: a number of your choice. States return it as `state.client.seq`.
            wait: wait for the answer. Without, a refusal comes as a `RefusedEvent`; if another
                client has taken the lease, the next call raises `NotHolder`.
        """
        fields = torque_fields(torque, valid_ms, tick, seq)
        return Request("torque", fields, _none, wait=wait)

    @Op
    def model(
        self,
        valid_ms: int,
        *,
        torque: Iterable[float] = (0.0, 0.0, 0.0),
        stiffness: Impedance = 0.0,
        damping: Impedance = 0.0,
        pose: Iterable[float] | None = None,
        planes: Sequence[Plane] = (),
        blend_ms: int | None = None,
        soften: bool = False,
        tick: int | None = None,
        seq: int | None = None,
        wait: bool = True,
    ) -> Request[float | None]:
        """Send one local model: a torque, and how it changes as the sphere turns.

        `render` sends a stream of them if its function returns a `Model`, with the same fields.

        Args:
            torque: torque at the pose in frame N, N m.
            stiffness: N m/rad: a number, one for each axis of frame N, or a symmetric 3x3 matrix.
            damping: N m s/rad, as `stiffness`.
            pose: quaternion about which the stiffness acts. None: that of the state with the number
                `tick`, or that at arrival.
            planes: at most eight half-spaces, such as contacts.
            blend_ms: time in which the torque of before blends into this one, 0 to 200 ms. None:
                the time since the last model, at most 50 ms.
            soften: render what the loop does not keep stable with less stiffness, do not refuse it.
            valid_ms: as that of `torque`.
            tick: as that of `torque`.
            seq: as that of `torque`.
            wait: as that of `torque`.

        Returns the fraction of the stiffness that is rendered: 1, or less if the model allows the
        server to soften it. Without `wait`, None.

        Raises:
            OutOfRange: the loop does not keep the model stable, or `tick` is too old.
        """
        model = Model(torque, stiffness, damping, pose, planes, blend_ms, soften)
        fields = model_fields(model, valid_ms, tick, seq)
        return Request("model", fields, _stiffness_scale, wait=wait)

    @Op
    def reference(
        self,
        effect: str,
        q: Iterable[float],
        *,
        omega: Iterable[float] | None = None,
        valid_ms: int | None = None,
        tick: int | None = None,
        seq: int | None = None,
        wait: bool = True,
    ) -> Request[None]:
        """Move the reference of an effect, at most at the rig's `limits.reference_rate`.

        Args:
            effect: id of the effect.
            q: quaternion `(w, x, y, z)`, which rotates sphere axes into N.
            omega: angular velocity of the reference in frame N, rad/s.
            valid_ms: time after which `omega` ends, 1 to 1000 ms. The server's default is 100.
            tick: as that of `torque`.
            seq: as that of `torque`.
            wait: as that of `torque`.
        """
        turning = None if omega is None else finite("omega", omega)
        fields = _given(
            effect=effect, q=finite("q", q), omega=turning, valid_ms=valid_ms, tick=tick, seq=seq
        )
        return Request("reference", fields, _none, wait=wait)

    @Op
    def align(
        self,
        q: Iterable[float],
        weight: float | None = None,
        *,
        sigma: Iterable[float] | None = None,
        t: float | None = None,
    ) -> Request[Difference]:
        """Correct the server's orientation by one that was measured from outside.

        Args:
            q: the measured orientation `(w, x, y, z)`.
            weight: fraction of the difference that the server takes over, 0 to 1. Required without
                `sigma`. With `sigma`, its variances are divided by the weight, which is 1 by
                default.
            sigma: standard deviations of the error about the axes of frame N, rad. The server
                then weighs the measurement by its own uncertainty, and ignores one that is too far
                away.
            t: time of the measurement since the loop began, s. None: the time of arrival.

        Returns:
            The difference before the correction, rad. Its attribute `used` is False if the server
            ignores the measurement.
        """
        fields = _given(
            q=finite("q", q),
            weight=weight,
            sigma=None if sigma is None else finite("sigma", sigma),
            t=t,
        )
        return Request("align", fields, Difference.of)

    @Op
    def align_direction(
        self,
        body: Iterable[float],
        world: Iterable[float],
        sigma: float,
        *,
        t: float | None = None,
    ) -> Request[Difference]:
        """Correct the server's orientation by a measured direction, such as that of gravity.

        Args:
            body: the direction in the sphere's axes.
            world: the same direction in frame N. Gravity is `(0, 0, -1)`.
            sigma: standard deviation of the error about each axis across the direction, rad.
            t: time of the measurement since the loop began, s. None: the time of arrival.

        Returns:
            The angle between the direction and the server's own before the correction, rad, with
            `used` as that of `align`.
        """
        fields = _given(body=finite("body", body), world=finite("world", world), sigma=sigma, t=t)
        return Request("align_direction", fields, Difference.of)

    @Op
    def hand(
        self,
        q: Iterable[float] | None,
        *,
        over_ms: int | None = None,
        stiffness: float | None = None,
        damping: float | None = None,
        inertia: float | None = None,
        wait: bool = True,
    ) -> Request[None]:
        """Let the hand of a simulated rig turn the sphere. A real rig has none and refuses.

        Args:
            q: the orientation `(w, x, y, z)` to which the hand turns. None: it lets go.
            over_ms: time in which its target turns there. None: 50 ms.
            stiffness: spring of the grip, N m/rad. None: 3.
            damping: damping of the grip, N m s/rad. None: 0.05.
            inertia: inertia that the hand adds to the sphere, kg m². None: 0.002.
            wait: as that of `torque`.
        """
        if q is None:
            return Request("hand", {"release": True}, _none, wait=wait)
        fields = _given(
            q=finite("q", q), over_ms=over_ms, stiffness=stiffness, damping=damping, inertia=inertia
        )
        return Request("hand", fields, _none, wait=wait)

    @Op
    def enable(self) -> Request[Mode]:
        """Begin to render, with a soft start of 0.5 s. Returns the mode.

        Raises:
            OutOfRange: an effect is too far from its rest; `angle` says how far, rad.
            Faulted: the rig is in a fault. `reset` it first.
        """
        return Request("enable", {}, _mode)

    @Op
    def disable(self) -> Request[Mode]:
        """End rendering, with a ramp of 50 ms. Needs no lease. Returns the mode."""
        return Request("disable", {}, _mode)

    @Op
    def reset(self) -> Request[Mode]:
        """Leave a fault or an emergency stop after its cause is gone. Returns the mode."""
        return Request("reset", {}, _mode)

    @Op
    def estop(self) -> Request[Mode]:
        """Stop the motors in the next tick. Needs no lease. Returns the mode."""
        return Request("estop", {}, _mode)

    @Op
    def advance(self, ticks: int) -> Request[State]:
        """Let a simulated rig in virtual time run `ticks` ticks, 1 to 1000000, and then wait.

        Returns the state of the last of them. A torque or a model that was sent before with
        `wait=False` acts in all of them. From the first call until the lease is given back, time
        passes only here, and by one tick for each other call that waits for the loop.

        Raises:
            OutOfRange: the server runs in real time.
            NotHolder: this client does not hold the lease.
        """
        return Request("advance", {"ticks": ticks}, lambda body: decode(State, body))

    @Op
    def ping(self, data: Any = None) -> Request[Pong]:
        """Test the connection. Returns `data` as it came back, and the last tick."""
        return Request("ping", _given(data=data), lambda body: decode(Pong, body))
