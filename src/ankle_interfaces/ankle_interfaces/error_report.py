"""The last line of a process that an exception ends: an error of the user or of the program."""

from __future__ import annotations

import sys
import tempfile
import traceback

from ankle_interfaces.errors import UserError

USERS_ERRORS = (UserError, OSError)
"""What a user can act on: refusals by the packages, and by the operating system (file, network)."""
USERS_ERROR = 1
"""Exit code after one of them."""
PROGRAM_ERROR = 70
"""Exit code after any other exception: EX_SOFTWARE of sysexits.h, an internal software error."""


def report_error(error: BaseException) -> int:
    """Write an error as one line on stderr and return the exit code.

    An error of the program is named with its place; its traceback is kept in a new file of the
    folder for temporary files.

    Parameters
    ----------
    error
        Exception as it was caught.

    Returns
    -------
    int
        `USERS_ERROR` or `PROGRAM_ERROR`.
    """
    if isinstance(error, USERS_ERRORS):
        print(f"error: {error}", file=sys.stderr, flush=True)
        return USERS_ERROR
    last = traceback.extract_tb(error.__traceback__)[-1]
    print(
        f"error of the program, not of its input: {type(error).__name__}: "
        f"{' '.join(str(error).split())} ({last.filename}:{last.lineno}); {_kept_traceback(error)}",
        file=sys.stderr,
        flush=True,
    )
    return PROGRAM_ERROR


def _kept_traceback(error: BaseException) -> str:
    text = "".join(traceback.format_exception(type(error), error, error.__traceback__))
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="ankle-traceback-", suffix=".txt", delete=False, encoding="utf-8"
        ) as file:
            file.write(text)
    except OSError:  # a full disk must not hide the error
        return f"its traceback:\n{text}"
    return f"its traceback is in {file.name}"
