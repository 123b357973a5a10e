"""The program `python -m hbot.align`."""

from __future__ import annotations

import argparse
import functools
import socket
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from ..environment import server_address
from ..opening import connect
from ..program import one_line_errors
from ..rig import Rig
from ..turns import Quaternion
from . import Measured


def quaternion(text: str) -> Quaternion:
    """Return the quaternion `W,X,Y,Z`, scaled to the length 1.

    Raises:
        argparse.ArgumentTypeError: the text is none.
    """
    try:
        w, x, y, z = (float(part) for part in text.split(","))
        length = (w * w + x * x + y * y + z * z) ** 0.5
        return (w / length, x / length, y / length, z / length)
    except (ValueError, ZeroDivisionError):
        raise argparse.ArgumentTypeError(f"{text!r}; legal: W,X,Y,Z") from None


def size(text: str) -> tuple[int, int]:
    """Return columns and rows of `COLUMNSxROWS`.

    Raises:
        argparse.ArgumentTypeError: the text is no such size.
    """
    columns, _, rows = text.partition("x")
    if not (columns.isdigit() and rows.isdigit() and int(columns) > 0 and int(rows) > 0):
        raise argparse.ArgumentTypeError(f"{text!r}; legal: COLUMNSxROWS")
    return int(columns), int(rows)


def arguments(given: list[str] | None = None) -> argparse.Namespace:
    """Return the options of the command line."""
    shared = argparse.ArgumentParser(add_help=False)
    shared.add_argument("--server", help="HOST:PORT; default: HBOT_SERVER or 127.0.0.1:4268")
    shared.add_argument(
        "--token-file", type=Path, help="file with the server's token; default: HBOT_TOKEN_FILE"
    )
    shared.add_argument("--ca", type=Path, help="certificate of the server, if it encrypts (PEM)")
    shared.add_argument(
        "--delay", type=float, default=0.0, help="time from a picture to what arrives here, s"
    )
    parser = argparse.ArgumentParser(
        prog="python -m hbot.align",
        description="Correct the orientation of an Hbot by a camera.",
    )
    sources = parser.add_subparsers(dest="source", required=True)
    fictrac = sources.add_parser("fictrac", parents=[shared], help="lines of FicTrac over UDP")
    fictrac.add_argument("--host", default="127.0.0.1", help="address to listen at")
    fictrac.add_argument("--port", type=int, required=True, help="FicTrac's sock_port")
    fictrac.add_argument(
        "--frame",
        type=quaternion,
        default=(1.0, 0.0, 0.0, 0.0),
        metavar="W,X,Y,Z",
        help="turns the axes of FicTrac's laboratory frame into frame N; default: 1,0,0,0",
    )
    fictrac.add_argument(
        "--sigma", type=float, default=0.02, help="error about each axis, rad; default: 0.02"
    )
    tags = sources.add_parser(
        "apriltags", parents=[shared], help="grey pictures on standard input, with AprilTags"
    )
    tags.add_argument("--layout", type=Path, required=True, help="where the tags are (TOML)")
    tags.add_argument("--size", type=size, required=True, metavar="COLUMNSxROWS")
    options = parser.parse_args(given)
    try:
        options.server = server_address(options.server)
    except ValueError as error:
        parser.error(str(error))
    return options


def _orientation(rig: Rig) -> Quaternion:
    return next(rig.states()).q


def source(options: argparse.Namespace, rig: Rig) -> Iterator[Measured]:
    """Return what the chosen source measures.

    Raises:
        OSError: the socket or the layout cannot be opened.
        HbotError: the layout is wrong.
    """
    if options.source == "fictrac":
        from .fictrac import Fictrac

        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as lines:
            lines.bind((options.host, options.port))
            print(f"waits for FicTrac at {options.host}:{lines.getsockname()[1]}", flush=True)
            here = functools.partial(_orientation, rig)
            yield from Fictrac(lines, here, options.frame, options.sigma, options.delay)
        return
    import numpy as np

    from .apriltags import AprilTags, Layout

    tags = AprilTags(Layout.read(options.layout), options.delay)
    columns, rows = options.size
    print("waits for pictures", flush=True)
    while len(picture := sys.stdin.buffer.read(columns * rows)) == columns * rows:
        arrived = time.monotonic()
        measured = tags.measure(np.frombuffer(picture, np.uint8).reshape(rows, columns))
        if measured is not None:
            yield replace(measured, age=measured.age + time.monotonic() - arrived)


def correct(options: argparse.Namespace) -> None:
    """Send what a source measures to the server, until the source ends.

    Raises:
        HbotError, OSError: the server refuses this program, or something is missing.
    """
    with (
        connect(options.server, name="align", token=options.token_file, tls=options.ca) as rig,
        rig.lease(),
    ):
        measured = ignored = 0
        for it in source(options, rig):
            # The age is that of now, so the last tick tells when.
            t = max(rig.ping().t - it.age, 0.0)
            off = rig.align(it.q, sigma=it.sigma, t=t)
            measured, ignored = measured + 1, ignored + (not off.used)
            if measured == 1:
                print(f"the first orientation is {off:.3f} rad from the server's", flush=True)
        print(f"{measured} orientations, of which the server has ignored {ignored}", flush=True)


def main() -> None:
    """Run the program."""
    with one_line_errors(ImportError):
        try:
            correct(arguments())
        except KeyboardInterrupt:
            raise SystemExit(130) from None


if __name__ == "__main__":
    main()
