"""The environment variables that name the server, by the rules of the command `hbot`."""

from __future__ import annotations

import os
from pathlib import Path

from .errors import IllegalInput

DEFAULT_ADDRESS = "127.0.0.1:4268"
"""Address of a server that nobody has configured."""
SERVER = "HBOT_SERVER"
"""Names the address of the server."""
TOKEN_FILE = "HBOT_TOKEN_FILE"
"""Names the file that holds the server's token."""


def server_address(given: str | None) -> str:
    """Return the address that the program gives, else that of `HBOT_SERVER`, else the default.

    Raises:
        IllegalInput: the variable is needed and empty.
    """
    return given if given is not None else _variable(SERVER, "HOST:PORT") or DEFAULT_ADDRESS


def server_token(given: str | Path | None) -> str | Path | None:
    """Return the token that the program gives, else the path of `HBOT_TOKEN_FILE`, else None.

    Raises:
        IllegalInput: the variable is needed and empty.
    """
    if given is not None:
        return given
    file = _variable(TOKEN_FILE, "the path of a file")
    return None if file is None else Path(file)


def _variable(name: str, legal: str) -> str | None:
    """Return the value of a variable, or None if it is not set."""
    value = os.environ.get(name)
    if value == "":
        raise IllegalInput(f"the environment variable {name} is empty; legal: {legal}, or unset it")
    return value
