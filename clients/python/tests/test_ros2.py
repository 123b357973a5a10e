"""The node and the bags of ROS 2, with the real rclpy and rosbags.

Left out without rclpy; in `.ci/python.sh` that is a failure.
"""

from __future__ import annotations

import functools
import json
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from serving import RATE_HZ, Server, eventually

import hbot
import hbot.mcap

if not os.environ.get("CI"):
    pytest.importorskip("rclpy", reason="the extra ros2 is installed in CI")

# Nothing leaves this machine, and other nodes on it are not heard.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 100)

import rclpy
import rclpy.context
import rclpy.executors
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from rclpy.qos import qos_profile_sensor_data
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from hbot.ros2.node import arguments

OLDER = 3
"""Poses between the two that are named: so few that a busy rig seldom waits between them."""
PUSH = 0.02
"""Torque of the commands, N m. So little that no limit of the prototype changes it."""


class Peer:
    """A node of a user, and the program in a separate process."""

    def __init__(self, server: Server, folder: Path, *options: str) -> None:
        """Start both."""
        self._log = folder / "ros2.log"
        command = [sys.executable, "-m", "hbot.ros2", server.address, *options]
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(command, stdout=log, stderr=log)
        self.context: Any = rclpy.context.Context()
        rclpy.init(context=self.context)
        self.node: Any = rclpy.create_node("peer", context=self.context)
        self.executor: Any = rclpy.executors.SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def log(self) -> str:
        """Return what the program has printed."""
        return self._log.read_text(errors="replace")

    def collect(self, kind: Any, topic: str) -> list[Any]:
        """Return the list to which the messages of a topic come."""
        taken: list[Any] = []
        self.node.create_subscription(kind, topic, taken.append, qos_profile_sensor_data)
        return taken

    def publisher(self, kind: Any, topic: str) -> Any:
        """Return a publisher."""
        return self.node.create_publisher(kind, topic, qos_profile_sensor_data)

    def until(self, condition: Callable[[], object], what: str) -> None:
        """Spin until `condition` returns something true."""

        def spun() -> object:
            assert self.process.poll() is None, self.log()
            for _ in range(20):
                self.executor.spin_once(timeout_sec=0.01)
            return condition()

        eventually(spun, what)


PEERS: list[Peer] = []
"""Keeps a node from being freed: to free one sometimes crashes inside Fast DDS 2.14."""


def with_peer(test: Callable[[Server, Peer], None]) -> Callable[[Server, Path], None]:
    """Run a test with a peer that takes commands, in a process of its own that frees nothing."""

    def inside(server: Server, folder: Path) -> None:
        peer = Peer(server, folder, "--command", "--scene", "hinge")
        PEERS.append(peer)
        try:
            test(server, peer)
        finally:
            peer.process.terminate()
            peer.process.wait(10.0)

    @functools.wraps(test)
    def outside(server: Server, tmp_path: Path) -> None:
        process = multiprocessing.get_context("fork").Process(
            target=inside, args=(server, tmp_path), daemon=True
        )
        process.start()
        process.join()
        assert process.exitcode == 0, "the captured output says why"

    del outside.__wrapped__  # pytest would ask the test for its fixtures
    return outside


def nanoseconds(message: Any) -> int:
    """Return the stamp of a message, ns."""
    return int(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)


def test_options_of_ros_come_last() -> None:
    ros = ["--ros-args", "-r", "__ns:=/left"]
    for given, address in [
        ([], "127.0.0.1:4268"),
        (["10.0.0.2:4268", "--command"], "10.0.0.2:4268"),
    ]:
        options, rest = arguments([*given, *ros])
        assert (options.address, rest) == (address, ros)
    with pytest.raises(SystemExit):
        arguments(["127.0.0.1:4268", "-r", "__ns:=/left"])


