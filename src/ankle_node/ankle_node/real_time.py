"""A right to a core before usual processes, for the few nodes that keep a plate moving.

A whole process asks for it, not one thread of it: in Python every thread waits for whichever holds
the interpreter's lock, so that one thread with priority waits for another one that has none.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import resource
from pathlib import Path

HEARTBEATS_PRIORITY = 40
"""Priority of the process that sends heartbeats: it needs a core for 0.1 ms at a time, and the rig
stops without it. Priorities are of the class SCHED_RR, 1 to 99; the kernel's own threads that
answer interrupts have 50."""
RIG_PRIORITY = 30
"""Priority of the emulated rig: a rig's controller is a computer that does nothing else."""
DRIVER_PRIORITY = 20
"""Priority of the driver: above all that it works for."""
GENERATOR_PRIORITY = 10
"""Priority of the generator: what it sends is 1 s ahead of its time."""
PAGES_PRIORITY = 5
"""Priority of the node that serves the pages: a stop from a page passes through it."""
RECORDER_PRIORITY = 3
"""Priority of a recorder in real time: one that gets no core falls behind, and what waits in its
memory is lost if it is killed."""
_STEAL_COLUMN = 8
"""The time that a host took ("steal", proc(5)) stands there in the first line of /proc/stat."""
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4


def take_priority(priority: int) -> str:
    """Run every thread of this process, and those that it makes later, in the class SCHED_RR.

    Memory that was used once stays, so that no thread waits for a disk.

    Parameters
    ----------
    priority
        In the class, 1 to 99.

    Returns
    -------
    str
        Why the system does not allow it, with what would; empty where it does. The process then
        runs as any other.
    """
    try:
        for thread in Path("/proc/self/task").iterdir():
            with contextlib.suppress(ProcessLookupError):  # a thread that has just ended
                os.sched_setscheduler(
                    int(thread.name), os.SCHED_RR, os.sched_param(min(priority, 99))
                )
    except (OSError, AttributeError) as error:
        return (
            f"no real-time priority ({error}): a busy computer may stop the rig; allow priority "
            f"{priority} (`ulimit -r`, or `rtprio` in /etc/security/limits.conf)"
        )
    _keep_memory()
    return ""


def time_taken_by_host() -> float:
    """Return the processor time [s] that the host of this virtual machine has taken since the
    start, of all processors together; 0 where the system does not count it.

    A machine that stands still for its host reads it in steps of a hundredth of a second.
    """
    try:
        total = Path("/proc/stat").read_text().split("\n", 1)[0].split()
        return float(total[_STEAL_COLUMN]) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError, ValueError):
        return 0.0


def leave_priority() -> None:
    """Run as any other process again: for a program that a node in the class SCHED_RR starts, which
    inherits the class and would take a core from the rig for as long as it computes.
    """
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def _keep_memory() -> None:
    """Keep in memory what is used, where the limit of locked memory allows all of it."""
    if resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] != resource.RLIM_INFINITY and os.geteuid():
        return  # a limit that is reached later would fail allocations
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT)


def keep_loaded_objects() -> None:
    """Take what was loaded until now out of garbage collection.

    A collection that goes through all of it holds every thread up for tens of milliseconds.
    """
    gc.collect()
    gc.freeze()
