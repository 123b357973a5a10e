"""Fixtures: the real server, and both encodings."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from serving import Server

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


@pytest.fixture
def unled_server(tmp_path: Path) -> Iterator[Server]:
    """Start a server for one test, whose rig renders without a lead."""
    server = Server(tmp_path, edits={"lead = true": "lead = false"})
    yield server
    server.kill()


@pytest.fixture
def own_server(tmp_path: Path) -> Iterator[Server]:
    """Start a server for one test, which may kill it."""
    server = Server(tmp_path)
    yield server
    server.kill()


@pytest.fixture(params=["json", "msgpack"])
def encoding(request: pytest.FixtureRequest) -> str:
    """Return each encoding in turn."""
    return str(request.param)
