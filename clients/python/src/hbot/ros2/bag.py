"""The program `python -m hbot.ros2.bag`: makes a bag of ROS 2 from a recording."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..errors import IllegalInput, MissingExtra
from ..program import one_line_errors
from .messages import TF, TYPES, Messages


def convert(recording: Path, bag: Path) -> int:
    """Write the states of a recording to a bag, a folder. Returns their number.

    The topics are those of the node, and `/tf`. Stamps are the Unix times of the ticks.

    Raises:
        OSError: a file cannot be read or written.
        IllegalInput: the file is no recording of hbot, or the folder exists.
    """
    try:
        import numpy as np
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore

        from ..mcap import read
    except ImportError as missing:
        raise MissingExtra.of("hbot.ros2.bag", "ros2", missing) from missing
    if bag.exists():
        raise IllegalInput(f"{bag} exists already")
    run = read(recording, "/hbot/state")
    state = run["/hbot/state"]
    store = get_typestore(Stores.ROS2_JAZZY)
    messages = Messages(store.types, np.asarray, run.joints)
    topics = {name: (f"/hbot/{name}", kind) for name, kind in TYPES.items()} | {"tf": ("/tf", TF)}
    rows = zip(
        state["log_time"].tolist(),
        state["q"],
        state["omega"],
        state["torque"],
        zip(state["joint_angle"], state["joint_rate"], state["joint_torque"], strict=True),
        strict=True,
    )
    with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {
            name: writer.add_connection(topic, kind, typestore=store)
            for name, (topic, kind) in topics.items()
        }
        for row in rows:
            for name, make in messages.of_tick(*row).items():
                data = store.serialize_cdr(make(), topics[name][1])
                writer.write(connections[name], row[0], data)
    if not run.complete or run.damaged:
        print("the recording has no end or is damaged: the bag has what is left", file=sys.stderr)
    return len(state["t"])


def main() -> None:
    """Run the program."""
    parser = argparse.ArgumentParser(
        prog="python -m hbot.ros2.bag",
        description="Make a bag of ROS 2 (MCAP) from a recording.",
    )
    parser.add_argument("recording", type=Path, help="the recording, such as run.mcap")
    parser.add_argument("bag", type=Path, help="the folder of the bag, which must not exist")
    options = parser.parse_args()
    with one_line_errors():
        print(f"{options.bag}: {convert(options.recording, options.bag)} states")


if __name__ == "__main__":
    main()
