"""The streams of the Lab Streaming Layer, received from the program in a separate process."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from serving import PATIENCE_S, RATE_HZ, SCENES, Server, eventually

import hbot
from hbot import clock
from hbot.lsl import streams
from hbot.lsl.__main__ import Publisher, arguments

pylsl = pytest.importorskip("pylsl", reason="the extra lsl is installed in CI")


ROUNDING_S = 1e-6
"""Two computations of one time differ by no more."""


def tick_0(server: Server) -> float:
    """Return the time of tick 0, s. It grows when the simulated rig waits for a busy machine."""
    with hbot.connect(server.address) as rig:
        told = clock.told(rig)
    assert told is not None
    return told.seconds


class Program:
    """`python -m hbot.lsl`, and inlets for its two streams."""

    def __init__(self, server: Server, folder: Path, *options: str) -> None:
        """Start the program and find its streams."""
        self.earliest = tick_0(server)
        self._log = folder / "lsl.log"
        command = [sys.executable, "-m", "hbot.lsl", server.address, "--markers", "127.0.0.1:0"]
        with self._log.open("wb") as log:
            self.process = subprocess.Popen([*command, *options], stdout=log, stderr=log)
        self.samples = self._inlet(server, streams.SAMPLES)
        self.markers = self._inlet(server, streams.MARKERS)
        self.texts: list[tuple[str, float]] = []

    def _inlet(self, server: Server, name: str) -> Any:
        """Return an inlet for a stream of this program. Other programs may publish others."""
        query = f"name='{name}' and starts-with(source_id, 'hbot-{server.address}')"
        found: list[Any] = []

        def find() -> bool:
            assert self.process.poll() is None, self.log()
            found.extend(pylsl.resolve_bypred(query, 1, 5.0))
            return bool(found)

        eventually(find, f"the stream {name}")
        inlet = pylsl.StreamInlet(found[0], recover=False)
        inlet.open_stream(PATIENCE_S)
        return inlet

    def end(self) -> None:
        """End the inlets and the program."""
        for inlet in (self.samples, self.markers):
            inlet.close_stream()
        self.process.kill()
        self.process.wait(PATIENCE_S)

    def log(self) -> str:
        """Return what the program has printed."""
        return self._log.read_text()

    def marked(self, pattern: str) -> float:
        """Wait for a marker whose text matches `pattern`. Returns its time."""

        def find() -> bool:
            text, stamp = self.markers.pull_sample(0.1)
            if text is not None:
                self.texts.append((text[0], stamp))
            return any(re.search(pattern, text) for text, _ in self.texts)

        eventually(find, f"the marker {pattern}")
        return next(stamp for text, stamp in self.texts if re.search(pattern, text))

    def mark(self, text: str) -> None:
        """Send a marker as a client does."""
        found = re.search(r"to 127\.0\.0\.1:(\d+)", self.log())
        assert found is not None
        with socket.create_connection(("127.0.0.1", int(found.group(1))), PATIENCE_S) as line:
            line.sendall(f"{text}\n".encode())


@pytest.fixture
def program(server: Server, tmp_path: Path) -> Iterator[Program]:
    """Start the program for the shared server."""
    program = Program(server, tmp_path)
    yield program
    program.end()


def test_every_state_is_a_sample_at_the_time_of_its_tick(server: Server, program: Program) -> None:
    description = program.samples.info()
    assert description.nominal_srate() == RATE_HZ
    labels = description.get_channel_labels()
    assert labels[:6] == ["tick", "t", "q.w", "q.x", "q.y", "q.z"]
    assert description.get_channel_units()[6:13] == ["rad/s"] * 3 + ["N m"] * 3 + ["J"]
    samples: list[list[float]] = []
    stamps: list[float] = []
    until = time.monotonic() + PATIENCE_S
    while len(samples) < 2 * RATE_HZ and time.monotonic() < until:
        chunk, times = program.samples.pull_chunk(1.0)
        samples += chunk
        stamps += times
    ticks = [sample[0] for sample in samples]
    assert ticks == list(range(int(ticks[0]), int(ticks[0]) + len(ticks))), "no tick is lost"
    latest = tick_0(server)
    for sample, stamp in zip(samples, stamps, strict=True):
        assert len(sample) == len(labels)
        # Both are computed from the same clock. As long as nothing waited, they differ by rounding.
        offset = stamp - sample[1]
        assert program.earliest - ROUNDING_S <= offset <= latest + ROUNDING_S
        assert sum(part * part for part in sample[2:6]) == pytest.approx(1.0, abs=1e-9)


def test_faults_scenes_the_lease_and_the_text_of_clients_are_markers(
    server: Server, program: Program
) -> None:
    with hbot.connect(server.address, name="me") as rig:
        with rig.lease():
            program.marked("^lease acquired by me$")
            rig.load_scene(SCENES / "compass.toml")
            name = rig.refresh().scene["name"]
            program.marked(f"^scene {name}$")
            before = pylsl.local_clock()
            program.mark("trial 3 begins: übung")
            assert before <= program.marked("^trial 3 begins: übung$") <= pylsl.local_clock()
            rig.estop()
            stamp = program.marked("^estop: .*me")
            fault = next(event for event in rig.events() if isinstance(event, hbot.FaultEvent))
            # A marker of a tick has the time of the tick.
            offset = stamp - fault.t
            assert program.earliest - ROUNDING_S <= offset <= tick_0(server) + ROUNDING_S
            rig.reset()
            program.marked("^reset: idle$")
        program.marked("^lease released$")


def test_the_program_survives_its_server(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    server = Server(first)
    program = Program(server, tmp_path)
    try:
        assert program.samples.pull_sample(PATIENCE_S)[0] is not None
        server.kill()
        program.marked("^disconnected$")
        server = Server(second, port=int(server.address.rsplit(":", 1)[1]))
        while program.samples.pull_sample(0.0)[0] is not None:
            pass  # Samples of the first server.
        sample, _ = program.samples.pull_sample(PATIENCE_S)
        assert sample is not None
        assert sample[1] < PATIENCE_S, "the ticks count from 0 again"
    finally:
        program.end()
        server.kill()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--token-file", "missing"], "No such file or directory: 'missing'"),
        (
            ["--markers", "{server}"],
            "{server}: another program has this port; choose another by `--markers 127.0.0.1:",
        ),
        (["--ca", "missing"], "missing: no certificate can be read from it"),
    ],
)
def test_what_is_wrong_ends_the_program_with_one_line(
    server: Server, tmp_path: Path, options: list[str], message: str
) -> None:
    options = [option.format(server=server.address) for option in options]
    command = [sys.executable, "-m", "hbot.lsl", server.address, "--markers", "127.0.0.1:0"]
    done = subprocess.run(
        [*command, *options], capture_output=True, text=True, cwd=tmp_path, timeout=PATIENCE_S
    )
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    assert message.format(server=server.address) in line


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--markers", "here"], "'here'; legal: HOST:PORT"),
        (["--markers", "127.0.0.1:65536"], "legal: HOST:PORT"),
        (["--every", "0"], "--every 0; legal: 1 or more"),
    ],
)
def test_a_wrong_option_is_named(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        arguments(options)
    assert message in capsys.readouterr().err


def test_ctrl_c_ends_a_program_that_waits_for_its_server(tmp_path: Path) -> None:
    log = tmp_path / "lsl.log"
    command = [sys.executable, "-m", "hbot.lsl", "127.0.0.1:1", "--markers", "127.0.0.1:0"]
    with log.open("wb") as out, subprocess.Popen(command, stdout=out, stderr=out) as program:
        eventually(lambda: "no connection" in log.read_text(), "it waits")
        time.sleep(0.1)  # Its subject is a moment of the wait.
        program.send_signal(signal.SIGINT)
        assert program.wait(PATIENCE_S) == 0
    assert len(log.read_text().splitlines()) == 2, "where markers go, and what is missing"


def test_the_clock_is_followed_while_events_come_and_after_a_late_answer(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    publisher = Publisher(arguments([server.address]))
    publisher._offset = clock.Offset(0.0, 0.0, shared=True)
    asked: list[str] = []

    def told(_rig: hbot.Rig) -> None:
        asked.append("")
        if len(asked) == 1:
            raise hbot.TimedOut("info: no answer for 5.0 s")

    monkeypatch.setattr(clock, "told", told)
    event = hbot.LostEvent(1, 0, 0)
    with hbot.connect(server.address) as rig:
        watch = threading.Thread(target=publisher._watch, args=(rig,), daemon=True)
        watch.start()

        def flooded() -> bool:
            rig._connection._put_event(event)
            return len(asked) >= 3

        eventually(flooded, "it asks again")
    watch.join(PATIENCE_S)
    assert not watch.is_alive()


def test_round_trips_enclose_the_clock(server: Server) -> None:
    """The way between two machines, tried where the truth is known."""
    with hbot.connect(server.address) as rig:
        ahead_s = 1000.0
        earliest = tick_0(server)
        here = clock.measure(rig, time.monotonic)
        shared = clock.offset(rig)
        other = clock.offset(rig, lambda: time.monotonic() + ahead_s)
        latest = tick_0(server)
        assert shared.shared
        assert earliest <= shared.seconds <= latest
        assert not here.shared
        assert not other.shared
        # A ping tells of a tick at most when the service has heard of it. Within a period of that,
        # the estimate is right whatever the machine does meanwhile.
        for found, seconds in ((here, here.seconds), (other, other.seconds - ahead_s)):
            error = found.uncertainty + 1.0 / RATE_HZ
            assert earliest - error <= seconds <= latest + error


def test_every_event_has_a_text() -> None:
    lost = hbot.LostEvent(states=3, events=0, sends=0)
    assert streams.marker(lost) == "lost: 3 states so far, by this program"
    dropped = hbot.DroppedEvent(count=2, total=5)
    assert streams.marker(dropped) == "dropped: 5 states so far, by the server"
    fault = hbot.FaultEvent(1, 0.1, "fault", "slip", "why")
    assert streams.marker(fault) == "fault slip: why"
    refused = hbot.RefusedEvent(1, 1, "torque", "not_holder", "why")
    assert streams.marker(refused) is None
