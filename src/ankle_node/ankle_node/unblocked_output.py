"""Log lines that hold nothing up: a terminal that is paused, a pipe that nobody reads or a disk
that is busy delays what is shown, never the node.

rclpy writes a log line while it holds Python's interpreter lock, so a write that blocks stops every
thread of the process. Here the lines go into a pipe that never blocks, and a thread that waits
without the lock passes them on. Lines beyond what the pipe holds are dropped.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import sys
import threading
from collections.abc import Iterator

STDERR = 2
PIPE_SIZE = 1 << 20
"""[bytes] Size of the pipe, the largest that Linux gives to every user: 10,000 log lines."""
LARGEST_READ = 1 << 16
"""[bytes] Largest part that is passed on at once."""
LONGEST_FAREWELL = 1.0
"""[s] Longest wait at the end of the process for what has not been passed on yet."""
NO_LOG_FILES = ("--ros-args", "--disable-external-lib-logs")
"""Arguments that keep rclpy from writing each line into a file of its own as well: that write waits
for the disk in the same way."""


def _pass_on(source: int, target: int) -> None:
    while data := os.read(source, LARGEST_READ):
        with contextlib.suppress(OSError):  # a terminal that is gone
            while data:
                data = data[os.write(target, data) :]
    os.close(source)


@contextlib.contextmanager
def unblocked_output() -> Iterator[None]:
    """Let log lines of this process pass through a thread, until the context ends.

    What Python itself prints is written directly, because Python waits without the lock.
    """
    target, (reader, writer) = os.dup(STDERR), os.pipe()
    with contextlib.suppress(OSError):  # a smaller pipe does
        fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
    os.set_blocking(writer, False)
    if os.isatty(STDERR):
        os.environ.setdefault("RCUTILS_COLORIZED_OUTPUT", "1")
    printed = sys.stderr
    sys.stderr = os.fdopen(os.dup(target), "w", buffering=1, errors="backslashreplace")
    os.dup2(writer, STDERR)
    os.close(writer)
    thread = threading.Thread(target=_pass_on, args=(reader, target), name="log", daemon=True)
    thread.start()
    try:
        yield
    finally:
        os.dup2(target, STDERR)
        sys.stderr.close()
        sys.stderr = printed
        thread.join(timeout=LONGEST_FAREWELL)
