"""Turns a recording (MCAP) into arrays of numpy. Needs the extra `mcap`.

    recording = hbot.mcap.read("run.mcap", topics=["/hbot/state"])
    state = recording["/hbot/state"]
    state["t"], state["torque"]  # shapes (n,) and (n, 3)

It reads the files of `hbot server --record` and `hbot record`, flight logs, and what `hbot replay`
writes. docs/recordings.md describes the topics.
"""

from ..errors import MissingExtra

try:
    from .reading import Gap, Recording, read
except ImportError as missing:
    raise MissingExtra.of("hbot.mcap", "mcap", missing) from missing

__all__ = ["Gap", "Recording", "read"]
