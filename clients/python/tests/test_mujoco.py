"""A body of a MuJoCo model in the hand. Left out without MuJoCo; `.ci/python.sh` says so then."""

import math
import os
import re
import runpy
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest
from serving import REPOSITORY, Server, eventually

if not os.environ.get("HBOT_MUJOCO"):
    pytest.importorskip("mujoco")

import mujoco
import numpy as np

import hbot.mujoco
from hbot import turns

EXAMPLES = REPOSITORY / "examples"

DOOR = """
<mujoco>
  <option timestep="0.002"/>
  <default>
    <geom solref="0.004 1" solimp="0.99 0.99 0.001"/>
    <joint solreflimit="0.004 1" solimplimit="0.99 0.99 0.001"/>
  </default>
  <worldbody>
    <body name="door">
      <joint type="hinge" axis="0 0 1" range="-60 45" frictionloss="{friction}" damping="0.002"/>
      <geom type="box" size="0.06 0.005 0.005" mass="0.1"/>
    </body>
    {peg}
  </worldbody>
</mujoco>
"""


@dataclass
class Still:
    """A state of a sphere that turns about n3."""

    t: float
    angle: float
    rate: float

    @property
    def q(self) -> tuple[float, float, float, float]:
        """Return the orientation."""
        return (np.cos(self.angle / 2), 0.0, 0.0, np.sin(self.angle / 2))

    @property
    def omega(self) -> tuple[float, float, float]:
        """Return the rate, rad/s."""
        return (0.0, 0.0, self.rate)


BEGIN = 60_000
"""Tick from which the runs in virtual time are alike."""
MOTOR = {"torque_scale": 1.0, "lag_s": 0.0005, "thermal_time_s": 1e5}
"""Motors that follow as late as the rig file says, so the lead is right, and stay cold."""


def simple_rig(stable: float = 10.0) -> Any:
    """Return what `Hand` asks of a rig."""
    render = SimpleNamespace(stiffness_stable=stable, damping=0.02, inertia=3e-3)
    return SimpleNamespace(info=SimpleNamespace(render=render, limits=SimpleNamespace(torque=0.9)))


def hand(friction: float = 0.0, peg: str = "", **options: Any) -> hbot.mujoco.Hand:
    rig = simple_rig()
    model = mujoco.MjModel.from_xml_string(DOOR.format(friction=friction, peg=peg))
    return hbot.mujoco.Hand(rig, model, "door", **options)


def turned(hand: hbot.mujoco.Hand, seconds: float, rate: float = 0.3) -> list[tuple[float, Any]]:
    """Turn the sphere at `rate` rad/s; return angle and model at 60 Hz."""
    made = []
    for k in range(round(60 * seconds)):
        state: Any = Still(k / 60, rate * k / 60, rate)
        made.append((state.angle, hand.update(state)))
    return made


def felt(model: Any, omega: float) -> float:
    """Return the torque about n3 at the model's pose."""
    return float(acting(model, (0.0, 0.0, omega))[2])


def acting(model: Any, omega: Any) -> Any:
    """Return the torque at the model's pose."""
    pushes = [
        plane.stiffness * max(0.0, -plane.offset) * np.array(plane.normal) for plane in model.planes
    ]
    damped = (np.eye(3) * np.array(model.damping)) @ np.array(omega)
    return np.array(model.torque) - damped - sum(pushes, np.zeros(3))


def test_a_free_hinge_drags_by_its_friction_and_is_held_about_other_axes() -> None:
    made = turned(hand(friction=0.03), 1.5)[30:]
    torques = [felt(model, 0.3) for _, model in made]
    # 0.03 N m of friction and 0.002 N m s/rad at 0.3 rad/s. MuJoCo's friction is a soft constraint.
    assert np.mean(torques) == pytest.approx(-0.0306, rel=0.03)
    stiffness = np.array(made[-1][1].stiffness)
    assert stiffness[0, 0] == stiffness[1, 1] == pytest.approx(5.0)
    # It slides, so a further turn does not pull more.
    assert np.mean([np.array(model.stiffness)[2, 2] for _, model in made]) < 0.5


def test_a_joint_limit_and_a_contact_are_half_spaces_where_they_are() -> None:
    # The near face of the peg is at 0.5 rad, at 50 mm from the hinge.
    peg = '<geom type="sphere" size="0.01" pos="0.0367 0.0372 0"/>'
    # The contact yields in the simulation, and the door bounces on it.
    for model, at, softness in [("", np.deg2rad(45), 0.1), (peg, 0.501, 0.25)]:
        made = turned(hand(peg=model), 3.0)
        begins = [
            (angle, angle + plane.offset)
            for angle, model in made
            for plane in model.planes
            if np.array(plane.normal)[2] > 0.9
        ]
        # It was there before the door came to it, and stays there while it is pressed with up to
        # 0.5 N m, although the simulation lets the door bounce.
        near = [place for angle, place in begins if at - 0.05 < angle < at + 0.1]
        assert len(near) > 20
        assert near == pytest.approx([at] * len(near), abs=1e-3)
        pressed = [felt(model, 0.3) for angle, model in made if at + 0.05 < angle < at + 0.1]
        assert np.mean(pressed) == pytest.approx(-5.0 * 0.075, rel=softness)


