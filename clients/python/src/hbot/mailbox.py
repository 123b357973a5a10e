"""A queue between the thread that reads a connection and the program that uses it.

It never blocks the thread.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
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
        self._items: deque[T] = deque()
        self._limit = limit
        self._wake = wake
        self._end: Exception | None = None
        # A binary semaphore: free if something has happened since the last `get`.
        self._signal = threading.Lock()
        self._signal.acquire()

    def put(self, item: T) -> bool:
        """Add an item. Return whether an older one was dropped for it."""
        full = len(self._items) >= self._limit
        if full:
            self._items.popleft()
            self.dropped += 1
        self._items.append(item)
        self._notify()
        return full

    def end(self, error: Exception) -> None:
        """Raise `error` to everybody who takes from the mailbox, after the items that are in it."""
        self._end = error
        self._notify()

    def take(self) -> T | None:
        """Return the oldest item, or None if there is none.

        Raises the error of `end` after the last item.
        """
        try:
            return self._items.popleft()
        except IndexError:
            if self._end is not None:
                raise self._end from None
            return None

    def get(self, timeout: float | None) -> T | None:
        """Return the oldest item, and wait at most `timeout` s for it (None: without limit).

        None: none came.
        """
        until = None if timeout is None else time.monotonic() + timeout
        while True:
            item = self.take()
            if item is not None:
                if self._items:
                    self._release()  # Another thread may wait for the next item.
                return item
            left = -1.0 if until is None else until - time.monotonic()
            if until is not None and left <= 0.0:
                return None
            if not self._signal.acquire(timeout=left):
                return self.take()

    def newest(self, timeout: float) -> tuple[T | None, int]:
        """Return the newest item and the number of older ones that are skipped.

        Items that were dropped since the last call count as skipped. Waits as `get` does.
        """
        item = self.get(timeout)
        dropped = self.dropped
        skipped, self._dropped_before = dropped - self._dropped_before, dropped
        while item is not None and self._items and (later := self.take()) is not None:
            item, skipped = later, skipped + 1
        return item, skipped

    def _notify(self) -> None:
        self._release()
        if self._wake is not None:
            self._wake()

    def _release(self) -> None:
        with contextlib.suppress(RuntimeError):  # It is free already.
            self._signal.release()
