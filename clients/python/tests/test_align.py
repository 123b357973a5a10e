"""Measurements from outside: FicTrac's lines, and AprilTags in rendered pictures."""

from __future__ import annotations

import functools
import io
import math
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from serving import PATIENCE_S, Server, eventually

import hbot
from hbot import turns
from hbot.align import Measured
from hbot.align.__main__ import arguments, source
from hbot.align.fictrac import Fictrac, orientation
from hbot.turns import Quaternion

np = pytest.importorskip("numpy", reason="the extra align is installed in CI")
pytest.importorskip("pupil_apriltags", reason="the extra align is installed in CI")

from pupil_apriltags import Detector  # noqa: E402

from hbot.align.apriltags import AprilTags, Layout, quaternion  # noqa: E402

IDENTITY = (1.0, 0.0, 0.0, 0.0)
RADIUS = 0.1
"""Radius of the rendered sphere, m."""
DISTANCE = 0.45
"""Distance of the camera from its centre, m."""
COLUMNS, ROWS = 640, 480


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    """Start a server for one test, whose sphere is held still by the simulated hand."""
    scene = tmp_path / "still.toml"
    hand = "stiffness = 30\ndamping = 0.3\namplitude = 0"
    scene.write_text(f'name = "still"\n[simulate.hand]\n{hand}\n', encoding="utf-8")
    server = Server(tmp_path, options=["--scene", str(scene)])
    yield server
    server.kill()


def apart(a: Quaternion, b: Quaternion) -> float:
    """Return the angle between two orientations, rad."""
    return math.hypot(*turns.log(turns.times(turns.conjugate(a), b)))


def line(frame: int, lab: tuple[float, float, float]) -> bytes:
    """Return a line as FicTrac sends it: 25 numbers, of which only the orientation is looked at."""
    numbers = [float(frame)] + [9.0] * 24
    numbers[11:14] = lab
    return ("FT, " + ", ".join(str(number) for number in numbers) + "\n").encode()


def test_a_line_of_fictrac_has_the_orientation_in_numbers_12_to_14() -> None:
    got = orientation(line(7, (0.1, -0.2, 0.3)))
    assert got is not None
    assert turns.log(got) == pytest.approx((0.1, -0.2, 0.3))
    whole = line(7, (0.1, -0.2, 0.3))
    for wrong in (b"", b"FT", b"FT, 1, 2", b"XX" + whole[2:], whole.replace(b"0.3", b"x"),
                  whole.replace(b"0.3", b"nan"), whole.replace(b"0.3", b"1e9")):  # fmt: skip
        assert orientation(wrong) is None


def test_fictracs_frame_and_its_beginning_become_those_of_the_rig() -> None:
    # FicTrac's axis 1 is n2 here. The sphere was already turned when FicTrac began.
    frame = turns.exp((0.0, 0.0, math.pi / 2))
    first = turns.exp((0.3, 0.4, -0.2))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as there:
        there.bind(("127.0.0.1", 0))
        there.settimeout(0.2)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far:
            for k in range(3):
                far.sendto(line(k, (0.1 * k, 0.0, 0.0)), there.getsockname())
            far.sendto(b"something else", there.getsockname())
        measured = list(Fictrac(there, lambda: first, frame, sigma=0.01, delay=0.05))
    assert [it.sigma for it in measured] == [(0.01, 0.01, 0.01)] * 3
    assert {it.age for it in measured} == {0.05}
    for k, it in enumerate(measured):
        want = turns.times(turns.exp((0.0, 0.1 * k, 0.0)), first)
        assert apart(it.q, want) < 1e-9


def ready(program: subprocess.Popen[bytes], word: bytes) -> bytes:
    """Return the next line of a program. Fails if it does not have `word`."""
    assert program.stdout is not None
    said = program.stdout.readline()
    assert word in said, said
    return said


def test_the_program_corrects_a_server_by_fictracs_lines(server: Server) -> None:
    command = [sys.executable, "-m", "hbot.align", "fictrac", "--server", server.address]
    with (
        subprocess.Popen(
            [*command, "--port", "0", "--sigma", "0.002"], stdout=subprocess.PIPE
        ) as program,
        hbot.connect(server.address) as rig,
    ):
        try:
            said = ready(program, b"waits for FicTrac at 127.0.0.1:")
            place = ("127.0.0.1", int(said.rsplit(b":", 1)[1]))
            begin = next(rig.states()).q
            frame = 0
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far:
                far.sendto(line(frame, (0.0, 0.0, 0.0)), place)
                ready(program, b"the first orientation is 0.00")
                want = turns.times(turns.exp((0.0, 0.0, 0.3)), begin)

                def arrived() -> bool:
                    nonlocal frame
                    frame += 1
                    far.sendto(line(frame, (0.0, 0.0, 0.3)), place)
                    return apart(next(rig.states()).q, want) < 0.02

                eventually(arrived, "the server's orientation becomes FicTrac's")
        finally:
            program.terminate()


