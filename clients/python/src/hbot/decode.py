"""Turns the maps of messages into dataclasses.

The type hints of a dataclass say how its fields are read, so each message is described once. Fields
that this package does not know are ignored, as docs/api.md asks of clients.
"""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Callable, Mapping
from typing import Any, TypeVar, Union, get_args, get_origin

from .errors import ProtocolError
from .vectors import Vector

T = TypeVar("T")
Convert = Callable[[Any], Any]

_CONVERTERS: dict[type[Any], Convert] = {}


def decode(kind: type[T], fields: Any) -> T:
    """Return a `kind` (a dataclass) with the values in `fields`, a map from a message.

    Raises:
        ProtocolError: `fields` is no map, or a field without a default is missing or has another
            structure.
    """
    try:
        return typing.cast(T, _of_dataclass(kind)(fields))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ProtocolError(
            f"the server sent a {kind.__name__} that cannot be read: {error!r}"
        ) from error


def _of_dataclass(kind: type[Any]) -> Convert:
    """Return the function that makes a `kind` of a map. It is made once for each dataclass."""
    if kind in _CONVERTERS:
        return _CONVERTERS[kind]
    hints = typing.get_type_hints(kind)
    required: list[tuple[str, Convert | None]] = []
    optional: list[tuple[str, Convert | None]] = []
    for field in dataclasses.fields(kind):
        has_default = field.default is not dataclasses.MISSING
        (optional if has_default else required).append((field.name, _of_hint(hints[field.name])))

    def convert(fields: Mapping[str, Any]) -> Any:
        values = {name: fields[name] if of is None else of(fields[name]) for name, of in required}
        for name, of in optional:
            if name in fields:
                values[name] = fields[name] if of is None else of(fields[name])
        return kind(**values)

    _CONVERTERS[kind] = convert
    return convert


def _of_hint(hint: Any) -> Convert | None:
    """Return the function that converts a value to the type `hint`.

    None: the value stays as it is.
    """
    if get_origin(hint) in (Union, types.UnionType):
        (inner,) = (_of_hint(part) for part in get_args(hint) if part is not type(None))
        return None if inner is None else lambda value: None if value is None else inner(value)
    if get_origin(hint) is tuple:
        item = _of_hint(get_args(hint)[0])
        return tuple if item is None else lambda values: tuple([item(value) for value in values])
    if hint is Vector:
        return Vector
    if dataclasses.is_dataclass(hint):
        return _of_dataclass(typing.cast("type[Any]", hint))
    return None
