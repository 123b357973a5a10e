"""The node of the program `python -m hbot.ros2`."""

from __future__ import annotations

import argparse
import json
import sys
import threading
from array import array
from collections.abc import Callable
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Any

from ..connection import no_state
from ..environment import server_address
from ..errors import HbotError, MissingExtra
from ..events import Event, FaultEvent, LeaseEvent, LostEvent, RefusedEvent, State
from ..models import Plane
from ..opening import connect
from ..rig import Rig
from .messages import TF, TYPES, Messages

try:
    import geometry_msgs.msg
    import rclpy
    import rclpy.utilities
    import sensor_msgs.msg
    import std_msgs.msg
    from builtin_interfaces.msg import Time
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import qos_profile_sensor_data
    from rclpy.signals import SignalHandlerOptions
except ImportError as missing:
    raise MissingExtra.of("hbot.ros2", "ros2", missing) from missing
try:
    import tf2_msgs.msg
except ImportError:  # pip has no package of it; an installation of ROS has.
    tf2_msgs = None

KEPT = 4096
"""Number of ticks whose stamps a command can name."""
CLOCK_S = 1.0
"""Time between two questions for the server's clock, s."""
MODEL_FIELDS = {"torque", "stiffness", "damping", "pose", "planes", "blend_ms", "soften"}


def types() -> dict[str, Any]:
    """Return the classes of messages by type name."""
    packages = (geometry_msgs, sensor_msgs, std_msgs, *([tf2_msgs] if tf2_msgs else []))
    found = {
        f"{package.__name__}/msg/{name}": kind
        for package in packages
        for name, kind in vars(package.msg).items()
    }
    return found | {"builtin_interfaces/msg/Time": Time}


class Bridge:
    """Publishes states, and passes commands on."""

    def __init__(self, node: Any, rig: Rig, valid_ms: int) -> None:
        """Publish with `node`. Commands are valid for `valid_ms`."""
        self._node, self._rig, self._valid_ms = node, rig, valid_ms
        known = types()
        joints = [
            f"{wheel.name or chr(ord('A') + k)}.{joint}"
            for k, wheel in enumerate(rig.info.rig.wheels)
            for joint in ("steer", "drive")
        ]
        self._messages = Messages(known, partial(array, "d"), joints)
        self._publishers = {
            name: node.create_publisher(known[kind], f"~/{name}", qos_profile_sensor_data)
            for name, kind in TYPES.items()
        }
        if TF in known:
            self._publishers["tf"] = node.create_publisher(known[TF], "/tf", 100)
        # The tick of each stamp that was published, the oldest first.
        self._ticks: dict[int, int] = {}
        self._sent = self._tick_0 = 0
        self.follow()

    def take_commands(self) -> None:
        """Begin to take commands."""
        for name, kind, take in (
            ("wrench", geometry_msgs.msg.WrenchStamped, self._wrench),
            ("model", std_msgs.msg.String, self._model),
        ):
            self._node.create_subscription(
                kind, f"~/command/{name}", partial(self._take, take), qos_profile_sensor_data
            )

    def follow(self) -> None:
        """Ask the server for its clock, which moves if a simulated rig waits for the machine."""
        with suppress(HbotError):  # The thread that publishes reports the end.
            told = self._rig.refresh().clock
            self._tick_0 = 0 if told is None else told.unix_ns

    def publish(self, state: State) -> None:
        """Publish one state to those topics that somebody listens to."""
        stamp = self._tick_0 + round(state.t * 1e9)
        self._ticks[stamp] = state.tick
        if len(self._ticks) > KEPT:
            del self._ticks[next(iter(self._ticks))]
        joints = (
            [joint.angle for joint in state.joints],
            [joint.rate for joint in state.joints],
            [joint.torque for joint in state.joints],
        )
        made = self._messages.of_tick(stamp, state.q, state.omega, state.torque, joints)
        for name, publisher in self._publishers.items():
            if publisher.get_subscription_count() > 0:
                publisher.publish(made[name]())

    def _take(self, take: Callable[[Any], None], message: Any) -> None:
        """Pass a command on. One that is not legal is a warning, and changes nothing."""
        try:
            take(message)
        except Exception as error:  # Whatever a message holds, those after it are taken.
            self._node.get_logger().warning(f"command: {error}", throttle_duration_sec=1.0)

    def _wrench(self, message: Any) -> None:
        torque, frame = message.wrench.torque, message.header.frame_id
        if frame not in ("", "N"):
            raise ValueError(f"frame_id is {frame!r}; legal: 'N' or none")
        stamp = message.header.stamp
        tick = self._tick(stamp.sec, stamp.nanosec)
        self._sent += 1
        values = (torque.x, torque.y, torque.z)
        self._rig.torque(values, self._valid_ms, tick=tick, seq=self._sent, wait=False)

    def _model(self, message: Any) -> None:
        fields = json.loads(message.data)
        if not isinstance(fields, dict) or set(fields) - MODEL_FIELDS - {"stamp"}:
            legal = ", ".join(sorted(MODEL_FIELDS | {"stamp"}))
            raise ValueError(f"{message.data[:60]!r} is no model; legal: a JSON map of {legal}")
        tick = self._tick(*fields.pop("stamp", (0, 0)))
        fields["planes"] = [Plane(**plane) for plane in fields.get("planes", ())]
        self._sent += 1
        self._rig.model(self._valid_ms, **fields, tick=tick, seq=self._sent, wait=False)

    def _tick(self, seconds: int, nanoseconds: int) -> int | None:
        """Return the tick of a stamp. None for the stamp 0."""
        stamp = seconds * 10**9 + nanoseconds
        if stamp == 0:
            return None
        if (tick := self._ticks.get(stamp)) is None:
            raise ValueError(
                f"no state of the last {KEPT} has the stamp {seconds}.{nanoseconds:09} s; "
                "legal: that of the pose from which the command was computed, or 0"
            )
        return tick


