"""Starts the real server for a test."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def server(*options: str) -> Iterator[str]:
    """Run a server with a simulated rig. Returns its address.

    The environment variable HBOT_PROGRAM names the program.
    """
    arguments = [os.environ["HBOT_PROGRAM"], "server", "--listen", "127.0.0.1:0", *options]
    with subprocess.Popen(
        arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        try:
            assert process.stdout is not None
            said = []
            for line in process.stdout:
                said.append(line)
                if found := re.search(r"listen\s+(\S+:\d+)", line):
                    yield found[1]
                    return
            raise AssertionError(f"the server has ended: {''.join(said)}")
        finally:
            process.terminate()
