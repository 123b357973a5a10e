"""The program `python -m hbot.lsl`."""

from __future__ import annotations

import argparse
import errno
import socketserver
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

from .. import clock
from ..environment import server_address
from ..errors import ConnectionLost, HbotError, NoServer, TimedOut
from ..events import Event, FaultEvent, SceneEvent, SetEvent
from ..opening import connect
from ..program import one_line_errors
from ..rig import Rig
from .streams import MARKERS, SAMPLES, Outlets, channels, marker

RETRY_S = 1.0
"""Time between two attempts to reach a server that has gone, s."""
FOLLOW_EVERY_S = 0.1
"""Time between two questions for the server's clock, if the server has the same clock, s."""
MEASURE_EVERY_S = 10.0
"""Time between two estimates of the offset, if the server has another clock, s."""
SMOOTHING = 0.3
"""Fraction of a new estimate that is taken over, so that time stamps do not jump."""
MARKER_PORT = 4270
"""TCP port of the markers of clients. 4268 and 4269 are the server's own."""
MARKER_BYTES = 1024
"""Longest marker of a client, bytes."""


def place(text: str) -> tuple[str, int]:
    """Return host and port of `HOST:PORT`. Port 0 stands for any that is free.

    Raises:
        argparse.ArgumentTypeError: the text is no such place.
    """
    host, _, port = text.rpartition(":")
    if not port.isdigit() or int(port) >= 1 << 16:
        raise argparse.ArgumentTypeError(f"{text!r}; legal: HOST:PORT")
    return host, int(port)


def arguments(given: list[str] | None = None) -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m hbot.lsl",
        description="Publish an Hbot as streams of the Lab Streaming Layer.",
    )
    parser.add_argument(
        "address", nargs="?", help="the server; default: HBOT_SERVER or 127.0.0.1:4268"
    )
    parser.add_argument("--every", type=int, default=1, help="ticks from sample to sample, from 1")
    parser.add_argument(
        "--token-file", type=Path, help="file with the server's token; default: HBOT_TOKEN_FILE"
    )
    parser.add_argument("--ca", type=Path, help="certificate of the server, if it encrypts (PEM)")
    parser.add_argument("--encoding", choices=("json", "msgpack"), default="json")
    parser.add_argument(
        "--markers",
        type=place,
        default=f"127.0.0.1:{MARKER_PORT}",
        metavar="HOST:PORT",
        help=f"where clients send markers, a line each (TCP); default: 127.0.0.1:{MARKER_PORT}",
    )
    parser.add_argument(
        "--clock",
        choices=("auto", "ping"),
        default="auto",
        help="auto: the server's clock if it is on this machine; ping: always by round trips",
    )
    options = parser.parse_args(given)
    if options.every < 1:
        parser.error(f"--every {options.every}; legal: 1 or more")
    try:
        options.address = server_address(options.address)
    except ValueError as error:
        parser.error(str(error))
    return options


