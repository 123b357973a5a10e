"""Recordings become arrays: the one that the repository keeps, and those of a fresh server."""

from __future__ import annotations

import dataclasses
import math
import re
import signal
import struct
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import IO, Any

import numpy
import pytest
from mcap.reader import McapReader, make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory
from serving import PATIENCE_S, RATE_HZ, REPOSITORY, SCENES, Server, program

import hbot
import hbot.mcap
from hbot.mcap.topics import STATE, TOPICS

KEPT = REPOSITORY / "crates" / "hbot-record" / "tests" / "it" / "kept" / "format-4.mcap"
DATA_END = 15  # The kind of the record that ends the chunks.
EVERY_TICK = ("/hbot/state", "/hbot/joints", "/tf", "/hbot/torque")


def begun(file: IO[bytes], source: McapReader) -> Writer:
    """Begin a recording in small chunks with the metadata of another one."""
    writer = Writer(file, chunk_size=20_000)
    writer.start()
    for metadata in source.iter_metadata():
        writer.add_metadata(metadata.name, metadata.metadata)
    return writer


def rewrite(source: Path, target: Path, lost: range) -> None:
    """Copy a recording without the ticks in `lost`, as a recorder that was too slow leaves it."""
    with source.open("rb") as old, target.open("wb") as new:
        reader = make_reader(old)
        writer = begun(new, reader)
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        first = None
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            if channel.id not in channels:
                schemas.setdefault(
                    schema.id, writer.register_schema(schema.name, schema.encoding, schema.data)
                )
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.id]
                )
            first = message.log_time if first is None else first
            if (message.log_time - first) // 1_000_000 not in lost:
                writer.add_message(
                    channels[channel.id], message.log_time, message.data, message.publish_time
                )
        writer.finish()  # type: ignore[no-untyped-call]


def test_the_arrays_are_what_an_independent_reader_finds() -> None:
    recording = hbot.mcap.read(KEPT)
    found = defaultdict(list)
    with KEPT.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _schema, channel, message, decoded in reader.iter_decoded_messages():
            found[channel.topic].append((message.log_time, decoded))
    assert set(recording) == set(TOPICS)
    for topic in EVERY_TICK:
        assert recording[topic]["log_time"].tolist() == [time for time, _ in found[topic]]
        assert recording[topic]["t"].tolist() == recording["/hbot/state"]["t"].tolist()
    assert (recording.gaps, recording.lost_ticks, recording.damaged) == ((), 0, ())
    assert recording.complete
    assert recording.joints == ("A.steer", "A.drive", "B.steer", "B.drive")
    counts = ", ".join(f"{topic}: {len(found[topic])}" for topic in recording)
    assert repr(recording) == str(recording) == f"Recording({counts})"
    state = recording["/hbot/state"]
    last = found["/hbot/state"][-1][1]
    assert state["q"][-1].tolist() == [last.q.w, last.q.x, last.q.y, last.q.z]
    assert state["joint_torque"][-1].tolist() == list(last.joint_torque)
    assert state["t"][-1] == last.t
    assert numpy.array_equal(recording["/tf"]["sphere"], state["q"])
    assert numpy.array_equal(recording["/hbot/joints"]["angle"], state["joint_angle"])
    assert numpy.array_equal(recording["/hbot/torque"]["torque"], state["torque"])
    assert numpy.abs(state["torque"]).max() > 0.0
    assert recording["/hbot/scene"]["scene"][0]["effect"][0]["kind"] == "spring"


def test_the_names_are_those_of_the_messages() -> None:
    """Every field of a state has its array, and those of `hbot.arrays` have the same name."""
    have = {field.name for field in TOPICS["/hbot/state"]} | {"t"}
    expected = {field.name for field in dataclasses.fields(hbot.State)} - {
        "joints",
        "hand",
        "orientation_sigma",
    }
    expected |= {f"joint_{field.name}" for field in dataclasses.fields(hbot.Joint)}
    for part, kind in (("client", hbot.Stream), ("timing", hbot.Timing)):
        expected.remove(part)
        expected |= {f"{part}_{field.name}" for field in dataclasses.fields(kind)}
    assert have == expected