def test_pauses_and_resets_do_not_kick() -> None:
    body = hand(friction=0.03)
    turned(body, 1.0)
    paused: Any = Still(3.0, 1.2, 0.3)
    assert felt(body.update(paused), 0.3) == 0.0
    soon: Any = Still(3.0 + 1 / 60, 1.2 + 0.3 / 60, 0.3)
    assert abs(felt(body.update(soon), 0.3)) < 0.05
    mujoco.mj_resetData(body.model, body.data)
    again: Any = Still(3.0 + 2 / 60, 1.2 + 0.6 / 60, 0.3)
    assert felt(body.update(again), 0.3) == 0.0


def test_gain_and_inertia_scale_what_is_felt() -> None:
    plain, strong = hand(friction=0.02), hand(friction=0.02, gain=2.0)
    weak, double = [
        np.mean([felt(model, 0.3) for _, model in turned(body, 1.0)[30:]])
        for body in (plain, strong)
    ]
    assert double == pytest.approx(2.0 * weak, rel=0.05)
    heavy = hand(inertia=3.0)
    assert heavy.model.body_mass[1] == pytest.approx(0.3)


BALL = """
<mujoco>
  <option timestep="0.002"/>
  <default><geom solref="0.004 1" solimp="0.99 0.99 0.001" condim="1"/></default>
  <worldbody>
    <body name="body" pos="0.1 0 0.3">
      <joint type="{joint}" damping="0.01"/>
      <geom type="box" size="0.06 0.005 0.005" mass="0.1"/>
    </body>
    {peg}
  </worldbody>
</mujoco>
"""


@dataclass
class Turning:
    """A state of a sphere that turns about a skew axis."""

    t: float
    rate: float
    axis: Any

    @property
    def q(self) -> Any:
        """Return the orientation."""
        return turns.exp(self.rate * self.t * self.axis)

    @property
    def omega(self) -> Any:
        """Return the rate, rad/s."""
        return self.rate * self.axis


@pytest.mark.parametrize("joint", ["ball", "free"])
def test_a_ball_and_a_free_joint_follow_all_turns(joint: str) -> None:
    model = mujoco.MjModel.from_xml_string(BALL.format(joint=joint, peg=""))
    body = hbot.mujoco.Hand(simple_rig(), model, "body")
    states: list[Any] = [Turning(k / 60, 0.8, np.array([2.0, 1.0, 2.0]) / 3.0) for k in range(90)]
    made = [body.update(state) for state in states]
    torques = [
        acting(model, state.omega) for state, model in zip(states[-30:], made[-30:], strict=True)
    ]
    # Only the joint's damping pulls, 0.01 N m s/rad, and no axis is held.
    assert np.mean(torques, axis=0) == pytest.approx(-0.01 * states[-1].omega, rel=0.03)
    assert np.linalg.eigvalsh(np.array(made[-1].stiffness)).max() < 0.5
    error = turns.log(turns.times(body.data.xquat[1], turns.conjugate(states[-1].q)))
    assert np.linalg.norm(error) < 0.01
    # A free body is held in its place against its weight.
    assert body.data.xpos[1] == pytest.approx([0.1, 0.0, 0.3], abs=1e-3)


@pytest.mark.parametrize("joint", ["ball", "free"])
def test_a_contact_of_a_ball_and_a_free_joint_is_a_half_space_where_it_is(joint: str) -> None:
    # The near face of the peg is at 0.5 rad, at 50 mm from the joint.
    peg = '<geom type="sphere" size="0.01" pos="0.1367 0.0372 0.3"/>'
    model = mujoco.MjModel.from_xml_string(BALL.format(joint=joint, peg=peg))
    body = hbot.mujoco.Hand(simple_rig(), model, "body")
    states: list[Any] = [Turning(k / 60, 0.3, np.array([0.0, 0.0, 1.0])) for k in range(130)]
    made = [(state.rate * state.t, body.update(state)) for state in states]
    begins = [
        angle + plane.offset
        for angle, model in made
        for plane in model.planes
        if np.array(plane.normal)[2] > 0.9 and 0.45 < angle < 0.6
    ]
    assert len(begins) > 20
    # So a free body's contact moves with it: at most 0.1 rad of pressing, shared by both springs.
    assert begins == pytest.approx([0.501] * len(begins), abs=2e-3 if joint == "ball" else 0.05)
    pressed = [felt(model, 0.3) for angle, model in made if 0.56 < angle < 0.62]
    # The hold of a free body of 0.1 kg gives way by 2500 N/m at 50 mm, 6.25 N m/rad in series.
    stiffness = 5.0 if joint == "ball" else 1.0 / (1.0 / 5.0 + 1.0 / 6.25)
    assert np.mean(pressed) == pytest.approx(-stiffness * 0.09, rel=0.25)
    assert int(body.data.warning.number.sum() + body._probe.warning.number.sum()) == 0


