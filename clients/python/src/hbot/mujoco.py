"""A body of a MuJoCo model in the hand: `pip install 'hbot[mujoco]'`.

    import hbot, hbot.mujoco, mujoco

    model = mujoco.MjModel.from_xml_path("valve.xml")
    with hbot.connect() as rig, rig.lease():
        rig.load_scene({"name": "Nothing", "effect": []})
        rig.enable()
        hbot.mujoco.run(rig, model, "valve", duration=60.0)

The body follows the sphere by a virtual coupling, a spring and damper in the simulation. What the
coupling pulls with is felt. Because the simulation is slower than the rig's loop, it sends local
models (`hbot.Model`), not torques: how the pull changes if the sphere turns on (found by a small
turn in a copy of the simulation), and a half-space for each contact and joint limit that is near.
So contacts are as stiff at 60 Hz as at 1000 Hz, and begin where the simulation has them.

The axes of MuJoCo's world are those of frame N: the third points up.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Any

from .errors import MissingExtra, OutOfRange
from .models import Model, Plane

try:
    import mujoco
    import numpy as np

    from . import turns
except ImportError as error:
    raise MissingExtra.of("hbot.mujoco", "mujoco", error) from error

if TYPE_CHECKING:
    from .events import State
    from .rig import Rig

Array = Any
"""An array of numpy."""

PROBE = (1e-3, 2e-2)
"""Least and largest turn by which the local stiffness is found, rad.

Between them it is twice the last one, about what the sphere turns while the model is in force. What
sticks and slides in turn would else seem as stiff as it is only until it slides."""
LONGEST_STEP = 0.1
"""Time between two states after which the simulation has been paused, s."""
HORIZON = 0.016
"""Shortest time after that turn at which its pull is taken, s.

A light body has followed then, so it does not pull. A heavy one, or one that touches something,
still pulls as stiffly as the coupling."""
EXPLICIT = 0.1
"""Largest K dt²/I of the coupling in the simulation, which integrates it explicitly."""
LIGHT = 0.1
"""Largest armature of the body by default, as a fraction of the sphere's inertia.

With one like the sphere's, both swing about the coupling."""


@dataclass(frozen=True, slots=True)
class Felt:
    """What a `run` did."""

    updates: int
    """Number of models that were computed."""
    steps: int
    """Number of steps of the simulation, without those that find the stiffness."""
    real_time_factor: float
    """Time of the rig over the time that the simulation needed to compute."""
    work: float
    """Energy that the hand gave to the simulation, J."""
    rig_work: float
    """The same by the rig's own observer, J, without the pauses."""
    imbalance: float
    """`work` over `rig_work`, less 1. Below 0, delays have taken energy from the hand."""
    age_ticks: float
    """Median age of the model in force, ticks since its state."""
    pauses: int
    """How often the simulation was paused or reset, so that the coupling began anew."""
    refused: int
    """Models that the server refused. The logger `hbot` has the reason of the first."""


