"""`connect` without an address finds the server as the commands of `hbot` do."""

from __future__ import annotations

import asyncio
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from serving import PATIENCE_S, Server, program

import hbot
from hbot.environment import DEFAULT_ADDRESS, server_address, server_token
from hbot.lsl.__main__ import arguments

TOKEN = "a token that is long enough"


@pytest.fixture
def guarded(tmp_path: Path) -> Iterator[Server]:
    """Start a server that asks for a token. The token is in the file `token` of the folder."""
    (tmp_path / "token").write_text(f"{TOKEN}\n")
    server = Server(tmp_path, api='token_file = "token"')
    yield server
    server.kill()


def test_the_variables_name_server_and_token(
    guarded: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HBOT_SERVER", guarded.address)
    with pytest.raises(hbot.Unauthorized):
        hbot.connect()
    monkeypatch.setenv("HBOT_TOKEN_FILE", str(tmp_path / "token"))
    with hbot.connect() as rig:
        assert rig.info.rig.name == "Hbot prototype"

    async def main() -> str:
        async with hbot.aio.connect() as rig:
            return rig.info.rig.name

    assert asyncio.run(main()) == "Hbot prototype"
    with pytest.raises(hbot.Unauthorized):
        hbot.connect(token="what the program gives counts, even if it is wrong")
    # The same two variables are those of the commands.
    done = subprocess.run([program(), "info"], capture_output=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr


def test_what_the_program_gives_counts_more(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HBOT_SERVER", "127.0.0.1:1")
    with pytest.raises(hbot.NoServer, match=r"127\.0\.0\.1:1:"):
        hbot.connect()
    hbot.connect(server.address).close()


def test_without_the_variables_the_defaults_count(monkeypatch: pytest.MonkeyPatch) -> None:
    assert (server_address(None), server_token(None)) == (DEFAULT_ADDRESS, None)
    assert arguments([]).address == DEFAULT_ADDRESS
    monkeypatch.setenv("HBOT_SERVER", "rig.local")
    assert arguments([]).address == "rig.local"
    assert arguments(["other.local"]).address == "other.local"


def test_a_variable_that_is_empty_is_as_if_unset(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HBOT_SERVER", "")
    monkeypatch.setenv("HBOT_TOKEN_FILE", "")
    assert (server_address(None), server_token(None)) == (DEFAULT_ADDRESS, None)
    assert arguments([]).address == DEFAULT_ADDRESS