def flat(state: hbot.State) -> dict[str, Any]:
    """Return the values of a state by the names of the arrays."""
    nothing = (math.nan,) * 4
    values = {name: getattr(state, name) for name in ("tick", "t", "mode", "q", "omega", "torque")}
    values |= {name: getattr(state, name) for name in ("slip", "scale", "traction", "energy")}
    values |= {"fault": state.fault or "", "reference": state.reference or nothing}
    for name in ("angle", "rate", "torque"):
        values[f"joint_{name}"] = tuple(getattr(joint, name) for joint in state.joints)
    for field in dataclasses.fields(state.timing):
        values[f"timing_{field.name}"] = getattr(state.timing, field.name)
    stream = state.client
    values["client_seq"] = math.nan if stream is None or stream.seq is None else float(stream.seq)
    values["client_age_ticks"] = math.nan if stream is None else float(stream.age_ticks)
    return values


@pytest.fixture
def recorded(tmp_path: Path) -> tuple[Path, list[hbot.State], list[hbot.Event]]:
    """Record a run of a server, and keep the states and events that a client received."""
    path = tmp_path / "run.mcap"
    server = Server(tmp_path, options=["--record", str(path)])
    try:
        with hbot.connect(server.address, name="me", encoding="msgpack") as rig:
            with rig.lease():
                rig.load_scene(SCENES / "compass.toml")
                rig.enable()
                rig.torque([0.01, 0.0, 0.0], valid_ms=500, seq=7)
                states = list(rig.states(duration=0.6))
                rig.estop()
            events = list(rig.events(0.0))
        server.signal(signal.SIGTERM)
        server.process.wait(PATIENCE_S)
    finally:
        server.kill()
    return path, states, events


def test_a_recording_of_a_server_has_what_its_clients_received(
    recorded: tuple[Path, list[hbot.State], list[hbot.Event]],
) -> None:
    path, states, events = recorded
    recording = hbot.mcap.read(path)
    state = recording["/hbot/state"]
    row_of = {int(tick): row for row, tick in enumerate(state["tick"])}
    assert len(states) > 100
    for received in states:
        for name, value in flat(received).items():
            # Equal in every bit: both messages have the same numbers.
            assert numpy.array_equal(
                state[name][row_of[received.tick]],
                value,
                equal_nan=isinstance(value, tuple | float),
            ), name
    assert 7.0 in state["client_seq"]
    assert [type(event) for event in recording["/hbot/event"]["event"]][-1] is hbot.StoppingEvent
    kept = [event for event in events if isinstance(event, hbot.FaultEvent | hbot.LeaseEvent)]
    assert kept
    assert all(event in list(recording["/hbot/event"]["event"]) for event in kept)
    assert recording["/hbot/scene"]["name"][-1] == "Compass"
    assert recording.complete
    # The numbers of the ticks say which ones are missing. On a busy machine some are.
    missing = numpy.diff(state["tick"]).sum() - (len(state["tick"]) - 1)
    assert sum(gap.ticks for gap in recording.gaps) == missing


def test_topics_and_a_time_can_be_chosen() -> None:
    whole = hbot.mcap.read(KEPT)["/hbot/torque"]
    part = hbot.mcap.read(KEPT, ["/hbot/torque"], start=0.25, end=0.5)
    assert list(part) == ["/hbot/torque"]
    assert len(part["/hbot/torque"]["t"]) == 250
    inside = (whole["t"] >= 0.25) & (whole["t"] < 0.5)
    assert numpy.array_equal(part["/hbot/torque"]["torque"], whole["torque"][inside])
    one = hbot.mcap.read(KEPT, "/hbot/torque", start=0.25, end=0.5)
    assert list(one) == ["/hbot/torque"], "a text is the name of one topic"
    assert numpy.array_equal(one["/hbot/torque"]["torque"], part["/hbot/torque"]["torque"])
    for wrong in ("/hbot/exact", ["/hbot/exact"]):
        with pytest.raises(ValueError, match=r"'/hbot/exact' is no topic; legal: /hbot/state"):
            hbot.mcap.read(KEPT, wrong)
    with pytest.raises(KeyError):
        part["/hbot/state"]


def test_a_gap_is_named(tmp_path: Path) -> None:
    path = tmp_path / "gap.mcap"
    rewrite(KEPT, path, lost=range(300, 340))
    for topics in (None, ["/hbot/event"]):
        recording = hbot.mcap.read(path, topics)
        assert [gap.ticks for gap in recording.gaps] == [40]
        assert recording.gaps[0].t == pytest.approx(0.34, abs=1e-9)  # rounding of a double
        assert recording.complete