class Hand:
    """A body of a simulation, held by the sphere.

    Attributes:
        model, data: the simulation. A program may read and change them between two updates.
        work: energy that the hand has given to the simulation, J.
        steps: number of steps so far.
        begins: number of times the coupling has begun anew.
    """

    def __init__(
        self,
        rig: Rig,
        model: mujoco.MjModel,
        body: str,
        *,
        data: mujoco.MjData | None = None,
        gain: float = 1.0,
        inertia: float = 1.0,
        stiffness: float | None = None,
        margin: float = 0.005,
    ) -> None:
        """Take the body `body`, which a hinge, a ball joint or a free joint moves.

        Args:
            rig: the rig, for what it keeps stable.
            model: the simulation's model. Masses, gaps and armatures in it are changed.
            body: name of the body.
            data: the simulation's state. None: its initial state.
            gain: torque on the sphere over that on the body.
            inertia: factor on the body's mass and inertia.
            stiffness: of the coupling as it is felt, N m/rad. None: half of what the rig keeps
                stable with a damping that the hand hardly feels, or less if the steps of the
                simulation are so long that the body would need an armature of more than a tenth of
                the sphere's inertia.
            margin: distance from which contacts are noticed before they touch, m.

        Raises:
            ValueError: the model has no such body, or no joint moves it.
        """
        self.model, self.data = model, data if data is not None else mujoco.MjData(model)
        self._body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body)
        if self._body < 0:
            names = ", ".join(filter(None, (model.body(i).name for i in range(1, model.nbody))))
            raise ValueError(f"the model has no body {body!r}; it has {names}")
        if model.body_jntnum[self._body] == 0:
            raise ValueError(f"no joint moves the body {body!r}; legal: a body with a joint")
        self._joint = int(model.body_jntadr[self._body]) + int(model.body_jntnum[self._body]) - 1
        self._kind = int(model.jnt_type[self._joint])
        if self._kind == mujoco.mjtJoint.mjJNT_SLIDE:
            raise ValueError(f"the body {body!r} slides; legal: a hinge, a ball or a free joint")
        render = rig.info.render
        stable, damping, sphere = (
            (5.0, 0.02, 0.0)
            if render is None
            else (render.stiffness_stable, render.damping, render.inertia)
        )
        # Damping for each stiffness with which a spring is stable, and a third more, s.
        self._least_relaxation = 1.33 * damping / stable
        self._gain = gain
        # The rig gives no more, so the body must not get more than the hand feels.
        self._most = rig.info.limits.torque / gain
        self._grasp(inertia, margin)
        least = min(self._inertia(dof) for dof in range(model.nv)[self._dofs])
        light = (least + LIGHT * sphere) * EXPLICIT / model.opt.timestep**2
        self.stiffness = min(0.5 * stable, gain * light) if stiffness is None else stiffness
        self._couple(least)
        self._probe = mujoco.MjData(model)
        # Turn from the sphere to the body.
        self._anchor: turns.Quaternion | None = None
        self._last: State | None = None
        self._time = self.data.time
        self.work = 0.0
        self.steps = 0
        self.begins = 0

    def _grasp(self, inertia: float, margin: float) -> None:
        """Scale the body, and find what belongs to it."""
        model = self.model
        model.body_mass[self._body] *= inertia
        model.body_inertia[self._body] *= inertia
        ids = np.arange(model.nbody)
        within = np.array([self._is_within(int(i)) for i in ids])
        self._geoms = within[model.geom_bodyid]
        model.geom_gap[self._geoms] += margin
        mujoco.mj_setConst(model, self.data)
        mujoco.mj_forward(model, self.data)
        first = int(model.jnt_dofadr[self._joint])
        self._dofs = {0: slice(first + 3, first + 6), 1: slice(first, first + 3)}.get(
            self._kind, slice(first, first + 1)
        )

    def _couple(self, least: float) -> None:
        """Give the coupling an inertia with which it is stable. `least` is that of the body."""
        model = self.model
        self._spring = self.stiffness / self._gain
        needed = self._spring * model.opt.timestep**2 / EXPLICIT
        model.dof_armature[self._dofs] += max(0.0, needed - least)
        # MuJoCo takes the inertia of a body without children from what it has computed here.
        mujoco.mj_setConst(model, self.data)
        mujoco.mj_forward(model, self.data)
        # Damped so that a light body has followed within a period of the client.
        self._damper = 1.2 * float(np.sqrt(self._spring * max(least, needed)))
        # The loop renders the coupling's damper too. In the torque it would be as late as the
        # model, and a late damper drives what it should damp.
        self._relaxation = max(self._least_relaxation, self._damper / self._spring)

    def _inertia(self, dof: int) -> float:
        """Return what a degree of freedom moves, kg m²."""
        unit, moved = np.zeros(self.model.nv), np.zeros(self.model.nv)
        unit[dof] = 1.0
        mujoco.mj_mulM(self.model, self.data, moved, unit)
        return float(moved[dof])

    def _is_within(self, body: int) -> bool:
        while body > 0:
            if body == self._body:
                return True
            body = int(self.model.body_parentid[body])
        return False

    def reset(self) -> None:
        """Let the coupling begin anew where body and sphere are: it pulls with nothing."""
        self._anchor = None

    def update(self, state: State) -> Model:
        """Advance the simulation to the time of `state`, and return what the sphere is to feel.

        After a pause of more than 0.1 s, or a reset of the simulation, the coupling begins anew, so
        nothing kicks.
        """
        data, last = self.data, self._last
        paused = last is None or not 0.0 < state.t - last.t < LONGEST_STEP
        if self._anchor is None or paused or data.time < self._time:
            self._last, self._time = state, data.time
            self.begins += 1
            mujoco.mj_forward(self.model, data)
            pose = data.xquat[self._body].tolist()
            self._anchor = turns.times(turns.conjugate(state.q), pose)
            self._place = data.xpos[self._body].copy()
            self._begin = state.t - data.time
            return Model()
        assert last is not None
        steps = round((state.t - self._begin - data.time) / self.model.opt.timestep)
        axes = self._axes()
        self._free = axes.T @ axes
        probed = max(steps, round(HORIZON / self.model.opt.timestep))
        turned = np.linalg.norm(turns.log(turns.times(state.q, turns.conjugate(last.q))))
        probe = float(np.clip(2.0 * turned, *PROBE))
        still, *copies = [
            self._turned(last, state, steps, probed, turn)
            for turn in (np.zeros(3), *(axes * probe))
        ]
        pull, error, work = self._advance(data, last, state, steps)
        self.steps += steps
        if steps > 0:  # Otherwise the way to this state belongs to the next step.
            self._last, self._time = state, data.time
        self.work += work
        return self._linear(state, pull, error, axes, [(copy - still) / probe for copy in copies])

    def _axes(self) -> Array:
        """Axes about which the joint lets the body turn, as rows."""
        if self._kind == mujoco.mjtJoint.mjJNT_HINGE:
            return self.data.xaxis[self._joint][None, :].copy()
        return np.eye(3)

    def _turned(self, last: State, state: State, steps: int, probed: int, turned: Array) -> Array:
        """Return the pull after `probed` steps if the sphere were `turned` by a rotation vector.

        It arrives at `state` after `steps`, and turns on at the same rate.
        """
        mujoco.mj_copyData(self._probe, self.model, self.data)
        return self._advance(self._probe, last, state, max(steps, 1), turned, probed)[0]

    def _advance(
        self,
        data: mujoco.MjData,
        last: State,
        state: State,
        steps: int,
        turned: Array | None = None,
        most: int | None = None,
    ) -> tuple[Array, Array, float]:
        """Step; the sphere turns from `last` to `state` in `steps`, and on until `most` steps.

        Returns the pull (N m) before the limit and its error (rad), in the world, and the work of
        the sphere (J).
        """
        turn = np.array(turns.log(turns.times(state.q, turns.conjugate(last.q))))
        omega, pulled = np.array(state.omega), np.zeros(3)
        # The sphere is taken to turn at its mean rate until the end of the interval, and to have
        # the rate of `state` there.
        mean = turn / (state.t - last.t)
        for step in range(max(steps if most is None else most, 0)):
            # The body's pose and rate are those of this step only after its first half.
            mujoco.mj_step1(self.model, data)
            pull = self._limited(self._pull(data, last.q, turn * (step / steps), mean, turned)[0])
            # By the trapezoidal rule: half of it here, half at the end of the step.
            pulled += pull if step > 0 else 0.5 * pull
            data.xfrc_applied[self._body, 3:] = pull
            if self._kind == mujoco.mjtJoint.mjJNT_FREE:
                data.xfrc_applied[self._body, :3] = self._hold(data)
            mujoco.mj_step2(self.model, data)
        # Poses and contacts are those before the last step until they are computed anew.
        mujoco.mj_fwdPosition(self.model, data)
        mujoco.mj_comVel(self.model, data)
        part = 1.0 if most is None else most / steps
        pull, error = self._pull(data, last.q, turn * part, omega, turned)
        work = float((pulled + 0.5 * self._limited(pull)) @ turn) / steps if steps > 0 else 0.0
        return pull, error, work

    def _pull(
        self, data: mujoco.MjData, q: Any, turn: Array, omega: Array, turned: Array | None
    ) -> tuple[Array, Array]:
        assert self._anchor is not None
        now = turns.times(turns.exp(turn if turned is None else turn + turned), q)
        target = turns.times(now, self._anchor)
        pose = data.xquat[self._body].tolist()
        error = np.array(turns.log(turns.times(target, turns.conjugate(pose))))
        # About the axes that the joint does not have, nothing in the simulation swings.
        rate = self._free @ (omega - data.cvel[self._body, :3])
        return self._spring * error + self._damper * rate, error

    def _limited(self, pull: Array) -> Array:
        """Return what the body gets of a pull: no more than the hand feels.

        The rig limits the model itself, in every tick: a model of the limited pull would be stiff
        where the limited pull is constant, so the hand would lose energy whenever it yields.
        """
        return pull * min(1.0, self._most / max(float(np.linalg.norm(pull)), 1e-12))

    def _hold(self, data: mujoco.MjData) -> Array:
        """Return the force that holds a free body in its place, as stiff as the steps allow."""
        mass = float(self.model.body_mass[self._body])
        pace = float(np.sqrt(EXPLICIT)) / self.model.opt.timestep
        velocity = data.qvel[self.model.jnt_dofadr[self._joint] :][:3]
        way = self._place - data.xpos[self._body]
        return mass * (pace**2 * way - pace * velocity - self.model.opt.gravity)

    def _linear(
        self, state: State, pull: Array, error: Array, axes: Array, slopes: list[Array]
    ) -> Model:
        """Return the model that has the torque and the stiffness that were found."""
        gain, most = self._gain, self.stiffness
        free = self._free
        found = sum(
            (np.outer(gain * slope, axis) for axis, slope in zip(axes, slopes, strict=True)),
            np.zeros((3, 3)),
        )
        found = free @ (0.5 * (found + found.T)) @ free
        torque = -gain * pull
        planes = self._planes(error, axes)
        for plane in planes:
            normal = np.array(plane.normal)
            push = plane.stiffness * max(0.0, -plane.offset)
            if push > 0.0:
                damped = plane.damping * float(normal @ np.array(state.omega))
                torque += (push + max(damped, -push)) * normal
                rest = np.eye(3) - np.outer(normal, normal)
                found = rest @ found @ rest
        values, vectors = np.linalg.eigh(found)
        stiffness = (vectors * np.clip(values, 0.0, most)) @ vectors.T
        held = most * (np.eye(3) - free)
        damping = self._relaxation * stiffness + self._least_relaxation * held
        stiffness += held
        torque += damping @ np.array(state.omega)
        return Model(torque, stiffness, damping, state.q, planes, soften=True)

    def _planes(self, error: Array, axes: Array) -> list[Plane]:
        """Return a half-space for each joint limit and each contact that is near."""
        found: list[tuple[float, Array]] = []
        model, data = self.model, self.data
        if self._kind == mujoco.mjtJoint.mjJNT_HINGE and model.jnt_limited[self._joint]:
            low, high = model.jnt_range[self._joint]
            at = data.qpos[model.jnt_qposadr[self._joint]]
            found += [(high - at, axes[0]), (at - low, -axes[0])]
        centre = (
            data.xipos[self._body]
            if self._kind == mujoco.mjtJoint.mjJNT_FREE
            else data.xanchor[self._joint]
        )
        free = self._free
        for k in range(data.ncon):
            contact = data.contact[k]
            ours = [bool(self._geoms[geom]) for geom in contact.geom]
            if ours[0] == ours[1]:
                continue
            arm = free @ np.cross(contact.pos - centre, contact.frame[:3])
            lever = float(np.linalg.norm(arm))
            if lever > 1e-4:
                # A turn about it brings the body nearer to what it touches.
                normal = arm / lever * (1.0 if ours[0] else -1.0)
                found.append((float(contact.dist) / lever, normal))
        planes: list[Plane] = []
        kept: list[Array] = []
        for gap, normal in sorted(found, key=lambda item: item[0]):
            if len(kept) < 8 and all(float(normal @ other) < 0.95 for other in kept):
                kept.append(normal)
                offset = float(gap) - float(error @ normal)
                if abs(offset) < 3.0:
                    planes.append(Plane(normal, offset, self.stiffness))
        # Several contacts together are not stiffer than the coupling through which they are felt.
        entered = [np.array(plane.normal) for plane in planes if plane.offset < 0.0]
        share = 1.0
        if entered:
            share = 1.0 / float(np.linalg.eigvalsh(sum(np.outer(n, n) for n in entered))[-1])
        for at, plane in enumerate(planes):
            stiffness = self.stiffness * (share if plane.offset < 0.0 else 1.0)
            planes[at] = Plane(plane.normal, plane.offset, stiffness, self._relaxation * stiffness)
        return planes


