"""States as arrays of numpy, for logs and plots. Needs the extra `numpy`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from .errors import MissingExtra
from .events import State

if TYPE_CHECKING:
    import numpy


def columns(states: Iterable[State]) -> dict[str, numpy.ndarray[Any, Any]]:
    """Return one array for each quantity of n states. The first axis counts the states.

    Returns:
        `tick`, `t` (s), `energy` (J), `slip` (m/s), `scale`, `traction`: shape (n,). `mode`: texts,
        shape (n,). `q` (w, x, y, z): shape (n, 4). `omega` (rad/s), `torque` (N m), in frame N:
        shape (n, 3). `joint_angle` (rad), `joint_rate` (rad/s), `joint_torque` (N m): shape
        (n, joints), steer and drive of the first wheel, then of the next.

    Raises:
        MissingExtra: numpy is not installed.
    """
    try:
        import numpy
    except ImportError as missing:
        raise MissingExtra.of("hbot.arrays", "numpy", missing) from missing
    kept = list(states)
    names = ("tick", "t", "mode", "q", "omega", "torque", "energy", "slip", "scale", "traction")
    arrays = {name: numpy.array([getattr(state, name) for state in kept]) for name in names}
    for name in ("angle", "rate", "torque"):
        arrays[f"joint_{name}"] = numpy.array(
            [[getattr(joint, name) for joint in state.joints] for state in kept]
        )
    return arrays
