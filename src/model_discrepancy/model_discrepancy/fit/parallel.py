"""Fits of a search that do not depend on each other run at the same time, one on each core, and
leave the cores to whatever else needs them.

They run in threads: Fourier transforms and linear algebra let other threads go on meanwhile. The
results do not depend on the number of cores. When the process ends, they end first: a thread that
comes back from a Fourier transform to a Python that has ended aborts the process.
"""

from __future__ import annotations

import atexit
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import copy_context
from typing import Any, Generic, TypeVar

from threadpoolctl import threadpool_limits

Item = TypeVar("Item")
Result = TypeVar("Result")

# What each step refits at the same time; further threads would only wait for Python.
MOST_THREADS = 4

# A graph that moves a subject may run on the same computer; 10 is what `nice` gives.
NICENESS = 10

# [s] A Fourier transform of two minutes takes as long; another thread that waits the usual 5 ms for
# Python leaves its core idle for a dozen of them. A diagnosis with nine terms takes 5 % less.
SWITCH_INTERVAL = 0.0005

# [s] Longest wait for computations when the process ends; each asks after every refit and every
# derivative whether it should, most often within a second.
LONGEST_FAREWELL = 10.0

# [s] How often a thread that waits looks for signals. One that another thread received, or that
# came just before the wait, does not end a wait without a limit: an interruption would be lost.
SIGNAL_INTERVAL = 0.1

_ending = threading.Event()
# Each is set when a computation in the background has ended. A thread whose `join` was interrupted
# counts as ended in Python 3.11, though it runs.
_background: set[threading.Event] = set()

_sharing = threading.Lock()
# Threads that compute beside the one that called first, less those that wait for others.
_helping = 0


def in_parallel(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """Return the result of a function for each item, in their order.

    The function may itself call this one: whichever call has items left takes a core that is idle.

    Parameters
    ----------
    function
        Called in the context of the caller (the joint profile in force), in any thread. What it
        raises is raised here.
    items
        Of any number.
    """
    shared = _Shared(function, items)
    shared.work(shared.take_idle_core)
    return shared.finished()


class _Shared(Generic[Item, Result]):
    """Holds items that the calling thread and those on idle cores take one after the other."""

    def __init__(self, function: Callable[[Item], Result], items: Sequence[Item]) -> None:
        self._function, self._items = function, items
        self._next = iter(range(len(items)))
        self._results: list[Any] = [None] * len(items)
        self._errors: list[BaseException] = []
        self._threads: list[threading.Thread] = []
        self._left = len(items)

    def take_idle_core(self) -> None:
        """Start a thread where a core is idle and more than one item is left."""
        if self._left > 1 and _take_core():
            thread = threading.Thread(target=copy_context().run, args=(self._help,), daemon=True)
            self._threads.append(thread)
            thread.start()

    def work(self, before_each: Callable[[], None] = lambda: None) -> None:
        """Compute items as long as there are any, and none after an error or when the process
        ends.
        """
        while not self._errors:
            if _ending.is_set():
                self._errors.append(SystemExit("the process ends"))
                return
            before_each()
            with _sharing:
                place = next(self._next, None)
                self._left -= place is not None
            if place is None:
                return
            try:
                self._results[place] = self._function(self._items[place])
            except BaseException as error:
                self._errors.append(error)

    def _help(self) -> None:
        try:
            self.work()
        finally:
            _change_helping(-1)

    def finished(self) -> list[Result]:
        """Wait for the other threads, and return the results, or raise the first error."""
        running = [thread for thread in self._threads if thread.is_alive()]
        if running:
            # Whoever has items left may have this core meanwhile.
            _change_helping(-1)
            for thread in running:
                thread.join()
            _change_helping(1)
        if self._errors:
            raise self._errors[0]
        return self._results


def _take_core() -> bool:
    """Take a core where one is idle, and return whether there was one."""
    global _helping
    with _sharing:
        taken = _helping < min(cores(), MOST_THREADS) - 1
        _helping += taken
    return taken


def _change_helping(by: int) -> None:
    global _helping
    with _sharing:
        _helping += by


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
    ended = threading.Event()

    def work() -> None:
        if hasattr(os, "setpriority"):
            thread = threading.get_native_id()
            present = os.getpriority(os.PRIO_PROCESS, thread)
            os.setpriority(os.PRIO_PROCESS, thread, max(present, NICENESS))
        try:
            done.append(function())
        except BaseException as error:
            failed.append(error)
        finally:
            ended.set()

    # An interrupted caller ends, and `_end` lets the thread end with it.
    threading.Thread(target=copy_context().run, args=(work,), daemon=True).start()
    _background.add(ended)
    while not ended.wait(SIGNAL_INTERVAL):
        pass
    _background.discard(ended)
    if failed:
        raise failed[0]
    return done[0]


@atexit.register
def _end() -> None:
    """Let all computations in the background end, as long as `LONGEST_FAREWELL`."""
    _ending.set()
    last = time.monotonic() + LONGEST_FAREWELL
    for ended in list(_background):
        ended.wait(max(last - time.monotonic(), 0.0))


@contextmanager
def side_by_side() -> Iterator[None]:
    """Return a context in which threads hinder each other least.

    The linear algebra starts no threads of its own, which on matrices of this size only wait for
    each other, and a thread that computes in Python lets others go on after `SWITCH_INTERVAL`.
    """
    usual = sys.getswitchinterval()
    sys.setswitchinterval(min(usual, SWITCH_INTERVAL))
    try:
        with threadpool_limits(1, "blas"):
            yield
    finally:
        sys.setswitchinterval(usual)


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