def run(
    rig: Rig,
    model: mujoco.MjModel,
    body: str,
    *,
    rate_hz: float = 200.0,
    duration: float | None = None,
    viewer: bool = False,
    each: Callable[[Hand, State], None] | None = None,
    **options: Any,
) -> Felt:
    """Put a body into the hand until `duration` s of the rig's time are over, or until Ctrl-C.

    Needs the lease and an enabled rig, like `Rig.render`. With `viewer`, MuJoCo's viewer shows the
    simulation. `each` is called after each update. The other options are those of `Hand`.

    Raises:
        NotHolder, Faulted, TimedOut, ConnectionLost: as `Rig.render`.
        OutOfRange: the server has refused all models for a second.
        ValueError: as `Hand`.
    """
    hand = Hand(rig, model, body, **options)
    connection = rig._connection
    updates, spent, rig_work, refused = 0, 0.0, 0.0, connection.refused
    ages: list[int] = []
    first: State | None = None
    newest: State | None = None
    window: Any = None
    if viewer:
        import mujoco.viewer as viewers

        window = viewers.launch_passive(model, hand.data)

    def torque(state: State) -> Model | None:
        nonlocal updates, spent, rig_work, first, newest
        if first is not None:
            # Before the first model is accepted, no state names one.
            client, age = state.client, state.tick - first.tick
            if client is not None:
                ages.append(age := client.age_ticks)
            if connection.refused > refused and age > rig.hello.rate_hz:
                raise OutOfRange(connection.refusal, op="model")
        begun, begins = time.perf_counter(), hand.begins
        made = hand.update(state)
        if newest is not None and hand.begins == begins:
            rig_work += newest.energy - state.energy
        updates += 1
        first, newest = first or state, state
        if each is not None:
            each(hand, state)
        if window is not None:
            window.sync()
        spent += time.perf_counter() - begun
        return made

    every = max(1, round(rig.hello.rate_hz / rate_hz))
    # A model is passive, so one that is late does less harm than none.
    valid_ms = max(round(1000.0 * LONGEST_STEP), min(1000, round(5000.0 / rate_hz)))
    try:
        rig.render(torque, every=every, valid_ms=valid_ms, duration=duration)
    except KeyboardInterrupt:
        pass  # Returns what was felt until now.
    finally:
        if window is not None:
            window.close()
    if first is None or newest is None:
        return Felt(0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0)
    return Felt(
        updates,
        hand.steps,
        (newest.t - first.t) / max(spent, 1e-9),
        hand.work,
        rig_work,
        hand.work / rig_work - 1.0 if rig_work else 0.0,
        median(ages or [0]),
        hand.begins - 1,
        connection.refused - refused,
    )
