"""Messages to bytes and bytes to messages, in both encodings. No I/O happens here.

JSON: one object on one line. MessagePack: a length of four bytes, most significant first, then a
    map.
"""

from __future__ import annotations

import json
import reprlib
from collections.abc import Callable
from typing import Any, Literal, TypeAlias

from .errors import MissingExtra, ProtocolError

Encoding: TypeAlias = Literal["json", "msgpack"]

VERSION = 1
"""Version of the messages that this package speaks."""

MAX_ANSWER_BYTES = 1 << 20
"""Largest message of a server, bytes."""

MAX_STREAM_BYTES = 2048
"""Largest message of a stream, bytes, with the newline of a line, without the length of a map."""

LENGTH_BYTES = 4
"""Bytes of the length before a map."""


def encode_json(message: dict[str, Any]) -> bytes:
    """Return a message as one line of JSON.

    Raises:
        ValueError: a number is not finite.
    """
    try:
        text = json.dumps(message, allow_nan=False, separators=(",", ":"), default=_plain)
    except ValueError:
        for key, value in message.items():
            if not _is_finite(value):
                told = f"{key} is {reprlib.repr(value)}; every number must be finite"
                raise ValueError(told) from None
        raise
    return text.encode() + b"\n"


def _is_finite(value: Any) -> bool:
    try:
        json.dumps(value, allow_nan=False, default=_plain)
    except ValueError:
        return False
    return True


def encoder(encoding: Encoding) -> Callable[[dict[str, Any]], bytes]:
    """Return the function that encodes messages.

    Raises:
        MissingExtra: MessagePack is asked for and its package is not installed.
        ValueError: there is no such encoding.
    """
    if encoding == "json":
        return encode_json
    if encoding != "msgpack":
        raise ValueError(f'encoding is {encoding!r}; legal: "json", "msgpack"')
    pack = _msgpack().packb

    def encode(message: dict[str, Any]) -> bytes:
        body = pack(message, default=_plain)
        return len(body).to_bytes(LENGTH_BYTES, "big") + bytes(body)

    return encode


class Splitter:
    """Finds messages in the bytes of a connection, in whatever pieces they arrive."""

    def __init__(self, encoding: Encoding) -> None:
        """Create a splitter without bytes."""
        self._buffer = bytearray()
        self._next = self._next_line if encoding == "json" else self._next_frame
        self._unpack: Callable[[bytes], Any] = (
            json.loads if encoding == "json" else lambda body: _msgpack().unpackb(body, raw=False)
        )

    def push(self, data: bytes) -> list[dict[str, Any]]:
        """Take bytes that have arrived. Return the messages that are complete now, in their order.

        Raises:
            ProtocolError: a message is longer than a server's can be, or is no map.
        """
        self._buffer += data
        messages = []
        while (body := self._next()) is not None:
            messages.append(self._read(body))
        if len(self._buffer) > MAX_ANSWER_BYTES + LENGTH_BYTES:
            raise ProtocolError(f"the server sent a message of more than {MAX_ANSWER_BYTES} bytes")
        return messages

    def _read(self, body: bytes) -> dict[str, Any]:
        try:
            message = self._unpack(body)
        except Exception as error:  # The decoders raise many kinds, and all mean the same.
            raise ProtocolError(
                f"the server sent a message that cannot be read: {error}"
            ) from error
        if not isinstance(message, dict):
            raise ProtocolError(f"the server sent {type(message).__name__} in place of a map")
        return message

    def _next_line(self) -> bytes | None:
        while (end := self._buffer.find(b"\n")) >= 0:
            line = bytes(self._buffer[:end])
            del self._buffer[: end + 1]
            if line.strip():
                return line
        return None

    def _next_frame(self) -> bytes | None:
        end = LENGTH_BYTES + int.from_bytes(self._buffer[:LENGTH_BYTES], "big")
        if end > MAX_ANSWER_BYTES + LENGTH_BYTES:
            raise ProtocolError(f"the server announced a message of {end - LENGTH_BYTES} bytes")
        if len(self._buffer) < max(end, LENGTH_BYTES):
            return None
        frame = bytes(self._buffer[LENGTH_BYTES:end])
        del self._buffer[:end]
        return frame


def _msgpack() -> Any:
    try:
        import msgpack
    except ImportError as missing:
        raise MissingExtra.of('encoding="msgpack"', "msgpack", missing) from missing
    return msgpack


def _plain(value: Any) -> Any:
    """Return numpy's arrays and scalars as lists and numbers, and other sequences as lists."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if hasattr(value, "__iter__"):
        return list(value)
    raise TypeError(f"{type(value).__name__} cannot be sent to the server")
