"""The places of values in a TOML text, and the messages that name them."""

from __future__ import annotations

import asyncio
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import tomllib
from serving import PATIENCE_S, REPOSITORY, SCENES, Server, program

import hbot
from hbot.places import Places, join
from hbot.scenes import read_scene

WRONG = """\
name = "Wrong"  # [[effect]] in a comment is none

[[effect]]
id = "a"
kind = "spring"
stifness = 1
damping = -1

[[effect]]
id = 'b'
kind = "damper"
figure = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]

[[effect]]
id = "c"
kind = "spring"
reference = [
    1, 0, # w and x
    0,
    "left",
]

[[effect]]
id = "b"
kind = "sprng"

[[effect]]
kind = "spring"

[simulate.hand]
mass_kg = 2
"""


def paths(value: Any, path: str = "") -> list[tuple[str, Any]]:
    """Return the paths of all values that are no tables or arrays, with the values."""
    if isinstance(value, dict):
        return [leaf for key, part in value.items() for leaf in paths(part, join(path, key))]
    if isinstance(value, list):
        return [leaf for i, part in enumerate(value) for leaf in paths(part, f"{path}[{i}]")]
    return [(path, value)]


TOML = [
    WRONG,
    *(path.read_text("utf-8") for path in sorted(SCENES.glob("*.toml"))),
    *(path.read_text("utf-8") for path in sorted((REPOSITORY / "rigs").glob("*.toml"))),
    '''\
a.b."c.d".'e]' = 1
[x . y]
z = { p = [ { q = "}" }, { q = "]#" } ], r.s = 2 } # {
text = """
[[effect]]
id = "no table" \\"""
""""
raw = \'\'\'
[x]
it''s\'\'\'
when = 1979-05-27 07:32:00 # a space in a value
[[x.list]]
n = 1
[x.list.inner]
n = 2
[[x.list.deep]]
n = 3
[[x.list]]
[[x.list.deep]]
n = 4
[[x.list.deep]]
n = [
  5, # one
  [ 6, ], 7,
]
''',
]


@pytest.mark.parametrize("text", TOML, ids=map(str, range(len(TOML))))
def test_every_value_is_found_where_it_stands(text: str) -> None:
    """The text at the place of a value, read alone, is that value."""
    lines, places = text.split("\n"), Places(text)
    found = paths(tomllib.loads(text))
    assert found
    for path, value in found:
        place = places.of(path)
        assert place is not None, path
        rest = "\n".join([lines[place[0] - 1][place[1] - 1 :], *lines[place[0] :]])
        # A value ends where the shortest legal text ends that the standard library reads as it.
        ends = (end for end in range(1, len(rest) + 1) if read(rest[:end]) == value)
        assert next(ends, None) is not None, f"{path} = {value!r} is not at {place}"
        key = places.of(path, key=True)
        assert key is not None
        if not path.endswith("]"):
            name = re.split(r"\.(?=[\w-]+$|\"[^\"]*\"$)", path)[-1].strip('"')
            assert name in lines[key[0] - 1][key[1] - 1 :][: len(name) + 1], path


