"""Reads scene files, and the recorded paths that they name."""

from __future__ import annotations

import csv
import importlib
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

from .errors import MissingExtra

Scene: TypeAlias = str | os.PathLike[str] | Mapping[str, Any]
"""A scene: the path of a scene file (TOML), or a map of the same structure (docs/files.md)."""

PATH_COLUMNS = ["t", "w", "x", "y", "z"]
"""First line of a recorded path: time, s, and orientation as a quaternion."""
MAX_POINTS = 800
"""Largest number of points of a path (docs/effects.md, kind `track`)."""


def read_scene(scene: Scene) -> dict[str, Any]:
    """Return the scene as a map. The server checks its contents.

    A `track` of a scene file can name a CSV file with its path. The server cannot read files of
    this machine, so this function reads the points and puts them into the map.

    Raises:
        OSError: a file cannot be read.
        ValueError: the file is no TOML, or the CSV file is no path; the message names the place.
        MissingExtra: Python 3.10 has no reader of TOML, and the package `tomli` is not installed.
    """
    if isinstance(scene, Mapping):
        return dict(scene)
    text = Path(scene).read_text(encoding="utf-8")
    loads, error = _toml()
    try:
        made = dict(loads(text))
    except error as wrong:
        raise ValueError(f"{os.fspath(scene)}: {wrong}") from wrong
    effects = made.get("effect")
    for effect in effects if isinstance(effects, list) else []:
        # Points and a file together are a mistake, which the server names.
        if isinstance(effect, dict) and effect.get("file") and "points" not in effect:
            path = Path(scene).parent / str(effect.pop("file"))
            effect["points"] = _points(path)
    return made


def _points(path: Path) -> list[list[float]]:
    """Return the points [t, w, x, y, z] of a recorded path, by the rules of scene files."""
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = csv.reader(line for line in lines if line.strip() and not line.startswith("#"))
    header = [cell.strip() for cell in next(rows, [])]
    if header != PATH_COLUMNS:
        raise ValueError(f"{path}: the first line is {','.join(header)!r}; legal: 't,w,x,y,z'")
    points = []
    for number, row in enumerate(rows, start=1):
        try:
            point = [float(cell) for cell in row]
        except ValueError as wrong:
            raise ValueError(f"{path}: row {number}: {wrong}") from wrong
        if len(point) != len(PATH_COLUMNS) or not all(map(math.isfinite, point)):
            raise ValueError(f"{path}: row {number} is {row}; legal: 5 finite numbers")
        points.append(point)
    if len(points) > MAX_POINTS:
        raise ValueError(
            f"{path} has {len(points)} rows; legal: at most {MAX_POINTS}. Send a longer path with "
            "`reference`, point by point"
        )
    return points


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
