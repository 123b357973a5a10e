"""Calls the function `on_event` of a program."""

from __future__ import annotations

import logging
from collections.abc import Callable

from .events import Event

_LOG = logging.getLogger("hbot")


def call_back(on_event: Callable[[Event], None], event: Event) -> None:
    """Pass an event to the program's function.

    An exception of the function is logged with its traceback by the logger `hbot`, and the next
    event is passed on nevertheless. So one mistake in the function does not hide a later fault.
    """
    try:
        on_event(event)
    except Exception:
        _LOG.exception("on_event has raised an exception at %r", event)