def read(text: str) -> Any:
    """Return the value that the text is, or None if it is none."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return None


def test_a_value_that_is_missing_stands_at_the_table_around_it() -> None:
    places = Places(WRONG)
    assert places.of("effect[1].damping") == places.of("effect[1]")
    assert places.of("effect[1].damping[2].x") == places.of("effect[1]")
    assert places.of("effect[7].id") == places.of("effect")
    assert places.of("rig.name") is None


def scene(folder: Path, text: str) -> Path:
    """Write a scene file."""
    path = folder / "wrong.toml"
    path.write_text(text, encoding="utf-8")
    return path


def told_by_the_command(path: Path) -> list[str]:
    """Return the lines in which `hbot scene check` names the mistakes of a file."""
    done = subprocess.run(
        [program(), "scene", "check", str(path)], capture_output=True, timeout=PATIENCE_S, text=True
    )
    assert done.returncode != 0
    return [line for line in done.stderr.splitlines() if "wrong.toml" in line]


def test_a_mistake_is_named_with_the_place_that_the_command_line_names(
    server: Server, tmp_path: Path
) -> None:
    path = scene(tmp_path, WRONG)
    with hbot.connect(server.address, name="me") as rig, rig.lease():
        with pytest.raises(hbot.BadRequest, match=r"wrong\.toml:6:1: effect\[0\]\.stifness") as own:
            rig.load_scene(path)
        assert own.value.op == "load_scene"

    async def main() -> str:
        async with hbot.aio.connect(server.address, name="me") as rig, rig.lease():
            with pytest.raises(hbot.BadRequest) as caught:
                await rig.load_scene(path)
            return caught.value.message

    assert asyncio.run(main()) == own.value.message
    told = own.value.message.split("\n")
    assert len(told) >= 6
    for line, command in zip(told, told_by_the_command(path), strict=True):
        assert command.endswith(line)


def test_mistakes_in_a_recorded_path_stand_at_the_name_of_its_file(
    server: Server, tmp_path: Path
) -> None:
    (tmp_path / "track.csv").write_text("t,w,x,y,z\n0,1,0,0,0\n0,1,0,0,0\n")
    path = scene(
        tmp_path,
        'name = "x"\n[[effect]]\nid = "t"\nkind = "track"\npath = "record"\nfile = "track.csv"\n',
    )
    refused = pytest.raises(hbot.BadRequest, match=r"wrong\.toml:6:8: effect\[0\]\.points")
    with hbot.connect(server.address, name="me") as rig, rig.lease(), refused:
        rig.load_scene(path)


def test_a_refusal_for_another_reason_names_no_file(server: Server) -> None:
    refused = pytest.raises(hbot.NotHolder)
    with hbot.connect(server.address, name="me") as rig, refused as caught:
        rig.load_scene(SCENES / "spring.toml")
    assert "toml" not in str(caught.value)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("nan", "nan is not a finite number"),
        ("-inf", "-inf is not a finite number"),
        ("1979-05-27", "1979-05-27 is a date"),
        ("9223372036854775808", "an integer of more than 64 bits"),
    ],
)
def test_a_value_that_no_message_can_hold_is_named(
    tmp_path: Path, value: str, message: str
) -> None:
    path = scene(tmp_path, f'name = "x"\n[[effect]]\nreference = [1, {value}]\n')
    with pytest.raises(
        ValueError, match=re.escape(f"wrong.toml:3:17: effect[0].reference[1]: {message}")
    ):
        read_scene(path)


def test_a_file_that_is_no_text_is_named(tmp_path: Path) -> None:
    (tmp_path / "wrong.toml").write_bytes(b'name = "\xff"\n')
    with pytest.raises(ValueError, match=r"wrong\.toml: it is not text"):
        read_scene(tmp_path / "wrong.toml")


def test_a_ready_made_scene_is_loaded_by_its_name(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with hbot.connect(server.address, name="me") as rig, rig.lease():
        rig.load_scene("hinge")
        assert rig.refresh().scene["name"] == "Hinge"
        with pytest.raises(hbot.BadRequest, match=r"did you mean .hinge."):
            rig.load_scene("hing")
        # A file of this name counts more, and one that is nearly called so is named.
        (tmp_path / "mine").write_text('name = "Mine"\n')
        rig.load_scene("mine")
        assert rig.refresh().scene["name"] == "Mine"
        (tmp_path / "yours.toml").write_text('name = "Yours"\n')
        with pytest.raises(hbot.BadRequest, match=r"or is 'yours\.toml' meant"):
            rig.load_scene("yours")
    with pytest.raises(FileNotFoundError, match=r"No such file or directory: 'spring\.toml'"):
        read_scene("spring.toml")
