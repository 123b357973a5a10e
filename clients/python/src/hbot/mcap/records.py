"""The records of a recording, also of one that is cut or damaged."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import IO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, McapRecord, Metadata
from mcap.stream_reader import MAGIC_SIZE, StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from zstandard import ZstdError

_LARGEST = 256 << 20
"""Largest record that is read, bytes. A damaged length must not fill the memory."""
_LARGEST_CHUNK = 16 << 20
"""Largest chunk before compression that is read, bytes. Few bytes can stand for many zeros."""
_HEAD = struct.Struct("<BQ")
"""The head of a record: its kind, and its length in bytes without the head."""
_FOOTER = struct.Struct("<9xQQI")
"""The last record: places of two parts of the index, and the check code of the index."""
_SKIPPED = (Opcode.HEADER, Opcode.ATTACHMENT)
"""Kinds of records that say nothing of the recording."""
_CODE = 4
"""Bytes of a check code."""
_DAMAGE = (McapError, ZstdError, struct.error, RuntimeError, ValueError, OverflowError, MemoryError)
"""What the reader of MCAP and its decompressors raise at bytes that are no record (lz4:
RuntimeError)."""


class Records:
    """Reads the metadata records of a file, and the records in its chunks."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self.complete = False
        """Whether the file ends as a recording does. Known after the last record."""
        self.damaged: list[str] = []
        """What is damaged, and the reason."""

    def __iter__(self) -> Iterator[McapRecord]:
        """Return the records up to the end, or to the place where the file is cut."""
        signature = self._file.read(MAGIC_SIZE)
        code = zlib.crc32(signature)
        strange = False
        while signature == MCAP0_MAGIC and len(head := self._file.read(_HEAD.size)) == _HEAD.size:
            kind, length = _HEAD.unpack(head)
            if length > _LARGEST:
                self.damaged.append(f"the rest: a record of {length} bytes")
                return
            body = self._file.read(length)
            if len(body) < length:
                return
            if kind == Opcode.DATA_END and length == _CODE:
                self._end(body, code)
                return
            code = zlib.crc32(body, zlib.crc32(head, code))
            if kind == Opcode.CHUNK:
                strange = False
                yield from self._chunk(body)
            elif kind == Opcode.METADATA:
                yield from self._metadata(body)
            elif kind not in _SKIPPED and not (kind == Opcode.MESSAGE_INDEX and _is_index(body)):
                # It may be what is left of a chunk. The first of several is named.
                if not strange:
                    self.damaged.append(f"an unexpected record of kind {kind}")
                strange = True

    def _chunk(self, body: bytes) -> list[McapRecord]:
        try:
            stream = ReadDataStream(BytesIO(body))
            chunk = Chunk.read(stream)
            if stream.count != len(body):
                raise ValueError(f"{len(body)} bytes instead of {stream.count}")
            if chunk.uncompressed_size > _LARGEST_CHUNK:
                raise ValueError(
                    f"{chunk.uncompressed_size} bytes, at most {_LARGEST_CHUNK} are read"
                )
        except _DAMAGE as wrong:
            self.damaged.append(f"a chunk: {_said(wrong)}")
            return []
        try:
            return breakup_chunk(chunk, validate_crc=True)
        except _DAMAGE as wrong:
            self.damaged.append(f"the chunk at {chunk.message_start_time} ns: {_said(wrong)}")
            return []

    def _metadata(self, body: bytes) -> list[McapRecord]:
        try:
            return [Metadata.read(ReadDataStream(BytesIO(body)))]
        except _DAMAGE as wrong:
            self.damaged.append(f"the metadata: {_said(wrong)}")
            return []

    def _end(self, body: bytes, code: int) -> None:
        """Compare the check code of all that precedes the index, and look for the end."""
        right = int.from_bytes(body, "little")
        if right not in (0, code) and not self.damaged:
            self.damaged.append(
                "the check code of the file is wrong, those of its chunks are right"
            )
        self._file.seek(-MAGIC_SIZE, os.SEEK_END)
        self.complete = self._file.read() == MCAP0_MAGIC


def _said(wrong: BaseException) -> str:
    """Return what an exception says, or its name if it says nothing."""
    return str(wrong) or type(wrong).__name__


def _is_index(body: bytes) -> bool:
    """Return whether `body` is the index of a chunk: a channel, a length, and as many bytes."""
    return body[2:6] == (len(body) - 6).to_bytes(8, "little", signed=True)[:4]


def index(file: IO[bytes]) -> list[McapRecord]:
    """Return the records of the index at the end, which say again which topic has which number.

    There are none if the file has no index, or if the check code of the index is wrong. The
    position stays as it was.
    """
    here = file.tell()
    try:
        size = file.seek(0, os.SEEK_END) - MAGIC_SIZE
        file.seek(max(0, size - _FOOTER.size))
        start, _, right = _FOOTER.unpack(file.read(_FOOTER.size))
        if not 0 < start < size <= start + _LARGEST:
            return []
        file.seek(start)
        read = file.read(size - start)
        if zlib.crc32(read[:-_CODE]) != right:
            return []
        return list(StreamReader(BytesIO(read + MCAP0_MAGIC), skip_magic=True).records)
    except _DAMAGE:
        return []
    finally:
        file.seek(here)
