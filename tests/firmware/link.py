"""The few frames of docs/link.md that a test sends and reads itself, in place of a server."""

import os
import struct
import termios
import time
import tty
import zlib

from bench import PATIENCE

# Controller flags.
ENABLED, WATCHDOG_EXPIRED = 0x0001, 0x0002


def frame(body):
    """Returns the frame of `body`, which is shorter than a run of COBS."""
    checked = body + struct.pack("<I", zlib.crc32(body))
    assert len(checked) < 254
    runs = checked.split(b"\0")
    return b"".join(bytes([len(run) + 1]) + run for run in runs) + b"\0"


def unframe(bytes_):
    """Returns the body of a frame, which is given without its delimiter. None if it is damaged."""
    body, at = b"", 0
    while at < len(bytes_):
        code = bytes_[at]
        body += bytes_[at + 1:at + code] + (b"\0" if at + code < len(bytes_) else b"")
        at += code
    intact = len(body) > 4 and struct.pack("<I", zlib.crc32(body[:-4])) == body[-4:]
    return body[:-4] if intact else None


class Line:
    """The port of a controller, while no server uses it."""

    def __init__(self, port):
        self.file = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.file)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        os.close(self.file)

    def drop(self):
        """Drops what the controller has not read yet and what it has answered, as a loose plug."""
        termios.tcflush(self.file, termios.TCIOFLUSH)

    def ask_with_torque(self, sequence, joints):
        """Sends a command with `enable` true and 0.01 N m for each of `joints` joints. Returns the
        controller flags of its answer. `sequence` is below 128, so that it is one byte."""
        torque = struct.pack("<f", 0.01) * joints
        os.write(self.file, b"\0" + frame(bytes([1, sequence, 1, 100, joints]) + torque))
        received = b""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            try:
                received += os.read(self.file, 4096)
            except BlockingIOError:
                time.sleep(0.01)
            for piece in received.split(b"\0")[:-1]:
                body = unframe(piece)
                if body and body[:2] == bytes([1, sequence]):
                    return body[2]
        raise AssertionError(f"no answer to command {sequence} within {PATIENCE} s: {received!r}")
