"""Reads scene files."""

from __future__ import annotations

import importlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

from .errors import MissingExtra

Scene: TypeAlias = str | os.PathLike[str] | Mapping[str, Any]
"""A scene: the path of a scene file (TOML), or a map of the same structure (docs/files.md)."""


def read_scene(scene: Scene) -> dict[str, Any]:
    """Return the scene as a map. The server checks its contents.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file is no TOML; the message names the place.
        MissingExtra: Python 3.10 has no reader of TOML, and the package `tomli` is not installed.
    """
    if isinstance(scene, Mapping):
        return dict(scene)
    text = Path(scene).read_text(encoding="utf-8")
    loads, error = _toml()
    try:
        return dict(loads(text))
    except error as wrong:
        raise ValueError(f"{os.fspath(scene)}: {wrong}") from wrong


def _toml() -> tuple[Any, type[ValueError]]:
    """Return the function that reads TOML, and the exception that it raises."""
    try:
        toml: Any = importlib.import_module("tomllib")
    except ModuleNotFoundError:
        try:
            toml = importlib.import_module("tomli")
        except ModuleNotFoundError:
            raise MissingExtra(
                "Python 3.10 cannot read scene files: pip install tomli, or use Python 3.11, "
                "or pass the scene as a dict"
            ) from None
    return toml.loads, toml.TOMLDecodeError
