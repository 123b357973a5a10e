"""The package agrees with docs/api.md: every table of the page is compared with the dataclasses."""

from __future__ import annotations

import asyncio
import dataclasses
import inspect
import re
from collections.abc import Callable
from typing import Any, get_args, get_type_hints

import pytest
from serving import REPOSITORY, Server

import hbot
from hbot import answers, events, info, ops, scenes, wire
from hbot.request import Op
from hbot.wire import Splitter

PAGE = (REPOSITORY / "docs" / "api.md").read_text(encoding="utf-8")
WRONG = (REPOSITORY / "docs" / "something-is-wrong.md").read_text(encoding="utf-8")
UNLED = {"lead = true": "lead = false"}
"""The change of the rig file for a rig that renders without a lead."""


def rows(heading: str, page: str = PAGE) -> dict[str, list[str]]:
    """Return the cells of the tables under a heading of a page, by the text of the first cell."""
    _, found, rest = page.partition(f"\n{heading}\n")
    assert found, f"the page has no {heading}"
    section = re.split(r"(?m)^#", rest)[0]
    lines = [line.strip("|").split("|") for line in section.splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line] for line in lines]
    return {line[0]: line[1:] for line in cells if line[0] and not line[0].startswith("---")}


def named(text: str) -> set[str]:
    """Return the single words in backticks. Names in braces count, as in `{angle, rate}`."""
    quoted = " ".join(re.findall(r"`([^`]*)`", text))
    return set(re.findall(r"[a-z][a-z0-9_]*", quoted))


def names(*kinds: type[Any]) -> set[str]:
    """Return the names of the fields of dataclasses."""
    return {field.name for kind in kinds for field in dataclasses.fields(kind)}


def choices(kind: type[Any], field: str) -> set[str]:
    """Return the legal texts of a field whose type is a literal, or a literal or None."""
    hint = get_type_hints(kind)[field]
    parts = get_args(hint)
    nested = [choice for part in parts for choice in get_args(part)]
    return {text for text in [*parts, *nested] if isinstance(text, str)}


def first_cells(heading: str) -> set[str]:
    """Return the names in the first cells of the tables under a heading."""
    return set().union(*(named(cell) for cell in rows(heading)))


def test_state() -> None:
    table = rows("### state")
    assert first_cells("### state") == names(hbot.State)
    assert named("".join(table["`mode`"])) == choices(hbot.State, "mode")
    faults = rows("## Faults", WRONG)
    assert {cell.strip("`") for cell in faults} - {"fault"} == choices(hbot.State, "fault")
    assert named(table["`joints`"][1]) == names(hbot.Joint)
    assert named(table["`client`"][1]) - {"tick"} == names(hbot.Stream)
    assert named(table["`timing`"][1]) == names(hbot.Timing)


def test_events() -> None:
    table = rows("## Events")
    assert {cell.strip("`") for cell in table if cell != "Event"} == set(events.EVENTS)
    for name, kind in events.EVENTS.items():
        if name != "state":
            cell = table[f"`{name}`"][1]
            legal = choices(kind, "cause") if "cause" in names(kind) else set()
            assert named(cell) - {"info", "load_scene"} - legal == names(kind), name
    assert choices(hbot.LeaseEvent, "cause") <= named(table["`lease`"][1])


def test_info() -> None:
    table = rows("### info")
    assert {cell.strip("`") for cell in table} - {"Field", "a wheel"} == names(hbot.Info)
    parts: dict[str, set[str]] = {
        "`rig`": names(info.RigInfo, info.Sphere),
        "a wheel": names(info.Wheel, info.Motor),
        "`limits`": names(info.Limits, info.EnergyLimit, info.TractionLimit, info.PassivityLimit),
        "`effects`": names(info.Kind),
        "`modes`": names(info.ModeWords),
        "`faults`": names(info.FaultWords),
        "`lease`": names(info.Holder),
        "`clock`": names(info.Clock),
        "`on_client_lost`": choices(hbot.Info, "on_client_lost"),
    }
    assert first_cells("#### render") == names(info.Render)
    assert named(rows("#### render")["`loop`"][1]) == names(info.Loop)
    for row, fields in parts.items():
        assert named(re.split(r"extended by|See", table[row][1])[0]) == fields, row


def test_stats() -> None:
    assert first_cells("### stats") == names(hbot.Stats)
    times = next(cells for cell, cells in rows("### stats").items() if "lateness_us" in cell)
    assert names(hbot.Distribution) == named(times[1]) - names(hbot.Stats)