class Publisher:
    """Publishes one server until it has gone."""

    def __init__(self, options: argparse.Namespace) -> None:
        """Remember the options."""
        self._options = options
        self._offset: clock.Offset | None = None
        self.outlets: Outlets | None = None

    def run(self) -> None:
        """Connect, and publish until the connection ends.

        Raises:
            HbotError: the connection has ended, or there is none.
        """
        options = self._options
        with connect(
            options.address,
            name="lsl",
            token=options.token_file,
            tls=options.ca,
            encoding=options.encoding,
        ) as rig:
            if self.outlets is None:
                self.outlets = Outlets(options.address, rig.info, options.every)
            elif self.outlets.channels != channels(rig.info):
                raise SystemExit("the server has another rig now: start this program again")
            found = self._measure(rig)
            way = "clock" if found.shared else f"ping, +-{found.uncertainty * 1e3:.3f} ms"
            print(f"{SAMPLES}, {MARKERS}: {rig.info.rig.name} at {options.address} ({way})")
            sys.stdout.flush()
            threading.Thread(target=self._watch, args=(rig,), daemon=True).start()
            for state in rig.states(options.every):
                self.outlets.push(state, self._offset.seconds if self._offset else 0.0)

    def _measure(self, rig: Rig) -> clock.Offset:
        assert self.outlets is not None
        now = self.outlets.now
        self._offset = (
            clock.measure(rig, now) if self._options.clock == "ping" else clock.offset(rig, now)
        )
        return self._offset

    def _watch(self, rig: Rig) -> None:
        """Publish the events, and follow the server's clock. Runs in a thread."""
        measured = time.monotonic()
        with suppress(HbotError):  # The thread that reads states reports the end.
            while True:
                due = time.monotonic() + FOLLOW_EVERY_S
                for event in rig.events(FOLLOW_EVERY_S):
                    self._mark(rig, event)
                    if time.monotonic() > due:
                        break
                if self._offset is None:
                    continue
                with suppress(TimedOut):  # One late answer: it is asked again.
                    if self._offset.shared:
                        # It moves when the time of the simulated rig waits for a busy machine.
                        self._offset = clock.told(rig) or self._offset
                    elif time.monotonic() - measured > MEASURE_EVERY_S:
                        measured = time.monotonic()
                        self._follow(rig)

    def _follow(self, rig: Rig) -> None:
        before = self._offset
        assert before is not None
        assert self.outlets is not None
        new = clock.measure(rig, self.outlets.now)
        seconds = before.seconds + SMOOTHING * (new.seconds - before.seconds)
        self._offset = clock.Offset(seconds, new.uncertainty, shared=False)

    def _mark(self, rig: Rig, event: Event) -> None:
        text = marker(event)
        if text is None or self.outlets is None:
            return
        tick = event.tick if isinstance(event, FaultEvent | SceneEvent | SetEvent) else None
        if tick is None or self._offset is None:
            self.outlets.mark(text)
        else:
            self.outlets.mark(text, self._offset.seconds + tick / rig.hello.rate_hz)


class MarkerLines(socketserver.ThreadingTCPServer):
    """Receives the markers of clients: lines of text over TCP."""

    allow_reuse_address = True
    daemon_threads = True

    def __init__(self, address: tuple[str, int], publisher: Publisher) -> None:
        """Listen at `address`, host and port.

        Raises:
            OSError: that is not possible, for example because another program listens there.
        """
        self.publisher = publisher
        try:
            super().__init__(address, MarkerHandler)
        except OSError as error:
            host, port = address
            if error.errno != errno.EADDRINUSE:
                why = f"{error.strerror}: --markers {host}:{port}"
                raise OSError(error.errno, why) from error
            other = port + 1 if port < (1 << 16) - 1 else port - 1
            raise OSError(
                f"{host}:{port}: another program has this port; "
                f"choose another by `--markers {host}:{other}`"
            ) from error


class MarkerHandler(socketserver.StreamRequestHandler):
    """Receives the lines of one client."""

    def handle(self) -> None:
        """Publish each line as a marker."""
        assert isinstance(self.server, MarkerLines)
        while line := self.rfile.readline(MARKER_BYTES):
            text = line.decode("utf-8", errors="replace").strip()
            if text and self.server.publisher.outlets is not None:
                self.server.publisher.outlets.mark(text)


def main() -> None:
    """Run the program."""
    with one_line_errors():
        publish(arguments())


def publish(options: argparse.Namespace) -> None:
    """Publish until Ctrl-C. A server that has gone is tried again every second.

    Raises:
        HbotError, OSError: the server refuses this program, or something is missing.
    """
    publisher = Publisher(options)
    lines = MarkerLines(options.markers, publisher)
    threading.Thread(target=lines.serve_forever, daemon=True).start()
    host, port = lines.server_address[:2]
    print(f"markers of clients: one line of text each, to {host!s}:{port}", flush=True)
    said = ""
    with suppress(KeyboardInterrupt):
        while True:
            try:
                publisher.run()
            except (ConnectionLost, NoServer, TimedOut) as error:
                if str(error) != said:
                    said = str(error)
                    print(said, file=sys.stderr, flush=True)
                if publisher.outlets is not None and isinstance(error, ConnectionLost):
                    publisher.outlets.mark("disconnected")
                time.sleep(RETRY_S)


if __name__ == "__main__":
    main()