def test_what_cannot_be_held_is_refused() -> None:
    rig = simple_rig()
    model = mujoco.MjModel.from_xml_string(DOOR.format(friction=0, peg=""))
    with pytest.raises(ValueError, match="it has door"):
        hbot.mujoco.Hand(rig, model, "window")
    fixed = '<mujoco><worldbody><body name="a"><geom size="0.1"/></body></worldbody></mujoco>'
    with pytest.raises(ValueError, match="no joint"):
        hbot.mujoco.Hand(rig, mujoco.MjModel.from_xml_string(fixed), "a")


@pytest.mark.timeout(120)
@pytest.mark.parametrize("example", ["mujoco_valve.py", "mujoco_key.py"])
def test_the_examples_run_for_a_minute(
    start_server: Callable[..., Server],
    example: str,
    record_property: Callable[[str, object], None],
) -> None:
    """Their energies agree only if this machine has the time for it, so they are only shown."""
    server = start_server(rate_hz=1000)
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / example), "--seconds", "60"],
        env={**os.environ, "HBOT_SERVER": server.address},
        capture_output=True,
        text=True,
        timeout=110,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    record_property(example, done.stdout.strip())
    felt = {name: float(value) for name, value in re.findall(r"(\w+)=([-.e\d]+)", done.stdout)}
    assert felt["steps"] > 15_000
    assert felt["work"] > 0.0, "the hand pays for friction and contacts"