def test_controllers() -> None:
    assert first_cells("### controllers") == names(hbot.Controller)


def test_errors() -> None:
    assert first_cells("## Errors") == set(hbot.Refused.by_code)
    assert set(hbot.Refused.by_code.values()) == set(hbot.Refused.__subclasses__())
    described = named("".join("".join(cells) for cells in rows("## Errors").values()))
    assert {"holder", "angle"} <= described & set(vars(hbot.Busy("message")))


NOT_METHODS = {
    "hello": "connect",
    "info": "refresh",
    "subscribe": "states",
    "unsubscribe": "states",
}


def test_ops() -> None:
    """Every op of the page is a method, and its fields are the method's parameters."""
    methods = {name for name, member in vars(ops.Ops).items() if isinstance(member, Op)}
    assert {cell.strip("`") for cell in rows("## Ops")} - {"Op"} == methods | set(NOT_METHODS)
    for cell, cells in rows("## Ops").items():
        if cell == "Op":
            continue
        op = cell.strip("`")
        method = NOT_METHODS.get(op, op)
        owner: Any = hbot if method == "connect" else hbot.Rig
        parameters = inspect.signature(getattr(owner, method)).parameters
        fields = re.findall(r"`([a-z_]+)`(?:\?|:)", cells[1])
        if op not in ("hello", "unsubscribe"):
            # `rig.hand(None)` lets go.
            assert set(fields) - {"release"} <= set(parameters), op
    hello = set(re.findall(r"`([a-z_]+)`(?:\?|:)", rows("## Ops")["`hello`"][1]))
    assert hello - {"version"} <= set(inspect.signature(hbot.connect).parameters)


def test_answers_of_ops() -> None:
    table = rows("## Ops")
    assert named(table["`ping`"][2]) == names(hbot.Pong)
    answer = table["`load_scene`"][2].split("Answer:")[1]
    assert named(answer) == names(answers.Loaded, hbot.Effect)
    answer = table["`hello`"][2].split("Answer:")[1]
    assert named(answer) == names(hbot.Hello)


def test_both_clients_have_the_same_names_and_arguments() -> None:
    def public(kind: type[Any]) -> dict[str, list[inspect.Parameter]]:
        return {
            name: list(inspect.signature(member).parameters.values())
            for name, member in inspect.getmembers(kind, callable)
            if not name.startswith("_")
        }

    blocking, awaiting = public(hbot.Rig), public(hbot.aio.Rig)
    assert blocking.keys() == awaiting.keys()
    for name, parameters in blocking.items():
        others = awaiting[name]
        assert [(p.name, p.default, p.kind) for p in parameters] == [
            (p.name, p.default, p.kind) for p in others
        ], name
    assert asyncio.iscoroutinefunction(hbot.aio.Rig.enable)
    assert not asyncio.iscoroutinefunction(hbot.Rig.enable)
    for enable in (hbot.Rig.enable, hbot.aio.Rig.enable):
        assert str(inspect.signature(enable)) == "(self) -> 'Mode'"
        assert str(enable.__doc__).startswith("Begin to render")
    connects = [
        inspect.signature(connect).parameters for connect in (hbot.connect, hbot.aio.connect)
    ]
    assert connects[0] == connects[1]


def test_the_frame_of_the_page_is_what_is_sent() -> None:
    line = re.search(r"(?m)^    (00 00 00 .*)$", PAGE)
    assert line is not None
    request = ops.INFO
    message = {"id": 2, "op": request.op, **request.fields}
    assert wire.encoder("msgpack")(message) == bytes.fromhex(line.group(1))


def test_limits_of_the_page() -> None:
    assert "up to\n1 MiB" in PAGE or "up to 1 MiB" in PAGE
    assert wire.MAX_ANSWER_BYTES == 1 << 20
    assert f"`version`: {wire.VERSION}." in PAGE


def test_the_largest_path_is_that_of_the_page() -> None:
    page = (REPOSITORY / "docs" / "effects.md").read_text(encoding="utf-8")
    assert f"up to {scenes.MAX_POINTS} points [{', '.join(scenes.PATH_COLUMNS)}]" in page


@pytest.mark.parametrize("encoding", ["json", "msgpack"])
def test_messages_are_found_in_pieces_of_any_length(encoding: wire.Encoding) -> None:
    messages = [{"id": number, "ok": {"data": "x" * number}} for number in range(0, 300, 37)]
    data = b"".join(wire.encoder(encoding)(message) for message in messages)
    for length in (1, 2, 3, 5, 64, len(data)):
        splitter = Splitter(encoding)
        found = [
            message
            for start in range(0, len(data), length)
            for message in splitter.push(data[start : start + length])
        ]
        assert found == messages


