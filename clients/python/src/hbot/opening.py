"""Opens connections of the blocking client."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from .connection import Connection, Options
from .environment import server_token
from .events import Event
from .rig import Rig
from .transport import Tls
from .wire import Encoding


def connect(
    address: str | None = None,
    *,
    name: str = "python",
    token: str | Path | None = None,
    tls: Tls | None = None,
    encoding: Encoding = "json",
    timeout: float = 5.0,
    on_event: Callable[[Event], None] | None = None,
) -> Rig:
    """Connect to a server.

    Args:
        address: `HOST:PORT` or `HOST`. The default port is 4268. None: the address in the
            environment variable `HBOT_SERVER`, or `127.0.0.1:4268` if it is not set or empty.
        name: name of this client, shown to people, 1 to 64 bytes.
        token: the server's token, or the path of the file that holds it. Required if the server has
            one. None: the file that the environment variable `HBOT_TOKEN_FILE` names, if it is set.
        tls: what to trust if the server encrypts: a PEM file with the server's own certificate
            (pinned) or with that of an authority; or an `ssl.SSLContext`. None: no encryption.
        encoding: `"json"`, or `"msgpack"` with the extra `msgpack`.
        timeout: longest time to connect, and to wait for an answer or for a state, s.
        on_event: called for each event, in a separate thread. Without it, `Rig.events` returns
            them.

    Raises:
        NoServer: no program listens at the address.
        NotTrusted: the server's certificate is not trusted, or only one side encrypts.
        Refused: the server refused the hello, for example `Unauthorized`.
        IllegalInput: the address has no legal port.
        OSError: the file of the token cannot be read.
    """
    options = Options(name, server_token(token), tls, encoding, timeout)
    return Rig(Connection(address, options), on_event)