def test_ctrl_c_ends_a_run_with_its_figures(server: Server) -> None:
    with subprocess.Popen(
        [sys.executable, str(EXAMPLES / "mujoco_valve.py")],
        env={**os.environ, "HBOT_SERVER": server.address},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as program:
        with hbot.connect(server.address, name="watch") as watch:
            eventually(lambda: next(watch.states()).client is not None, "a model is in force")
        program.send_signal(signal.SIGINT)
        said, errors = program.communicate(timeout=20)
    assert (program.returncode, errors) == (0, "")
    assert re.match(r"Felt\(updates=[1-9]", said)


def test_a_coupling_that_the_rig_refuses_is_an_error(server: Server) -> None:
    model = mujoco.MjModel.from_xml_string(DOOR.format(friction=0, peg=""))
    with hbot.connect(server.address) as rig, rig.lease():
        rig.load_scene({"name": "Nothing", "effect": []})
        rig.enable()
        with pytest.raises(hbot.OutOfRange, match="acts too late"):
            hbot.mujoco.run(rig, model, "door", duration=5.0, stiffness=500.0)


def test_a_coupling_of_which_every_model_is_refused_is_an_error(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = mujoco.MjModel.from_xml_string(DOOR.format(friction=0, peg=""))
    with hbot.connect(server.address) as rig, rig.lease():
        rig.load_scene({"name": "Nothing", "effect": []})
        rig.enable()
        post = rig._connection.post

        def late(op: str, fields: dict[str, Any]) -> bool:
            """Send what was computed from a state that is too old."""
            return post(op, {**fields, "tick": 1})

        monkeypatch.setattr(rig._connection, "post", late)
        eventually(lambda: rig.ping().tick > rig.info.limits.max_age_ticks + 1, "tick 1 is old")
        with pytest.raises(hbot.OutOfRange, match="max_age_ticks"):
            hbot.mujoco.run(rig, model, "door", duration=5.0)


def test_a_stiff_rig_does_not_make_a_light_body_heavy() -> None:
    """With the lead, a rig keeps 258 N m/rad stable; steps of 2 ms would need twice its inertia."""
    model = mujoco.MjModel.from_xml_string(BALL.format(joint="ball", peg=""))
    rig = simple_rig(258.0)
    body = hbot.mujoco.Hand(rig, model, "body")
    # A tenth of the sphere's inertia, and that of the box about its long axis.
    own = 0.1 / 3 * (0.005**2 + 0.005**2)
    assert body.stiffness == pytest.approx((0.1 * 3e-3 + own) * hbot.mujoco.EXPLICIT / 0.002**2)
    assert model.dof_armature[0] == pytest.approx(0.1 * 3e-3)
    stiff = hbot.mujoco.Hand(rig, model, "body", stiffness=100.0)
    assert stiff.stiffness == 100.0


@pytest.mark.parametrize("rate_hz", [60, 200])
def test_the_hand_pays_for_what_the_simulation_takes(rate_hz: int) -> None:
    """Turn a door with friction to and fro, and render its models at 1 kHz as the loop does."""
    body, size, pace = hand(friction=0.03), 0.6, 2.5
    rendered = 0.0
    for k in range(4 * rate_hz):
        begin = k / rate_hz
        state: Any = Still(begin, size * np.sin(pace * begin), size * pace * np.cos(pace * begin))
        model = body.update(state)
        stiffness, damping = (
            (np.eye(3) * np.array(matrix))[2, 2] for matrix in (model.stiffness, model.damping)
        )
        for tick in range(round(1000 / rate_hz)):
            now = begin + tick / 1000
            turn, rate = size * np.sin(pace * now) - state.angle, size * pace * np.cos(pace * now)
            torque = np.array(model.torque)[2] - stiffness * turn - damping * rate
            rendered -= torque * rate / 1000
    # Friction of 0.03 N m over 0.6 rad a quarter of a swing; the joint's damping adds a tenth.
    assert body.work == pytest.approx(0.03 * size * 4 * 4 * pace / (2 * np.pi), rel=0.15)
    assert rendered == pytest.approx(body.work, rel=0.05)


@pytest.mark.timeout(180)
@pytest.mark.parametrize("late", ["2 ms", "at random"])
@pytest.mark.parametrize("example", ["valve", "key"])
def test_the_energy_of_a_late_simulation_is_that_of_the_rig(
    start_server: Callable[..., Server],
    example: str,
    late: str,
    record_property: Callable[[str, object], None],
) -> None:
    """In virtual time and from one tick on, so that each run is the same on every machine.

    The simulated hand turns the sphere, up to the torque limit of the rig. At random, a model is 8
    ms late in the mean and up to 95 ms, as on a busy machine. The rig then takes up to a tenth more
    from the hand than the simulation knows of. It is not the sphere's way within an interval, which
    the simulation takes as straight: with each tick of it the difference is the same.
    From other ticks on, the hand turns the key on other ways, and the difference is 1 to 6 % with 2
    ms, and up to 8 % at random.
    """
    xml = runpy.run_path(str(EXAMPLES / f"mujoco_{example}.py"))
    model = mujoco.MjModel.from_xml_string(xml["VALVE" if example == "valve" else "LOCK"])
    random = np.random.default_rng(1)
    server = start_server(rate_hz=1000, options=["--time", "virtual"])
    with hbot.connect(server.address) as rig, rig.lease():
        # Until the first advance the server has run freely, and stops a few ticks later.
        rig.advance(1)
        free = rig.advance(1).tick
        assert free < BEGIN, "this machine was busy for seconds"
        while free < BEGIN:  # In pieces, each of which is answered in time.
            free = rig.advance(min(BEGIN - free, 5000)).tick
        simulated = {"hand": {}, "motor": MOTOR}
        rig.load_scene({"name": example, "effect": [], "simulate": simulated})
        rig.enable()
        state = begun = rig.advance(1000)
        body = hbot.mujoco.Hand(rig, model, example)
        while state.t < begun.t + 12.0:
            sent = body.update(state).fields()
            ticks = 2 if late == "2 ms" else int(min(random.exponential(8.0), 95.0))
            if ticks > 0:
                rig.advance(ticks)
            rig._connection.post("model", {**sent, "valid_ms": 100, "tick": state.tick})
            state = rig.advance(max(1, 5 - ticks))
        assert state.mode == "active", state.fault
        assert not [event for event in rig.events(0.0) if isinstance(event, hbot.RefusedEvent)]
    given = begun.energy - state.energy
    figures = f"{body.work:.4f} J in the simulation, {given:.4f} J by the rig"
    record_property(f"{example}, {late}", figures)
    assert given > 0.03, "the hand pays for friction and contacts"
    assert body.work == pytest.approx(given, rel=0.05 if late == "2 ms" else 0.1)


def test_the_programs_of_the_page_run(server: Server, capsys: pytest.CaptureFixture[str]) -> None:
    page = (REPOSITORY / "docs" / "clients.md").read_text("utf-8")
    blocks = re.findall(r"(?s)```python\n((?:hbot\.mujoco\.run|def each).*?)```", page)
    assert len(blocks) == 2
    named = {"hbot": hbot, "math": math}
    with hbot.connect(server.address) as rig, rig.lease():
        rig.load_scene({"name": "Nothing", "effect": []})
        rig.enable()
        for block in blocks:
            model = mujoco.MjModel.from_xml_string(DOOR.format(friction=0.03, peg=""))
            code = block.replace("60.0", "1.0").replace("valve", "door")
            exec(compile(code, "docs/clients.md", "exec"), {**named, "rig": rig, "model": model})
    assert len(capsys.readouterr().out.splitlines()) > 10
