"""The line and column of each value of a TOML text.

The standard library reads TOML without them. The text must be legal: the standard library has read
it before.
"""

from __future__ import annotations

import json
import re
from typing import NamedTuple

_SEGMENT = r"""(?:[A-Za-z0-9_-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')"""
_KEY = re.compile(_SEGMENT)
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_DOT = re.compile(r"[ \t]*\.[ \t]*")
# Up to two of the quotes that end a text of several lines belong to the text.
_STRING = re.compile(
    r'"""(?:\\.|[^\\])*?"""(?:"{0,2})'
    r"|'''.*?'''(?:'{0,2})"
    r'|"(?:[^"\\\n]|\\.)*"'
    r"|'[^'\n]*'",
    re.DOTALL,
)
_SCALAR = re.compile(r"[^,\]}\n#]+")
_LAST_STEP = re.compile(r"(?:\.[^.\[]*|\[[^.\[]*)$")

PATH = re.compile(rf"{_SEGMENT}(?:\.{_SEGMENT}|\[[0-9]+\])*")
"""A path as messages of the server name it, such as `effect[1].stiffness`."""


class Place(NamedTuple):
    """Where a value stands in the text."""

    key: int
    """Offset of its key; of the value itself if it has none, as an element of an array."""
    value: int
    """Offset of the value."""


class Places:
    """The places of all values of a text, by path."""

    def __init__(self, text: str) -> None:
        """Find the places. `text` is legal TOML."""
        self._text = text
        self._at = 0
        self._found: dict[str, Place] = {}
        self._lengths: dict[str, int] = {}
        """Elements of each array of tables so far."""
        self._read()

    def of(self, path: str, key: bool = False) -> tuple[int, int] | None:
        """Return line and column of the value at `path`, both counted from 1.

        Args:
            path: keys joined by dots, with the number of an element in brackets. If the text has no
                such value, the nearest table around it counts.
            key: whether to return the place of the key in place of the value's.

        Returns:
            None if the text has no table around the value.
        """
        while path:
            if (place := self._found.get(path)) is not None:
                offset = place.key if key else place.value
                start = self._text.rfind("\n", 0, offset) + 1
                return self._text.count("\n", 0, offset) + 1, offset - start + 1
            step = _LAST_STEP.search(path)
            path = path[: step.start()] if step else ""
        return None

    def alias(self, path: str, of: str) -> None:
        """Let values under `path`, which the text does not have, stand at the place of another."""
        if of in self._found:
            self._found.setdefault(path, self._found[of])

    def _read(self) -> None:
        table = ""
        while self._skip() < len(self._text):
            if self._text[self._at] == "[":
                table = self._header()
            else:
                self._pair(table)

    def _header(self) -> str:
        """Read the header of a table or of an element of an array. Return the table's path."""
        start, element = self._at, self._text.startswith("[[", self._at)
        self._at += 2 if element else 1
        self._skip()
        path = ""
        keys = self._keys()
        for number, (key, offset) in enumerate(keys, start=1):
            path = join(path, key)
            self._found.setdefault(path, Place(offset, start))
            last = number == len(keys)
            if last and element:
                self._lengths[path] = self._lengths.get(path, 0) + 1
            if path in self._lengths:
                path = f"{path}[{self._lengths[path] - 1}]"
                self._found.setdefault(path, Place(offset, start))
        self._skip()
        self._at += 2 if element else 1
        return path

    def _pair(self, table: str) -> None:
        """Read a key and its value."""
        path, offset = table, self._at
        for key, offset in self._keys():
            path = join(path, key)
            self._found.setdefault(path, Place(offset, offset))
        self._skip()
        self._at += 1  # The equals sign.
        self._skip()
        self._value(path, offset)

    def _value(self, path: str, key: int | None = None) -> None:
        start = self._at
        self._found[path] = Place(start if key is None else key, start)
        opening = self._text[start]
        if opening in "[{":
            self._at += 1
            count = 0
            while self._text[self._skip()] not in "]}":
                if self._text[self._at] == ",":
                    self._at += 1
                elif opening == "{":
                    self._pair(path)
                else:
                    self._value(f"{path}[{count}]")
                    count += 1
            self._at += 1
        else:
            self._take(_STRING if opening in "\"'" else _SCALAR)

    def _keys(self) -> list[tuple[str, int]]:
        """Read keys that dots join. Return each with its offset."""
        keys = []
        while True:
            offset = self._at
            keys.append((_plain(self._take(_KEY)), offset))
            if not (dot := _DOT.match(self._text, self._at)):
                return keys
            self._at = dot.end()

    def _take(self, pattern: re.Pattern[str]) -> str:
        found = pattern.match(self._text, self._at)
        if found is None:
            raise ValueError(f"offset {self._at}: not TOML")
        self._at = found.end()
        return found[0]

    def _skip(self) -> int:
        """Skip blanks, ends of lines and comments. Return the offset after them."""
        self._take(_BLANK)
        return self._at


def join(path: str, key: str) -> str:
    """Return `path` extended by `key`, as messages of the server write it."""
    name = key if _BARE.fullmatch(key) else json.dumps(key, ensure_ascii=False)
    return f"{path}.{name}" if path else name


def _plain(key: str) -> str:
    """Return a key without its quotes."""
    if key.startswith("'"):
        return key[1:-1]
    if key.startswith('"'):
        try:
            return str(json.loads(key))
        except ValueError:  # An escape that JSON does not have. The key then keeps it.
            return key[1:-1]
    return key