def test_a_damaged_chunk_is_a_gap_and_is_named(tmp_path: Path) -> None:
    small = tmp_path / "small.mcap"
    rewrite(KEPT, small, lost=range(0))
    with small.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    # The middle of a chunk, because indexes of chunks between them cost no tick.
    chunk = summary.chunk_indexes[len(summary.chunk_indexes) // 3]
    data = bytearray(small.read_bytes())
    data[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 0x40
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data)
    recording = hbot.mcap.read(damaged)
    assert len(recording.damaged) == 1
    assert "the chunk at" in recording.damaged[0]
    assert recording.complete
    lost = sum(gap.ticks for gap in recording.gaps)
    assert lost > 0
    assert len(recording["/hbot/state"]["t"]) == 1000 - lost


def changed(path: Path, place: int, bit: int) -> Path:
    """Write the kept recording with one bit changed."""
    data = bytearray(KEPT.read_bytes())
    data[place] ^= 1 << bit
    path.write_bytes(data)
    return path


def summary_of_kept() -> tuple[list[int], int]:
    """Return the places of the chunks of the kept recording, and of the record that ends them."""
    with KEPT.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        [footer] = struct.unpack("<9xQ20x", KEPT.read_bytes()[-37:])
    return sorted(chunk.chunk_start_offset for chunk in summary.chunk_indexes), footer - 13


def test_what_recover_could_not_read_stays_known(tmp_path: Path) -> None:
    chunks, _ = summary_of_kept()
    middle = chunks[len(chunks) // 2]
    broken, mended = changed(tmp_path / "broken.mcap", middle + 2000, 6), tmp_path / "mended.mcap"
    for damaged, complete in [(1, True), (0, False)]:
        subprocess.run([program(), "recover", broken, mended], check=False, timeout=PATIENCE_S)
        recording = hbot.mcap.read(mended)
        assert (len(recording.damaged), recording.complete) == (damaged, complete)
        broken.write_bytes(KEPT.read_bytes()[: middle + 2000])
        mended.unlink()


def test_a_damaged_first_chunk_costs_its_own_messages_only(tmp_path: Path) -> None:
    """The first chunk says which topic has which number. The index at the end repeats it."""
    [first, *_], end = summary_of_kept()
    place = first + 9 + 3 * 8  # Its check code, after its kind, its length, two times, a size.
    recording = hbot.mcap.read(changed(tmp_path / "damaged.mcap", place, 4))
    assert len(recording.damaged) == 1
    assert recording.complete
    tick = recording["/hbot/state"]["tick"]
    assert tick.tolist() == list(range(tick[0], 1000))
    assert 0 < tick[0] < 1000
    # An index that is damaged too is not believed.
    data = bytearray((tmp_path / "damaged.mcap").read_bytes())
    data[end + 100] ^= 1
    (tmp_path / "damaged.mcap").write_bytes(data)
    recording = hbot.mcap.read(tmp_path / "damaged.mcap")
    assert len(recording.damaged) == 1
    assert len(recording["/hbot/state"]["tick"]) == 0


def test_a_damaged_chunk_with_the_definition_of_another_topic_costs_no_more(tmp_path: Path) -> None:
    """Both topics of torque have the same message, which the first chunk defines."""
    small = tmp_path / "small.mcap"
    with KEPT.open("rb") as old, small.open("wb") as new:
        reader = make_reader(old)
        writer = begun(new, reader)
        channels: dict[str, int] = {}
        number = 0
        for count, (schema, _, message) in enumerate(reader.iter_messages(["/hbot/torque"])):
            assert schema is not None
            topic = "/hbot/torque" if count < 500 else "/hbot/torque/other"
            number = number or writer.register_schema(schema.name, schema.encoding, schema.data)
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "protobuf", number)
            writer.add_message(channels[topic], message.log_time, message.data, message.log_time)
        writer.finish()  # type: ignore[no-untyped-call]
    with small.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    data = bytearray(small.read_bytes())
    data[summary.chunk_indexes[0].chunk_start_offset + 9 + 3 * 8] ^= 1
    (tmp_path / "damaged.mcap").write_bytes(data)
    recording = hbot.mcap.read(tmp_path / "damaged.mcap")
    assert len(recording.damaged) == 1
    assert 0 < len(recording["/hbot/torque"]["t"]) < 500
    assert len(recording["/hbot/torque/other"]["t"]) == 500


def test_a_damaged_index_costs_nothing(tmp_path: Path) -> None:
    whole = hbot.mcap.read(KEPT)
    _, end = summary_of_kept()
    for place in range(end + 22, KEPT.stat().st_size - 8, 509):
        recording = hbot.mcap.read(changed(tmp_path / "damaged.mcap", place, 4))
        assert recording.damaged == ()
        for name, values in whole["/hbot/state"].items():
            numpy.testing.assert_array_equal(recording["/hbot/state"][name], values)


def records_of_kept() -> list[int]:
    """Return the places of the records of the kept recording that precede its index."""
    data, places = KEPT.read_bytes(), [8]
    while data[places[-1]] != DATA_END:
        places.append(places[-1] + 9 + struct.unpack_from("<Q", data, places[-1] + 1)[0])
    return places


def test_damage_is_named_wherever_it_is(tmp_path: Path) -> None:
    """A changed bit in the kind or the length of any record, or between two chunks."""
    whole = hbot.mcap.read(KEPT, STATE)["/hbot/state"]
    chunks, end = summary_of_kept()
    places = [
        (place + byte, bit)
        for place in records_of_kept()
        for byte in (0, 1, 8)
        for bit in (0, 3, 7)
    ]
    places += [(place, bit) for place in (chunks[0], chunks[-1]) for bit in range(8)]
    for place, bit in [*places, (chunks[-1] - 20, 4), (end - 20, 4)]:
        path = changed(tmp_path / "damaged.mcap", place, bit)
        try:
            recording = hbot.mcap.read(path, STATE)
        except hbot.IllegalInput:
            assert place < chunks[0]
            continue
        assert recording.damaged or not recording.complete, (place, bit)
        state = recording["/hbot/state"]
        kept = numpy.isin(whole["tick"], state["tick"])
        for name, values in whole.items():
            numpy.testing.assert_array_equal(state[name], values[kept])


def test_damage_of_a_cut_file_is_named_too(tmp_path: Path) -> None:
    """A file that is cut has no check code of the whole."""
    [first, *_, last], end = summary_of_kept()
    for bit in range(8):
        path = changed(tmp_path / "damaged.mcap", last, bit)
        path.write_bytes(path.read_bytes()[:end])
        recording = hbot.mcap.read(path, STATE)
        assert len(recording.damaged) == 1
        assert not recording.complete
    # A length that swallows what is between two chunks.
    data = bytearray(KEPT.read_bytes()[:end])
    struct.pack_into("<Q", data, first + 1, last - first - 9)
    path.write_bytes(data)
    assert len(hbot.mcap.read(path, STATE).damaged) == 1


def test_metadata_that_contradict_the_states_are_named(tmp_path: Path) -> None:
    place = KEPT.read_bytes().index(b"A.steer A.drive") + len(b"A.steer")
    with pytest.raises(
        hbot.IllegalInput, match=r"damaged\.mcap is damaged: .* has 4 values, not 3"
    ):
        hbot.mcap.read(changed(tmp_path / "damaged.mcap", place, 4))


def test_a_file_that_was_cut_is_read_up_to_there(tmp_path: Path) -> None:
    small, cut = tmp_path / "small.mcap", tmp_path / "cut.mcap"
    rewrite(KEPT, small, lost=range(0))
    data = small.read_bytes()
    whole = hbot.mcap.read(small, ["/hbot/state"])["/hbot/state"]
    # The metadata is the second record of the file, and its last text is a version, 0.1.0.
    metadata_end = data.index(b"version", data.index(b"clock_unix_ns")) + len(b"version") + 4 + 5
    counts = set()
    for length in range(0, len(data), len(data) // 37):
        cut.write_bytes(data[:length])
        if length < metadata_end:
            with pytest.raises(ValueError, match=r"cut\.mcap"):
                hbot.mcap.read(cut)
            continue
        recording = hbot.mcap.read(cut, ["/hbot/state"])
        state = recording["/hbot/state"]
        count = len(state["t"])
        counts.add(count)
        assert not recording.complete
        assert recording.damaged == ()
        assert numpy.array_equal(state["torque"], whole["torque"][:count])
    assert len(counts) > 10
    assert max(counts) > 900


def test_a_client_records_the_same_times(tmp_path: Path) -> None:
    """`hbot record` does not store the clock; the arrays have the times of the states anyway."""
    server = Server(tmp_path)
    path = tmp_path / "client.mcap"

    def clock_ns() -> int:
        with hbot.connect(server.address) as rig:
            assert rig.info.clock is not None
            return rig.info.clock.unix_ns

    try:
        before_ns = clock_ns()
        command = [
            str(program()),
            "record",
            str(path),
            "--server",
            server.address,
            "--duration",
            "0.5",
        ]
        subprocess.run(command, check=False, timeout=PATIENCE_S, stdout=subprocess.DEVNULL)
        after_ns = clock_ns()
    finally:
        server.kill()
    recording = hbot.mcap.read(path)
    state = recording["/hbot/state"]
    assert len(state["tick"]) > 10
    # The time of tick 0 when the recording began. On a busy machine the time of the simulated rig
    # waits, and the server's clock moves.
    (zero_ns,) = set((state["log_time"] - state["tick"] * (1_000_000_000 // RATE_HZ)).tolist())
    assert before_ns <= zero_ns <= after_ns
    assert state["t"] == pytest.approx(state["tick"] / RATE_HZ, rel=1e-12)  # rounding
    assert not len(recording["/hbot/torque/other"]["t"])
    assert recording["/hbot/torque/other"]["joint_torque"].shape == (0, 4)


def test_another_scene_is_a_topic_of_its_own(tmp_path: Path) -> None:
    other = tmp_path / "other.mcap"
    scene = SCENES / "compass.toml"
    command = [str(program()), "replay", str(KEPT), "--scene", str(scene), "--out", str(other)]
    subprocess.run(command, check=True, timeout=PATIENCE_S, stdout=subprocess.DEVNULL)
    recording = hbot.mcap.read(other, ["/hbot/torque", "/hbot/torque/other"])
    torques = [recording[topic]["torque"] for topic in recording]
    assert torques[0].shape == torques[1].shape == (1000, 3)
    assert numpy.abs(torques[0] - torques[1]).max() > 0.0


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    for name, data in {"empty": b"", "text": b"t,w,x,y,z\n0,1,0,0,0\n"}.items():
        path = tmp_path / name
        path.write_bytes(data)
        with pytest.raises(ValueError, match=name):
            hbot.mcap.read(path)
    foreign = tmp_path / "foreign.mcap"
    with foreign.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()  # type: ignore[no-untyped-call]
    with pytest.raises(ValueError, match="no recording of hbot"):
        hbot.mcap.read(foreign)


def test_the_programs_of_the_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")  # No display is needed, as the page says.
    (tmp_path / "run.mcap").write_bytes(KEPT.read_bytes())
    page = (REPOSITORY / "docs" / "recordings.md").read_text(encoding="utf-8")
    blocks = re.findall(r"(?s)```python\n(.*?)```", page)
    assert len(blocks) == 2
    for block in blocks:
        exec(compile(block, "docs/recordings.md", "exec"), {"__name__": "__main__"})
    assert (tmp_path / "torque.png").stat().st_size > 10_000
    assert len(capsys.readouterr().out.splitlines()) == 1000


def test_the_page_lists_every_array() -> None:
    page = (REPOSITORY / "docs" / "recordings.md").read_text(encoding="utf-8")
    section = page.split("\n## Arrays\n")[1].split("\n## ")[0]
    rows = [line.strip("|").split("|") for line in section.splitlines() if line.startswith("| ")]
    listed = {
        topic: re.findall(r"`([a-z_]+)`", row[1])
        for row in rows
        for topic in re.findall(r"`([a-z/]+)`", row[0])
    }
    assert listed == {topic: [field.name for field in fields] for topic, fields in TOPICS.items()}


def test_a_missing_package_is_named(tmp_path: Path) -> None:
    """Without the extra the package works, and the error names the command that installs it."""
    (tmp_path / "mcap.py").write_text("raise ImportError('no mcap here')")
    code = (
        "import hbot\n"
        "try:\n    import hbot.mcap\n"
        "except hbot.MissingExtra as error:\n    print(error)"
    )
    run = [sys.executable, "-c", code]
    done = subprocess.run(
        run, env={"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True, check=True
    )
    assert done.stdout == (
        "hbot.mcap needs packages (no mcap here): in the project's folder, run "
        "`pip install './clients/python[mcap]'`\n"
    )
