"""Servers that send what no server of hbot sends: each ends in one clear exception."""

from __future__ import annotations

import asyncio
import json
import queue
import socket
import struct
import threading
from collections.abc import Callable

import pytest
from serving import PATIENCE_S, Server, eventually

import hbot
from hbot.connection import Connection, Options
from hbot.mailbox import Mailbox
from hbot.wire import Splitter

HELLO = {"server": "hbot 0.1.0", "version": 1, "rig": "x", "rate_hz": 1000.0, "session": 1}


def serve(talk: Callable[[socket.socket, dict[str, object]], None]) -> str:
    """Return the address of a server that reads one hello and lets `talk` do the rest."""
    listener = socket.create_server(("127.0.0.1", 0))

    def run() -> None:
        with listener:
            connection = listener.accept()[0]
        with connection:
            talk(connection, json.loads(connection.makefile("rb").readline()))

    threading.Thread(target=run, daemon=True).start()
    return f"127.0.0.1:{listener.getsockname()[1]}"


def welcome(connection: socket.socket, hello: dict[str, object]) -> None:
    """Answer a hello."""
    connection.sendall(json.dumps({"id": hello["id"], "ok": HELLO}).encode() + b"\n")


def test_blank_lines_are_passed_over() -> None:
    splitter = Splitter("json")
    assert splitter.push(b"\n" * 65536 + b'{"a":1}\n\r\n\n{"b":2}\n') == [{"a": 1}, {"b": 2}]

    def talk(connection: socket.socket, hello: dict[str, object]) -> None:
        connection.sendall(b"\n" * 65536)
        welcome(connection, hello)
        connection.sendall(b"\n" * 65536)
        connection.makefile("rb").readline()
        connection.sendall(b"\n" * 65536 + b'{"id":1,"ok":{"tick":7}}\n')
        connection.recv(1)

    connection = Connection(serve(talk), Options("me"))
    answers: queue.Queue[tuple[object, Exception | None]] = queue.Queue()
    connection.start(Mailbox(10))
    connection.request("ping", {}, lambda body, error: answers.put((body, error)))
    assert answers.get(timeout=PATIENCE_S) == ({"tick": 7}, None)
    connection.close()


def test_an_error_of_a_wrong_type_is_named() -> None:
    def talk(connection: socket.socket, hello: dict[str, object]) -> None:
        welcome(connection, hello)
        connection.makefile("rb").readline()
        connection.sendall(b'{"id":1,"error":5}\n')
        connection.recv(1)

    # The first request is `info`.
    with pytest.raises(hbot.ProtocolError, match="int in place of the description of an error"):
        hbot.connect(serve(talk))

    def refuse(connection: socket.socket, hello: dict[str, object]) -> None:
        connection.sendall(json.dumps({"id": hello["id"], "error": "no"}).encode() + b"\n")

    with pytest.raises(hbot.ProtocolError, match="str in place of"):
        hbot.connect(serve(refuse))


def test_a_reset_before_the_hello_is_answered_is_a_lost_connection() -> None:
    def reset(connection: socket.socket, hello: dict[str, object]) -> None:
        # With no time to linger, closing sends a reset.
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))

    with pytest.raises(hbot.ConnectionLost, match="before the answer to hello"):
        hbot.connect(serve(reset))


def test_a_callback_of_events_ends_with_a_connection_that_cannot_be_read(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    raised: list[object] = []
    monkeypatch.setattr(threading, "excepthook", raised.append)
    before = threading.active_count()
    rig = hbot.connect(server.address, on_event=raised.append)
    rig._connection._fail(hbot.ProtocolError("no map"))
    eventually(lambda: threading.active_count() <= before, "both threads have ended")

    async def main() -> None:
        rig = await hbot.aio.connect(server.address, on_event=raised.append)
        rig._connection._fail(hbot.ProtocolError("no map"))
        assert rig._callbacks is not None
        await asyncio.wait_for(rig._callbacks, PATIENCE_S)

    asyncio.run(main())
    assert not raised
