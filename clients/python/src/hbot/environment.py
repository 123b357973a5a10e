"""The environment variables that name the server, by the rules of the command `hbot`."""

from __future__ import annotations

import os
from pathlib import Path

DEFAULT_ADDRESS = "127.0.0.1:4268"
"""Address of a server that nobody has configured."""
SERVER = "HBOT_SERVER"
"""Names the address of the server."""
TOKEN_FILE = "HBOT_TOKEN_FILE"
"""Names the file that holds the server's token."""


def server_address(given: str | None) -> str:
    """Return the address that the program gives, else that of `HBOT_SERVER`, else the default.

    An empty variable is as if it was not set.
    """
    return given if given is not None else os.environ.get(SERVER) or DEFAULT_ADDRESS


def server_token(given: str | Path | None) -> str | Path | None:
    """Return the token that the program gives, else the path of `HBOT_TOKEN_FILE`, else None.

    An empty variable is as if it was not set.
    """
    if given is not None:
        return given
    file = os.environ.get(TOKEN_FILE)
    return Path(file) if file else None