@pytest.mark.parametrize(
    ("encoding", "data"),
    [
        ("json", b"x" * (wire.MAX_ANSWER_BYTES + 5)),
        ("json", b"[1]\n"),
        ("json", b"{]\n"),
        ("msgpack", b"\x7f\xff\xff\xff"),
        ("msgpack", b"\0\0\0\1\xc1"),
        ("msgpack", b"\0\0\0\1\x01"),
    ],
)
def test_bytes_that_are_no_message(encoding: wire.Encoding, data: bytes) -> None:
    with pytest.raises(hbot.ProtocolError):
        Splitter(encoding).push(data)


def programs(page: str) -> list[str]:
    """Return the Python programs of a page."""
    blocks = re.findall(r"(?s)```python\n(.*?)```", (REPOSITORY / page).read_text("utf-8"))
    assert blocks
    return blocks


@pytest.mark.parametrize("page", ["docs/clients.md", "clients/python/README.md"])
def test_the_programs_of_the_pages_run(
    page: str, server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each runs in the folder of the repository, for a shorter time and with another address."""
    monkeypatch.chdir(REPOSITORY)
    monkeypatch.setenv("HBOT_SERVER", server.address)
    for block in programs(page):
        if any(extra in block for extra in ("hbot.gym", "hbot.mcap", "hbot.mujoco")):
            continue  # Other tests run them.
        assert "duration=5.0" in block
        assert "hbot.connect(" in block
        code = block.replace("duration=5.0", "duration=0.2").replace('"127.0.0.1:4268", ', "")
        exec(compile(code, page, "exec"), {"__name__": "__main__"})


def test_the_stiffnesses_of_the_page_are_those_of_its_formula_and_of_info(
    start_server: Callable[..., Server],
) -> None:
    page = (REPOSITORY / "docs" / "stability.md").read_text("utf-8")
    theory = (REPOSITORY / "docs" / "internals" / "borders.md").read_text("utf-8")
    assert "K = (b + B) / (h (1/2 + D) + lag)" in theory
    ((led, damping),) = re.findall(r"damping of 0\.01 .*, (\d+) with (0\.02),", page)
    led, damping = float(led), float(damping)
    (per_hundredth,) = re.findall(r"([\d.]+) N m/rad for each 0\.01 N m s/rad of damping", page)
    with hbot.connect(start_server(edits=UNLED).address) as rig:
        render, h = rig.info.render, 1.0 / rig.info.rig.rate_hz
    assert render is not None
    assert render.damping == damping
    assert render.loop is not None
    lag = render.loop.lag_s
    # Without the lead. One decimal is written.
    assert float(per_hundredth) == pytest.approx(0.01 / (1.5e-3 + lag), abs=0.05)
    # The formula is of first order. The border that the server computes is less than 2 % below.
    first = damping / (1.5 * h + lag)  # D is 1.
    assert 0.98 * first < render.stiffness_stable < first
    with hbot.connect(start_server(rate_hz=1000).address) as rig:
        assert rig.info.render is not None
        assert rig.info.render.stiffness_stable == pytest.approx(led, abs=0.5)


def test_the_spring_of_the_page_is_the_quaternion_law(start_server: Callable[..., Server]) -> None:
    """The server's own spring and that of the page ask for the same torque at the same state."""
    (block,) = (block for block in programs("docs/clients.md") if "def spring" in block)
    own: dict[str, Any] = {}
    exec(compile(block.partition("\nwith ")[0], "docs/clients.md", "exec"), own)
    law = {"id": "s", "kind": "spring", "law": "quaternion"}
    law |= {"stiffness": own["STIFFNESS"], "damping": own["DAMPING"]}
    with hbot.connect(start_server(edits=UNLED).address, name="me") as rig, rig.lease():
        rig.load_scene({"name": "Law", "effect": [law]})
        rig.enable()
        active = [state for state in rig.states(duration=2.0) if state.mode == "active"]
        rig.disable()
    largest = max(abs(part) for state in active[50:] for part in state.torque)
    assert largest > 0.01, "the simulated hand turns the sphere"
    for state in active[50:]:
        # The allocation and the encoding of JSON round.
        assert own["spring"](state) == pytest.approx(state.torque, abs=1e-6 * largest)
