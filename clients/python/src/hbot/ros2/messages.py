"""The messages of ROS that describe a rig, for the node and for bags alike.

Vectors and quaternions are in frame N, units are SI.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

FRAME, SPHERE = "N", "sphere"
"""Names of the frames, as in recordings."""
TYPES = {
    "pose": "geometry_msgs/msg/PoseStamped",
    "twist": "geometry_msgs/msg/TwistStamped",
    "wrench": "geometry_msgs/msg/WrenchStamped",
    "joint_states": "sensor_msgs/msg/JointState",
}
"""The type of each topic below `/hbot`."""
TF = "tf2_msgs/msg/TFMessage"
"""The type of the topic `/tf`."""


class Messages:
    """Builds the messages of one tick."""

    def __init__(
        self, types: Mapping[str, Any], reals: Callable[[Any], Any], joints: Sequence[str]
    ) -> None:
        """Use these classes of messages.

        Args:
            types: the classes by type name. All take their fields as named arguments.
            reals: makes what the class of a list of float64 wants from a sequence of numbers.
            joints: names of the joints.
        """
        self._types, self._reals, self._joints = types, reals, list(joints)

    def of_tick(
        self,
        stamp_ns: int,
        q: Sequence[float],
        omega: Sequence[float],
        torque: Sequence[float],
        joints: tuple[Sequence[float], Sequence[float], Sequence[float]],
    ) -> dict[str, Callable[[], Any]]:
        """Return the functions that make the message of each topic, by its name in `TYPES` or `tf`.

        Args:
            stamp_ns: Unix time of the tick, ns.
            q: orientation of the sphere, `(w, x, y, z)`.
            omega: its angular velocity, rad/s.
            torque: torque on the sphere, N m.
            joints: angles (rad), rates (rad/s) and torques (N m) of the joints.
        """
        make = self._make

        def header(frame: str = FRAME) -> Any:
            seconds, rest = divmod(stamp_ns, 10**9)
            time = make("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)
            return make("std_msgs/msg/Header", stamp=time, frame_id=frame)

        def vector(v: Sequence[float]) -> Any:
            return make("geometry_msgs/msg/Vector3", x=float(v[0]), y=float(v[1]), z=float(v[2]))

        def quaternion() -> Any:
            w, x, y, z = (float(part) for part in q)
            return make("geometry_msgs/msg/Quaternion", w=w, x=x, y=y, z=z)

        def pose() -> Any:
            point = make("geometry_msgs/msg/Point", x=0.0, y=0.0, z=0.0)
            pose = make("geometry_msgs/msg/Pose", position=point, orientation=quaternion())
            return make(TYPES["pose"], header=header(), pose=pose)

        def twist() -> Any:
            zero, turn = vector((0, 0, 0)), vector(omega)
            twist = make("geometry_msgs/msg/Twist", linear=zero, angular=turn)
            return make(TYPES["twist"], header=header(), twist=twist)

        def wrench() -> Any:
            zero, acting = vector((0, 0, 0)), vector(torque)
            wrench = make("geometry_msgs/msg/Wrench", force=zero, torque=acting)
            return make(TYPES["wrench"], header=header(), wrench=wrench)

        def joint_states() -> Any:
            position, velocity, effort = (self._reals(values) for values in joints)
            return make(
                TYPES["joint_states"],
                header=header(""),
                name=self._joints,
                position=position,
                velocity=velocity,
                effort=effort,
            )

        def tf() -> Any:
            turn = make(
                "geometry_msgs/msg/Transform", translation=vector((0, 0, 0)), rotation=quaternion()
            )
            stamped = make(
                "geometry_msgs/msg/TransformStamped",
                header=header(),
                child_frame_id=SPHERE,
                transform=turn,
            )
            return make(TF, transforms=[stamped])

        return {f.__name__: f for f in (pose, twist, wrench, joint_states, tf)}

    def _make(self, kind: str, /, **fields: Any) -> Any:
        return self._types[kind](**fields)
