"""Fixtures: the real server, and both encodings."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from serving import Server

# A shell that starts the tests in the background makes their programs ignore SIGINT.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Read by the library of LSL when it is loaded: streams stay on this machine.
os.environ["LSLAPICFG"] = str(Path(__file__).parent / "lsl_api.cfg")
# The tests start their own servers. These variables would send them to another one.
for variable in ("HBOT_SERVER", "HBOT_TOKEN_FILE"):
    os.environ.pop(variable, None)


@pytest.fixture(scope="session")
def shared_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Start one server for all tests that leave it alive."""
    server = Server(tmp_path_factory.mktemp("server"))
    yield server
    server.kill()


@pytest.fixture
def server(shared_server: Server) -> Server:
    """Return the shared server, settled."""
    shared_server.settle()
    return shared_server


@pytest.fixture(scope="session")
def _virtual_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Start one server in virtual time, 1000 ticks a second, for the tests that let it pass."""
    folder = tmp_path_factory.mktemp("virtual")
    server = Server(folder, rate_hz=1000, options=["--time", "virtual"])
    yield server
    server.kill()


@pytest.fixture
def virtual_server(_virtual_server: Server) -> Iterator[Server]:
    """Return the server in virtual time. Between tests, when nobody stops its time, it sleeps."""
    _virtual_server.process.send_signal(signal.SIGCONT)
    yield _virtual_server
    _virtual_server.process.send_signal(signal.SIGSTOP)


@pytest.fixture
def start_server(tmp_path: Path) -> Iterator[Callable[..., Server]]:
    """Return a function that starts a server for one test, with the arguments of `Server`."""
    started: list[Server] = []

    def start(**options: Any) -> Server:
        started.append(Server(tmp_path, **options))
        return started[-1]

    yield start
    for server in started:
        server.kill()


@pytest.fixture
def own_server(start_server: Callable[..., Server]) -> Server:
    """Start a server for one test, which may kill it."""
    return start_server()


@pytest.fixture(params=["json", "msgpack"])
def encoding(request: pytest.FixtureRequest) -> str:
    """Return each encoding in turn."""
    return str(request.param)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print the figures of tests that record some."""
    for report in terminalreporter.getreports("passed"):
        for name, figures in report.user_properties:
            terminalreporter.line(f"{name}: {figures}")