# A camera in front of the sphere looks against n1. n2 points to the right of the picture, n3 up.
CAMERA = {"focal": [600.0, 600.0], "centre": [319.5, 239.5], "right": [0, 1, 0], "down": [0, 0, -1]}


def layout(tags: list[dict[str, Any]]) -> dict[str, Any]:
    return {"radius": RADIUS, "camera": CAMERA, "tag": tags}


def around() -> list[dict[str, Any]]:
    """Return tags all around the sphere, tilted in many ways."""
    golden = math.pi * (3.0 - math.sqrt(5.0))
    tags = []
    for k in range(26):
        z = 1.0 - 2.0 * (k + 0.5) / 26
        flat = math.sqrt(1.0 - z * z)
        normal = [flat * math.cos(golden * k), flat * math.sin(golden * k), z]
        tags.append({"id": k, "size": 0.028, "normal": normal, "up": [0.3, 0.2 * (k % 3), 1.0]})
    return tags


@functools.cache
def tag36h11() -> Any:
    """Return the family of tags in the detector's library, which outlives the detector."""
    detector = Detector(families="tag36h11")
    return detector.tag_families.pop("tag36h11").contents


def bitmap(number: int) -> Any:
    """Return the cells of a tag with its white border, from the codes in the detector's library."""
    family = tag36h11()
    cells = np.zeros((family.total_width, family.total_width))
    edge = (family.total_width - family.width_at_border) // 2
    cells[:] = 1.0
    cells[edge:-edge, edge:-edge] = 0.0
    for bit in range(family.nbits):
        if family.codes[number] >> (family.nbits - 1 - bit) & 1:
            cells[family.bit_y[bit] + edge, family.bit_x[bit] + edge] = 1.0
    return cells


def rendered(q: Quaternion, tags: list[dict[str, Any]], finer: int = 3) -> Any:
    """Return a picture of the sphere with the orientation `q`, by casting a ray for each pixel.

    The tags are flat and touch the sphere with their centres. What is written here about the camera
    and the tags does not use the code under test.
    """
    w, x, y, z = q
    body = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    u = (np.arange(COLUMNS * finer) + 0.5) / finer - 0.5
    v = (np.arange(ROWS * finer) + 0.5) / finer - 0.5
    right = (u - 319.5) / 600.0
    down = (v - 239.5) / 600.0
    rays = np.empty((v.size, u.size, 3))
    rays[..., 0], rays[..., 1], rays[..., 2] = -1.0, right[None, :], -down[:, None]
    eye = np.array([DISTANCE, 0.0, 0.0])
    picture = np.full(rays.shape[:2], 0.5)
    for tag in tags:
        normal = np.array(tag["normal"], dtype=float)
        normal /= np.linalg.norm(normal)
        up = np.array(tag["up"], dtype=float)
        up -= normal * (up @ normal)
        up /= np.linalg.norm(up)
        side = np.cross(up, normal)
        normal, up, side = body @ normal, body @ up, body @ side
        if normal[0] < 0.3:
            continue  # on the far side
        place = RADIUS * normal
        along = rays @ normal
        distance = np.where(np.abs(along) > 1e-9, ((place - eye) @ normal) / along, -1.0)
        hit = eye + rays * distance[..., None] - place
        cells = bitmap(tag["id"])
        cell = tag["size"] / 8  # the black square of this family has 8 cells
        column = np.floor(hit @ side / cell + cells.shape[1] / 2).astype(int)
        row = np.floor(-(hit @ up) / cell + cells.shape[0] / 2).astype(int)
        inside = (column >= 0) & (column < cells.shape[1]) & (row >= 0) & (row < cells.shape[0])
        inside &= distance > 0
        picture[inside] = cells[row[inside], column[inside]]
    coarse = picture.reshape(ROWS, finer, COLUMNS, finer).mean(axis=(1, 3))
    return (20 + 215 * coarse).astype(np.uint8)


def test_april_tags_in_a_picture_show_the_orientation() -> None:
    tags = around()
    source = AprilTags(Layout(layout(tags)), delay=0.04)
    errors = []
    for turn in ((0.0, 0.0, 0.0), (0.5, -0.3, 1.1), (-2.0, 0.4, 0.2), (0.1, 2.9, -0.5)):
        q = turns.exp(turn)
        measured = source.measure(rendered(q, tags))
        assert measured is not None
        assert measured.age == 0.04
        off = apart(measured.q, q)
        # Three deviations of a vector of three; a wrong axis or order would be off by far more.
        assert off < 3.0 * math.hypot(*measured.sigma), f"{off} rad with {measured.sigma}"
        errors.append(off)
    # Ten pixels are a degree here.
    assert max(errors) < 1.5e-3, errors


