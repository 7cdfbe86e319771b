"""Fits of a search that do not depend on each other run at the same time, one on each core, and
leave the cores to whatever else needs them.

They run in threads: Fourier transforms and linear algebra let other threads go on meanwhile. The
results do not depend on the number of cores.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import ContextVar, copy_context
from typing import TypeVar

from threadpoolctl import threadpool_limits

Item = TypeVar("Item")
Result = TypeVar("Result")

# What each step refits at the same time; further threads would only wait for Python.
MOST_THREADS = 4

# A graph that moves a subject may run on the same computer; 10 is what `nice` gives.
NICENESS = 10

_in_a_thread: ContextVar[bool] = ContextVar("in_a_thread", default=False)


def in_parallel(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """Return the result of a function for each item, in their order.

    Parameters
    ----------
    function
        Called in the context of the caller (the joint profile in force), in any thread. What it
        raises is raised here.
    items
        Of any number.
    """
    threads = min(cores(), len(items), MOST_THREADS)
    if threads < 2 or _in_a_thread.get():
        return [function(item) for item in items]
    with ThreadPoolExecutor(threads) as pool:
        waiting = [pool.submit(copy_context().run, _marked, function, item) for item in items]
        return [one.result() for one in waiting]


def in_background(function: Callable[[], Result]) -> Result:
    """Return the result of a function that gives way to the other work of this computer.

    On Linux a thread has a niceness of its own, which those that it starts inherit; the calling
    thread keeps its own. The function runs in the caller's context.

    Parameters
    ----------
    function
        What it raises is raised here.
    """
    done: list[Result] = []
    failed: list[BaseException] = []

    def work() -> None:
        if hasattr(os, "setpriority"):
            thread = threading.get_native_id()
            present = os.getpriority(os.PRIO_PROCESS, thread)
            os.setpriority(os.PRIO_PROCESS, thread, max(present, NICENESS))
        try:
            done.append(function())
        except BaseException as error:
            failed.append(error)

    # An interrupted caller ends, and with it the thread.
    thread = threading.Thread(target=copy_context().run, args=(work,), daemon=True)
    thread.start()
    thread.join()
    if failed:
        raise failed[0]
    return done[0]


def linear_algebra_alone() -> threadpool_limits:
    """Return a context in which the linear algebra starts no threads of its own: on matrices of
    this size they only wait for each other.
    """
    return threadpool_limits(1, "blas")


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _marked(function: Callable[[Item], Result], item: Item) -> Result:
    """Call a function so that it starts no further threads."""
    _in_a_thread.set(True)
    return function(item)
