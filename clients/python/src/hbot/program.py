"""How a program on a terminal ends at an expected error."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from .errors import HbotError


@contextmanager
def one_line_errors(*more: type[Exception]) -> Iterator[None]:
    """End the program at an expected error: its message on standard error, and exit code 1.

        with hbot.one_line_errors(), hbot.connect() as rig:
            ...

    Expected errors are those of this package (`HbotError`) and of the system (`OSError`, such as a
    file that is missing). The person at the terminal mends their causes without the source code, so
    a traceback would only hide the message. Any other exception passes with its traceback.

    Args:
        more: other exceptions that the program expects.

    Raises:
        SystemExit: an expected error has left the block. Its message is printed.
    """
    expected: tuple[type[Exception], ...] = (HbotError, OSError, *more)
    try:
        yield
    except BrokenPipeError:
        # Who reads standard output has enough, such as `head`. Python must not write the rest.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(1) from None
    except expected as error:
        print(f"error: {str(error) or type(error).__name__}", file=sys.stderr, flush=True)
        raise SystemExit(1) from error
