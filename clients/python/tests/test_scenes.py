"""Scene files whose track names a recorded path (CSV)."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from serving import SCENES, Server

import hbot
from hbot.scenes import MAX_POINTS, read_scene
from hbot.wire import Encoding


def scene_with_file(folder: Path, csv: str) -> Path:
    """Write a scene of the shelf, with the points of its track in a file beside it."""
    text = (SCENES / "orientation-matching.toml").read_text(encoding="utf-8")
    text, changes = re.subn(r"(?ms)^points = \[.*?^\]", 'file = "paths/track.csv"', text)
    assert changes == 1, "the track of the shelf has no points"
    (folder / "paths").mkdir()
    (folder / "paths" / "track.csv").write_text(csv, encoding="utf-8")
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


def shelf_points() -> list[list[float]]:
    """Return the points of the track of the shelf."""
    effect = read_scene(SCENES / "orientation-matching.toml")["effect"][0]
    return [[float(number) for number in point] for point in effect["points"]]


def csv_of(points: list[list[float]]) -> str:
    """Return points as a CSV file, with a comment and spaces, which are legal."""
    lines = [", ".join(map(repr, point)) for point in points]
    return "\n".join(["# recorded", "t, w, x, y, z", *lines, ""])


def test_a_path_beside_the_scene_is_sent_with_it(server: Server, tmp_path: Path) -> None:
    path = scene_with_file(tmp_path, csv_of(shelf_points()))
    with hbot.connect(server.address, name="me") as rig, rig.lease():
        loaded = rig.load_scene(path)
        assert loaded.effects[0].kind == "track"
        assert rig.refresh().scene["effect"][0]["points"] == shelf_points()


@pytest.mark.parametrize(("encoding", "fits"), [("json", False), ("msgpack", True)])
def test_the_longest_path_with_all_digits(
    server: Server, tmp_path: Path, encoding: Encoding, fits: bool
) -> None:
    angles = [math.sin(k / 3) for k in range(MAX_POINTS)]
    points = [[k / 3, math.cos(a), math.sin(a) / 3**0.5, 0.0, 0.0] for k, a in enumerate(angles)]
    points = [[t, w, x, x, x] for t, w, x, _, _ in points]
    points[-1][1:] = points[0][1:]
    path = scene_with_file(tmp_path, csv_of(points))
    with hbot.connect(server.address, name="me", encoding=encoding) as rig, rig.lease():
        if fits:
            rig.load_scene(path)
            assert len(rig.refresh().scene["effect"][0]["points"]) == MAX_POINTS
        else:
            with pytest.raises(hbot.TooLarge):
                rig.load_scene(path)


@pytest.mark.parametrize(
    ("csv", "message"),
    [
        ("time,w,x,y,z\n", "first line is 'time,w,x,y,z'"),
        ("", "first line is ''"),
        ("t,w,x,y,z\n0,1,0,0,0\n1,1,0,0\n", "row 2 is"),
        ("t,w,x,y,z\n0,1,0,0,nan\n", "row 1 is .*finite"),
        ("t,w,x,y,z\n0,1,0,0,left\n", "row 1: .*left"),
        ("t,w,x,y,z\n" + "0,1,0,0,0\n" * (MAX_POINTS + 1), "801 rows; .*`reference`"),
    ],
)
def test_a_file_that_is_no_path_is_named(tmp_path: Path, csv: str, message: str) -> None:
    with pytest.raises(ValueError, match=rf"track\.csv.*{message}"):
        read_scene(scene_with_file(tmp_path, csv))


def test_a_file_that_is_missing_is_named(tmp_path: Path) -> None:
    path = scene_with_file(tmp_path, "")
    (tmp_path / "paths" / "track.csv").unlink()
    with pytest.raises(FileNotFoundError, match=r"track\.csv"):
        read_scene(path)


def test_the_server_refuses_points_and_a_file_together(server: Server, tmp_path: Path) -> None:
    path = scene_with_file(tmp_path, csv_of(shelf_points()))
    text = path.read_text(encoding="utf-8").replace("file =", "points = [[0, 1, 0, 0, 0]]\nfile =")
    path.write_text(text, encoding="utf-8")
    refused = pytest.raises(hbot.BadRequest, match="file")
    with hbot.connect(server.address, name="me") as rig, rig.lease(), refused:
        rig.load_scene(path)