@with_peer
def test_states_come_with_stamps_and_names(server: Server, peer: Peer) -> None:
    poses, twists, joints, wrenches = (
        peer.collect(kind, f"/hbot/{topic}")
        for kind, topic in (
            (PoseStamped, "pose"),
            (TwistStamped, "twist"),
            (JointState, "joint_states"),
            (WrenchStamped, "wrench"),
        )
    )
    peer.until(lambda: min(map(len, (poses, twists, joints, wrenches))) > 50, "50 of each")
    assert poses[-1].header.frame_id == twists[-1].header.frame_id == "N"
    orientation = poses[-1].pose.orientation
    norm = sum(part**2 for part in (orientation.w, orientation.x, orientation.y, orientation.z))
    assert norm == pytest.approx(1.0, abs=1e-6)
    assert joints[-1].name[:2] == ["A.steer", "A.drive"]
    assert len(joints[-1].position) == len(joints[-1].effort) == len(joints[-1].name)
    with hbot.connect(server.address) as rig:
        clock = rig.info.clock
    assert clock is not None
    ticks = [
        (
            (pose.header.stamp.sec - clock.unix_ns // 10**9) * 10**9
            + pose.header.stamp.nanosec
            - clock.unix_ns % 10**9
        )
        * RATE_HZ
        / 1e9
        for pose in poses
    ]
    # Stamps are the times of ticks; the clock may move between, by whole ticks.
    assert all(abs(tick - round(tick)) < 1e-3 for tick in ticks), ticks[:3]


@with_peer
def test_a_command_is_as_old_as_the_pose_that_it_names(server: Server, peer: Peer) -> None:
    poses = peer.collect(PoseStamped, "/hbot/pose")
    commands = peer.publisher(WrenchStamped, "/hbot/command/wrench")
    peer.until(lambda: commands.get_subscription_count(), "the program takes commands")
    exact: list[bool] = []
    with hbot.connect(server.address, name="watch") as rig:

        def tick(pose: Any) -> int | None:
            """Command with the stamp of a pose. Returns the tick from which its age counts."""
            message = WrenchStamped()
            message.header = pose.header
            message.wrench.torque.z = PUSH
            known = next(rig.states()).client
            commands.publish(message)
            for state in islice(rig.states(), 200):
                if state.client is not None and (known is None or state.client.seq != known.seq):
                    return state.tick - state.client.age_ticks
            return None  # Refused as too old, on a busy machine.

        def compared() -> bool:
            if len(poses) > OLDER:
                named = poses[-1], poses[-1 - OLDER]
                apart = nanoseconds(named[0]) - nanoseconds(named[1])
                newer, older = map(tick, named)
                if newer is not None and older is not None:
                    exact.append(newer - older == round(apart * RATE_HZ / 1e9))
            return sum(exact) >= 5

        peer.until(compared, "the age counts from the pose that was named")
    assert "command:" not in peer.log()


@with_peer
def test_models_act_and_bad_commands_are_warnings(server: Server, peer: Peer) -> None:
    poses = peer.collect(PoseStamped, "/hbot/pose")
    models = peer.publisher(String, "/hbot/command/model")
    wrenches = peer.publisher(WrenchStamped, "/hbot/command/wrench")
    peer.until(lambda: models.get_subscription_count() and poses, "the program takes models")
    plane = {"normal": [0, 0, 1], "offset": 0.1, "stiffness": 0.5, "damping": 0.01}

    def send(**fields: Any) -> None:
        models.publish(String(data=json.dumps(fields)))

    with hbot.connect(server.address, name="watch") as rig:

        def rendered() -> bool:
            stamp = poses[-1].header.stamp
            send(
                stamp=[stamp.sec, stamp.nanosec], torque=[0, 0, PUSH], damping=0.01, planes=[plane]
            )
            return next(rig.states()).client is not None

        peer.until(rendered, "a model acts")
    for bad, said in (
        ({"stifness": 1.0}, "legal: a JSON map of blend_ms"),
        ({"stamp": [1, 0], "stiffness": 1.0}, "has the stamp 1.000000000 s"),
        ({"stiffness": [[1, 1, 0], [0, 1, 0], [0, 0, 1]]}, "symmetric"),
        ({"stiffness": "much"}, "command:"),
        ({"torque": [10**400, 0, 0]}, "command: int too large"),
    ):
        peer.until(lambda bad=bad, said=said: send(**bad) or said in peer.log(), said)  # type: ignore[misc, func-returns-value]
    message = WrenchStamped()
    message.header.frame_id = "base_link"

    def refused() -> bool:
        wrenches.publish(message)
        return "frame_id is 'base_link'; legal: 'N' or none" in peer.log()

    peer.until(refused, "a command in another frame is refused")
    before = len(poses)
    peer.until(lambda: len(poses) > before + 10, "states still come")


def test_the_end_of_taking_commands_ends_the_program(server: Server) -> None:
    code = "from hbot.ros2 import node; node.SingleThreadedExecutor.spin = lambda _: 1 / 0; "
    command = [sys.executable, "-c", f"{code} node.main()", server.address]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    assert done.returncode == 1
    assert "ZeroDivisionError" in done.stderr


def test_a_server_that_is_missing_is_one_line(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hbot.ros2", "127.0.0.1:1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("error: no connection to 127.0.0.1:1")
    assert len(done.stderr.splitlines()) == 1


def test_a_recording_becomes_a_bag(tmp_path: Path) -> None:
    recording, bag = tmp_path / "run.mcap", tmp_path / "bag"
    server = Server(tmp_path, options=["--record", str(recording), "--duration", "1"])
    server.process.wait(20.0)
    command = [sys.executable, "-m", "hbot.ros2.bag", str(recording), str(bag)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    state = hbot.mcap.read(recording)["/hbot/state"]
    assert done.stdout == f"{bag}: {len(state['t'])} states\n"
    assert done.stderr == ""
    with AnyReader([bag]) as reader:
        assert {name: len(state["t"]) for name in reader.topics} == {
            name: reader.topics[name].msgcount
            for name in ("/hbot/pose", "/hbot/twist", "/hbot/wrench", "/hbot/joint_states", "/tf")
        }
        connections = [c for c in reader.connections if c.topic == "/hbot/joint_states"]
        for k, (connection, time, raw) in enumerate(reader.messages(connections)):
            message: Any = reader.deserialize(raw, connection.msgtype)
            stamp = message.header.stamp
            assert time == stamp.sec * 10**9 + stamp.nanosec == state["log_time"][k]
            assert message.position.tolist() == state["joint_angle"][k].tolist()
        connections = [c for c in reader.connections if c.topic == "/tf"]
        for k, (connection, _, raw) in enumerate(reader.messages(connections)):
            (transform,) = reader.deserialize(raw, connection.msgtype).transforms  # type: ignore[attr-defined]
            turn = transform.transform.rotation
            assert [turn.w, turn.x, turn.y, turn.z] == state["q"][k].tolist()
    again = subprocess.run(command, capture_output=True, text=True, check=False)
    assert again.returncode == 1
    assert again.stderr == f"error: {bag} exists already\n"
