"""Checks of numbers that a program gives."""

from __future__ import annotations

import math
from collections.abc import Iterable


def finite(name: str, values: Iterable[float]) -> list[float]:
    """Return the values of the parameter `name` as plain numbers, also those of an array.

    Raises:
        TypeError: the parameter is a text, whose digits would count as numbers, or no list.
        ValueError: a value is not finite.
    """
    if isinstance(values, str):
        raise TypeError(f"{name} is the text {values!r}; legal: a list of numbers")
    if not isinstance(values, Iterable):
        raise TypeError(f"{name} is {values!r}; legal: a list of numbers")
    numbers = [float(value) for value in values]
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"{name} is {numbers}; every number must be finite")
    return numbers
