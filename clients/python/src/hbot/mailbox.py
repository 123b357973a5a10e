"""A queue between the thread that reads a connection and the program that uses it.

It never blocks the thread.
"""

from __future__ import annotations

import contextlib
import queue
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Mailbox(Generic[T]):
    """A queue of bounded length. If it is full, the oldest item is dropped and counted."""

    def __init__(self, limit: int, wake: Callable[[], None] | None = None) -> None:
        """Create an empty mailbox.

        Args:
            limit: largest number of items.
            wake: called by the reading thread after each item, and at the end. For programs that do
                not use `get`.
        """
        self.dropped = self._dropped_before = 0
        # The end is an exception among the items. What takes it puts it back for all others.
        self._items: queue.SimpleQueue[T | Exception] = queue.SimpleQueue()
        self._limit = limit
        self._wake = wake

    def put(self, item: T) -> bool:
        """Add an item. Return whether an older one was dropped for it."""
        full = self._items.qsize() >= self._limit
        if full:
            with contextlib.suppress(Exception):  # The end stays.
                self.take()
            self.dropped += 1
        self._add(item)
        return full

    def end(self, error: Exception) -> None:
        """Raise `error` to everybody who takes from the mailbox, after the items that are in it."""
        self._add(error)

    def take(self) -> T | None:
        """Return the oldest item, or None if there is none.

        Raises the error of `end` after the last item.
        """
        return self.get(0.0)

    def get(self, timeout: float | None) -> T | None:
        """Return the oldest item, and wait at most `timeout` s for it (None: without limit).

        None: none came.
        """
        try:
            item = self._items.get(timeout=None if timeout is None else max(timeout, 0.0))
        except queue.Empty:
            return None
        if isinstance(item, Exception):
            self._items.put(item)
            raise item
        return item

    def newest(self, timeout: float) -> tuple[T | None, int]:
        """Return the newest item and the number of older ones that are skipped.

        Items that were dropped since the last call count as skipped. Waits as `get` does.
        """
        item = self.get(timeout)
        dropped = self.dropped
        skipped, self._dropped_before = dropped - self._dropped_before, dropped
        with contextlib.suppress(Exception):  # The next call raises the end.
            while item is not None and (later := self.take()) is not None:
                item, skipped = later, skipped + 1
        return item, skipped

    def _add(self, item: T | Exception) -> None:
        self._items.put(item)
        if self._wake is not None:
            self._wake()
