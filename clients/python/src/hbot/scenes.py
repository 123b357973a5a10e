"""Reads scene files, and the recorded paths that they name."""

from __future__ import annotations

import csv
import datetime
import importlib
import math
import os
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from .errors import BadRequest, IllegalInput, MissingExtra, OutOfRange
from .places import PATH, Places, join

Scene: TypeAlias = str | os.PathLike[str] | Mapping[str, Any]
"""A scene: the path of a scene file (TOML), the name of a ready-made scene (docs/scenes.md), or a
map of the structure of a scene file (docs/files.md)."""

PATH_COLUMNS = ["t", "w", "x", "y", "z"]
"""First line of a recorded path: time, s, and orientation as a quaternion."""
MAX_POINTS = 800
"""Largest number of points of a path (docs/effects.md, kind `track`)."""


Explain: TypeAlias = Callable[[Exception], Exception]
"""Returns an error of the server with what this program knows of its cause."""


def read_scene(scene: Scene) -> dict[str, Any]:
    """Return the scene as a map. The server checks its contents.

    A `track` of a scene file can name a CSV file with its path. The server cannot read files of
    this machine, so this function reads the points and puts them into the map.

    Raises:
        OSError: a file cannot be read.
        IllegalInput: the file is no TOML, or the CSV file is no path; the message names the place.
        MissingExtra: Python 3.10 has no reader of TOML, and the package `tomli` is not installed.
    """
    return dict(scene) if isinstance(scene, Mapping) else _open_file(scene)[0]


def open_scene(scene: Scene) -> tuple[dict[str, Any] | str, Explain]:
    """Return the scene as `read_scene` does, and what names the lines of the server's refusal.

    A name without a folder and without an ending, which is no file here, stays a name: the server
    knows the ready-made scenes.
    """
    if isinstance(scene, Mapping):
        return dict(scene), lambda error: error
    if isinstance(scene, str) and not Path(scene).is_file() and Path(scene).stem == scene:
        return scene, partial(_named, scene)
    return _open_file(scene)


def _named(name: str, error: Exception) -> Exception:
    """Return the server's refusal of a scene's name with what else the name could be."""
    files = (Path(f"{name}.toml"), Path("scenes", f"{name}.toml"))
    near = [path for path in files if path.exists()]
    if near and isinstance(error, BadRequest):
        return error.with_message(f"{error.message}; or is {str(near[0])!r} meant, a file here?")
    return error


def _open_file(scene: str | os.PathLike[str]) -> tuple[dict[str, Any], Explain]:
    """Return the scene in a file, and what names the lines of the server's refusal."""
    text = _text(scene)
    name = os.fspath(scene)
    loads, error = _toml()
    try:
        made = dict(loads(text))
    except error as wrong:
        raise IllegalInput(f"{name}: {wrong}") from wrong
    places = Places(text)
    if unsendable := [f"{path}: {what}" for path, what in _unsendable(made)]:
        raise IllegalInput(_located("\n".join(unsendable), name, places))
    effects = made.get("effect")
    for number, effect in enumerate(effects if isinstance(effects, list) else []):
        # Points and a file together are a mistake, which the server names.
        if isinstance(effect, dict) and effect.get("file") and "points" not in effect:
            path = Path(scene).parent / str(effect.pop("file"))
            effect["points"] = _points(path)
            places.alias(f"effect[{number}].points", of=f"effect[{number}].file")

    def explain(error: Exception) -> Exception:
        # Other refusals, such as that of the lease, say nothing of the file.
        if isinstance(error, BadRequest | OutOfRange):
            return error.with_message(_located(error.message, name, places))
        return error

    return made, explain


def _text(scene: str | os.PathLike[str]) -> str:
    """Return the text of a scene file.

    Raises:
        OSError: it cannot be read.
        IllegalInput: it is no text.
    """
    path = Path(scene)
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as wrong:
        raise IllegalInput(f"{path}: it is not text (UTF-8): {wrong}") from wrong


def _located(message: str, name: str, places: Places) -> str:
    """Return a message of one mistake in each line with the mistakes' places in the file `name`.

    The lines are in the order of the file, as the command line prints them.
    """
    lines: list[tuple[tuple[float, float], str]] = []
    for line in message.split("\n"):
        path, at = PATH.match(line), None
        if path is not None and line.startswith(": ", path.end()):
            at = places.of(path[0], key=line.startswith(": unknown key", path.end()))
        prefix = name if at is None else f"{name}:{at[0]}:{at[1]}"
        # The line "... and more" of a list that was cut short stays at its end.
        order = (math.inf, 0) if line.startswith("...") else at or (0, 0)
        lines.append((order, f"{prefix}: {line}"))
    return "\n".join(line for _, line in sorted(lines, key=lambda pair: pair[0]))


def _unsendable(value: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield path and description of each value that TOML has and the messages do not."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield from _unsendable(part, join(path, key))
    elif isinstance(value, list):
        for number, part in enumerate(value):
            yield from _unsendable(part, f"{path}[{number}]")
    elif isinstance(value, float) and not math.isfinite(value):
        yield path, f"{value} is not a finite number"
    elif isinstance(value, datetime.date | datetime.time):
        yield path, f"{value} is a date"
    elif isinstance(value, int) and not -(1 << 63) <= value < 1 << 63:
        yield path, "an integer of more than 64 bits"


def _points(path: Path) -> list[list[float]]:
    """Return the points [t, w, x, y, z] of a recorded path, by the rules of scene files."""
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = csv.reader(line for line in lines if line.strip() and not line.startswith("#"))
    header = [cell.strip() for cell in next(rows, [])]
    if header != PATH_COLUMNS:
        raise IllegalInput(f"{path}: the first line is {','.join(header)!r}; legal: 't,w,x,y,z'")
    points = []
    for number, row in enumerate(rows, start=1):
        try:
            point = [float(cell) for cell in row]
        except ValueError as wrong:
            raise IllegalInput(f"{path}: row {number}: {wrong}") from wrong
        if len(point) != len(PATH_COLUMNS) or not all(map(math.isfinite, point)):
            raise IllegalInput(f"{path}: row {number} is {row}; legal: 5 finite numbers")
        points.append(point)
    if len(points) > MAX_POINTS:
        raise IllegalInput(
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