def test_a_picture_is_as_old_as_its_detection_took(monkeypatch: pytest.MonkeyPatch) -> None:
    def measure(_tags: AprilTags, _picture: object) -> Measured:
        time.sleep(0.1)  # Its subject is time.
        return Measured(IDENTITY, (0.1, 0.1, 0.1), age=0.04)

    monkeypatch.setattr(AprilTags, "measure", measure)
    monkeypatch.setattr(Layout, "read", lambda _path: Layout(layout([])))
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(bytes(6))))
    options = arguments(["apriltags", "--layout", "tags.toml", "--size", "3x2"])
    unused: Any = None
    (measured,) = source(options, unused)
    assert 0.14 <= measured.age < 0.14 + PATIENCE_S


def test_a_picture_without_tags_says_nothing() -> None:
    source = AprilTags(Layout(layout(around())))
    assert source.measure(np.full((ROWS, COLUMNS), 128, np.uint8)) is None
    # Tags that are not of the sphere do not count.
    assert AprilTags(Layout(layout([]))).measure(rendered(IDENTITY, around())) is None


DETECTORS = """
import numpy
from hbot.align.apriltags import AprilTags, Layout
camera = {"focal": [600, 600], "centre": [160, 120], "right": [0, 1, 0], "down": [0, 0, -1]}
tag = {"id": 0, "size": 0.03, "normal": [1, 0, 0], "up": [0, 0, 1]}
layout = Layout({"radius": 0.1, "camera": camera, "tag": [tag]})
noise = numpy.random.default_rng(1)
for _ in range(100):
    AprilTags(layout)
    AprilTags(layout).measure(noise.integers(0, 255, (240, 320), numpy.uint8))
"""


def test_detectors_end_without_a_crash() -> None:
    """Freed memory that is filled at once shows who still uses it."""
    filled = {"GLIBC_TUNABLES": "glibc.malloc.tcache_count=0:glibc.malloc.perturb=165"}
    command = [sys.executable, "-c", DETECTORS]
    subprocess.run(command, env={**os.environ, **filled}, check=True, timeout=120)


@pytest.mark.parametrize("turn", [(0, 0, 0), (3.1, 0, 0), (0, 3.1, 0), (0, 0, 3.1), (1, -2, 0.5)])
def test_a_rotation_matrix_becomes_its_quaternion(turn: tuple[float, float, float]) -> None:
    q = turns.exp(turn)
    columns = []
    for axis in ((0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)):
        columns.append(turns.times(turns.times(q, axis), turns.conjugate(q))[1:])
    assert apart(quaternion(np.column_stack(columns)), q) < 1e-9


def test_a_layout_that_is_wrong_is_refused(tmp_path: Path) -> None:
    good = layout([{"id": 0, "size": 0.03, "normal": [1, 0, 0], "up": [0, 0, 1]}])
    Layout(good)
    wrong: list[dict[str, Any]] = [
        {},
        {**good, "camera": {**CAMERA, "focal": [600.0]}},
        {**good, "camera": {**CAMERA, "down": [0, 2, 0]}},
        {**good, "tag": [{"id": 0, "size": 0.03, "normal": [1, 0, 0]}]},
        {**good, "tag": [{"id": 0, "size": 0.03, "normal": [1, 0, 0], "up": [2, 0, 0]}]},
    ]
    for table in wrong:
        with pytest.raises(hbot.IllegalInput):
            Layout(table)
    file = tmp_path / "tags.toml"
    file.write_text("[camera", encoding="utf-8")
    with pytest.raises(hbot.IllegalInput, match=r"tags\.toml"):
        Layout.read(file)


def test_the_program_corrects_a_server_by_pictures(server: Server, tmp_path: Path) -> None:
    tags = around()
    text = f"radius = {RADIUS}\n[camera]\n" + "".join(
        f"{key} = {value}\n" for key, value in CAMERA.items()
    )
    for tag in tags:
        text += "[[tag]]\n" + "".join(f"{key} = {value}\n" for key, value in tag.items())
    (tmp_path / "tags.toml").write_text(text, encoding="utf-8")
    want = turns.exp((0.03, -0.02, 0.04))
    pictures = tmp_path / "pictures.raw"
    pictures.write_bytes(rendered(want, tags).tobytes() * 40)
    # A picture that is turned by far more than the sigma of both is ignored.
    with pictures.open("ab") as more:
        more.write(rendered(turns.exp((0.0, 0.0, 0.5)), tags).tobytes())
    command = [sys.executable, "-m", "hbot.align", "apriltags", "--server", server.address,
               "--layout", str(tmp_path / "tags.toml"), "--size", f"{COLUMNS}x{ROWS}"]  # fmt: skip
    with pictures.open("rb") as given:
        done = subprocess.run(command, stdin=given, capture_output=True, timeout=50, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith(b"41 orientations, of which the server has ignored 1\n")
    with hbot.connect(server.address) as rig:
        assert apart(next(rig.states()).q, want) < 3e-3
