"""A process that ends when its parent ends, however that happens."""

from __future__ import annotations

import contextlib
import ctypes
import signal

# Loaded here: nothing may be loaded between fork and exec.
_LIBC = ctypes.CDLL(None, use_errno=True)
_PR_SET_PDEATHSIG = 1


def end_with_parent(number: signal.Signals = signal.SIGKILL) -> None:
    """Ask Linux to send this process a signal when its parent ends.

    Other systems have no such call; there the process goes on.

    Parameters
    ----------
    number
        The signal that is sent when the parent ends.
    """
    with contextlib.suppress(AttributeError):
        _LIBC.prctl(_PR_SET_PDEATHSIG, number)
