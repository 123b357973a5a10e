"""Reads a recording. Much of it can be read also if it is cut or damaged; the result says so."""

from __future__ import annotations

import math
import os
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import IO, Any, TypeAlias

from mcap.records import Channel, McapRecord, Message, Metadata, Schema
from mcap_protobuf.decoder import DecoderFactory

from ..errors import IllegalInput
from ..events import DroppedEvent
from .records import Records, index
from .topics import EVENT, EXACT, STATE, TOPICS, Array, Topic, event_of, missing_steps

METADATA = "hbot"
"""Name of the metadata record of a recording."""
LOST = "hbot.lost"
"""Name of the record that `hbot recover` writes in the place of what it could not read."""
Decode: TypeAlias = Callable[[bytes], Any]


@dataclass(frozen=True)
class Gap:
    """Ticks that a recording lacks, because the loop skipped them or the recorder lost them."""

    t: float
    """Time of the first tick after the gap, s."""
    ticks: int
    """Number of ticks that are missing."""


@dataclass(frozen=True)
class Recording(Mapping[str, Mapping[str, Array]]):
    """The arrays of a recording by topic, as `recording["/hbot/state"]["torque"]`.

    The first axis of each array counts the messages. Every topic has `log_time`, the Unix time in
    ns, and `t`, the time since tick 0 in s. The others have the names of docs/api.md, with the
    units and frames of that page; docs/recordings.md lists them. A number that is absent in a
    message is NaN, a text is empty.
    """

    topics: Mapping[str, Mapping[str, Array]]
    """The arrays by topic and name."""
    joints: tuple[str, ...]
    """Names of the joints, in the order of the second axis of their arrays."""
    metadata: Mapping[str, str]
    """The metadata record `hbot`: versions, rig file, first scene, clock."""
    gaps: tuple[Gap, ...]
    """Where ticks are missing among those that were read."""
    lost_ticks: int
    """Ticks that a replay lacks, because the recorder was too slow."""
    dropped: int
    """States that the server dropped because the recording client (`hbot record`) was too slow."""
    complete: bool
    """Whether the file has its end. False: the server was killed, it still records, or the file is
    damaged so that its end is not found."""
    damaged: tuple[str, ...]
    """What is damaged, and the reason. Messages of a damaged chunk are missing."""

    def __getitem__(self, topic: str) -> Mapping[str, Array]:
        """Return the arrays of a topic."""
        return self.topics[topic]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the topics."""
        return iter(self.topics)

    def __len__(self) -> int:
        """Return the number of topics."""
        return len(self.topics)

    def __repr__(self) -> str:
        """Return the number of messages of each topic, without the arrays."""
        counts = [f"{name}: {len(arrays['t'])}" for name, arrays in self.topics.items()]
        return f"Recording({', '.join(counts)})"


def read(
    path: str | os.PathLike[str],
    topics: str | Iterable[str] | None = None,
    *,
    start: float | None = None,
    end: float | None = None,
) -> Recording:
    """Read a recording.

    Args:
        path: the file.
        topics: names of the topics to read, or the name of one. None: all public topics. Fewer are
            read faster.
        start: leave out messages before this time, s since tick 0.
        end: leave out messages from this time on, s since tick 0.

    Raises:
        OSError: the file cannot be read.
        IllegalInput: the file is no recording of hbot, or its metadata are damaged.
        ValueError: there is no such topic.
    """
    if isinstance(topics, str):
        topics = (topics,)
    wanted = tuple(TOPICS if topics is None else topics)
    if unknown := [name for name in wanted if name not in TOPICS]:
        raise ValueError(f"{unknown[0]!r} is no topic; legal: {', '.join(TOPICS)}")
    with open(path, "rb") as file:
        reader = _Reader(file, wanted, start, end)
        try:
            reader.run()
        except ValueError as wrong:  # For example, the metadata name fewer joints than a state has.
            raise IllegalInput(f"{os.fspath(path)} is damaged: {wrong}") from wrong
    if not reader.metadata:
        raise IllegalInput(
            f"{os.fspath(path)} is no recording of hbot, or its metadata are missing or damaged"
        )
    return reader.result()


class _Reader:
    """Reads one file."""

    def __init__(
        self, file: IO[bytes], wanted: tuple[str, ...], start: float | None, end: float | None
    ) -> None:
        self._file = file
        self._records = Records(file)
        self._wanted = wanted
        self._first = -math.inf if start is None else start * 1e9
        self._end = math.inf if end is None else end * 1e9
        self._decoders = DecoderFactory()
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, tuple[str, Decode | None]] = {}
        self._indexed = False
        self._topics: dict[str, Topic] = {}
        self._states = array("q")  # Their times, also if the topic is not wanted: for the gaps.
        self._tick_0: int | None = None
        self._lost = self._dropped = 0
        self._cut = False
        self.metadata: dict[str, str] = {}

    def run(self) -> None:
        """Read to the end, or to the place where the file is cut."""
        for record in self._records:
            self._take(record)

    def _take(self, record: McapRecord) -> None:
        if isinstance(record, Message):
            self._message(record)
        elif isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            schema = self._schemas.get(record.schema_id)
            decode = self._decoders.decoder_for(record.message_encoding, schema)
            self._channels[record.id] = (record.topic, decode)
        elif isinstance(record, Metadata) and record.name == METADATA:
            self.metadata = record.metadata
            joints = len(record.metadata.get("joints", "").split())
            self._topics = {name: Topic(name, joints) for name in self._wanted}
            clock = record.metadata.get("clock_unix_ns")
            if clock is not None and clock.isdecimal():
                self._tick_0 = int(clock)
        elif isinstance(record, Metadata) and record.name == LOST:
            if (why := record.metadata.get("damaged")) is None:
                self._cut = True
            else:
                self._records.damaged.append(why)

    def _message(self, record: Message) -> None:
        name, decode = self._channels.get(record.channel_id, ("", None))
        if decode is None and not self._indexed:
            # The chunk that says which topic this is, or what its messages look like, was damaged.
            self._indexed = True
            for again in index(self._file):
                self._take(again)
            name, decode = self._channels.get(record.channel_id, ("", None))
        if decode is None:
            return
        if self._tick_0 is None and name == STATE:
            # `hbot record` does not store the clock, but a state has both times.
            self._tick_0 = record.log_time - round(decode(record.data).t * 1e9)
        if not self._first <= record.log_time - (self._tick_0 or 0) < self._end:
            return
        if name in self._topics:
            self._topics[name].add(record.log_time, decode(record.data))
        if name == STATE:
            self._states.append(record.log_time)
        elif name == EXACT:
            self._lost += decode(record.data).lost_ticks
        elif name == EVENT:
            event = event_of(decode(record.data))
            self._dropped += event.count if isinstance(event, DroppedEvent) else 0

    def result(self) -> Recording:
        """Return what was read."""
        tick_0 = self._tick_0 or 0
        return Recording(
            topics={name: topic.arrays(tick_0) for name, topic in self._topics.items()},
            joints=tuple(self.metadata.get("joints", "").split()),
            metadata=self.metadata,
            gaps=tuple(
                Gap((self._states[k] - tick_0) * 1e-9, missing)
                for k, missing in missing_steps(self._states)
            ),
            lost_ticks=self._lost,
            dropped=self._dropped,
            complete=self._records.complete and not self._cut,
            damaged=tuple(self._records.damaged),
        )