def log(node: Any, event: Event) -> None:
    """Log what a user of the node should know."""
    stolen = isinstance(event, LeaseEvent) and event.cause == "stolen"
    if stolen or isinstance(event, FaultEvent | RefusedEvent | LostEvent):
        node.get_logger().warning(str(event))


def arguments(given: list[str] | None = None) -> tuple[argparse.Namespace, list[str]]:
    """Return the options of the command line, and those of ROS (`--ros-args` and what follows)."""
    parser = argparse.ArgumentParser(
        prog="python -m hbot.ros2", description="Publish an Hbot as a node of ROS 2."
    )
    parser.add_argument(
        "address", nargs="?", help="the server; default: HBOT_SERVER or 127.0.0.1:4268"
    )
    parser.add_argument("--every", type=int, default=1, help="ticks from state to state, from 1")
    parser.add_argument(
        "--command",
        action="store_true",
        help="take the lease, enable the rig, and take torques and models",
    )
    parser.add_argument("--scene", help="scene file or ready-made scene to load with --command")
    parser.add_argument(
        "--valid-ms", type=int, default=50, help="validity of a command, 1 to 1000 ms; default: 50"
    )
    parser.add_argument(
        "--token-file", type=Path, help="file with the server's token; default: HBOT_TOKEN_FILE"
    )
    parser.add_argument("--ca", type=Path, help="certificate of the server, if it encrypts (PEM)")
    given = sys.argv[1:] if given is None else given
    ours = given.index("--ros-args") if "--ros-args" in given else len(given)
    options, ros = parser.parse_args(given[:ours]), given[ours:]
    if options.scene and not options.command:
        parser.error("--scene needs --command")
    if options.every < 1:
        parser.error(f"--every {options.every}; legal: 1 or more")
    if not 1 <= options.valid_ms <= 1000:
        parser.error(f"--valid-ms {options.valid_ms}; legal: 1 to 1000 ms")
    try:
        options.address = server_address(options.address)
    except ValueError as error:
        parser.error(str(error))
    return options, ros


def spin(executor: Any, rig: Rig) -> None:
    """Take commands. If an exception ends that, the program ends too. Runs in a thread."""
    try:
        executor.spin()
    except BaseException:
        rig.close()
        raise


def run(options: argparse.Namespace, ros: list[str]) -> None:
    """Publish until Ctrl-C.

    Raises:
        HbotError, OSError: the server refuses this program or has gone.
    """
    rclpy.init(args=ros, signal_handler_options=SignalHandlerOptions.NO)
    with ExitStack() as stack:
        stack.callback(rclpy.utilities.try_shutdown)
        node: Any = rclpy.create_node("hbot")
        rig = stack.enter_context(
            connect(
                options.address,
                name="ros2",
                token=options.token_file,
                tls=options.ca,
                on_event=partial(log, node),
            )
        )
        bridge = Bridge(node, rig, options.valid_ms)
        if options.command:
            stack.enter_context(rig.lease())
            if options.scene:
                rig.load_scene(options.scene)
            rig.enable()
            bridge.take_commands()
        node.create_timer(CLOCK_S, bridge.follow)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        threading.Thread(target=spin, args=(executor, rig), daemon=True).start()
        stack.callback(executor.shutdown)
        node.get_logger().info(f"{rig.info.rig.name} at {options.address}")
        # The newest state, so that a slow machine leaves states out and nothing gets older.
        with rig._subscription(options.every) as (states, wait):
            while (state := states.newest(wait)[0]) is not None:
                bridge.publish(state)
            raise no_state(wait)


def main() -> None:
    """Run the program."""
    options, ros = arguments()
    with suppress(KeyboardInterrupt):
        run(options, ros)
