"""Moments at which this computer itself stood still.

On each processor a process of the highest real-time priority asks for the time every 2 ms. Nothing
in this computer runs before it; where it is late all the same, the processor was not there: a
virtual machine's host had taken it, or firmware.

    sudo .venv/bin/python benchmarks/standstills.py --minutes 2
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import time
from multiprocessing.queues import Queue
from typing import NamedTuple

HIGHEST_PRIORITY = 90  # of SCHED_FIFO; above the kernel's own threads that answer interrupts
PERIOD = 0.002  # s
LEAST_STANDSTILL = 0.02  # s


class Standstill(NamedTuple):
    """Holds one standstill of one processor: when it ended (monotonic clock) and how long it was
    [s].
    """

    processor: int
    end: float
    length: float

    def __str__(self) -> str:
        return f"{1e3 * self.length:.0f} ms on processor {self.processor}"


def _watch(processor: int, found: Queue[Standstill]) -> None:
    os.sched_setaffinity(0, {processor})
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(HIGHEST_PRIORITY))
    last = time.monotonic()
    while True:
        time.sleep(PERIOD)
        now = time.monotonic()
        if now - last > LEAST_STANDSTILL:
            found.put(Standstill(processor, now, now - last))
        last = now


class Standstills:
    """Watches every processor from `start` to `stop`; without the right to the priority it sees
    nothing and says so.
    """

    def __init__(self) -> None:
        self._queue: Queue[Standstill] = multiprocessing.Queue()
        self._processes: list[multiprocessing.Process] = []
        self._found: list[Standstill] = []

    def start(self) -> None:
        """Begin to watch."""
        for processor in os.sched_getaffinity(0):
            process = multiprocessing.Process(
                target=_watch, args=(processor, self._queue), daemon=True
            )
            process.start()
            self._processes.append(process)

    def stop(self) -> None:
        """End the processes."""
        for process in self._processes:
            process.terminate()

    def found(self) -> list[Standstill]:
        """Return all standstills until now, in the order in which they were told."""
        while not self._queue.empty():
            self._found.append(self._queue.get())
        return self._found

    def longest_between(self, begin: float, end: float) -> Standstill | None:
        """Return the longest one that ended between two times of the monotonic clock [s]."""
        these = [one for one in self.found() if begin <= one.end <= end]
        return max(these, key=lambda one: one.length, default=None)

    def __str__(self) -> str:
        if not all(process.is_alive() for process in self._processes):
            return "standstills of this computer could not be watched: no real-time priority"
        longest = max(self.found(), key=lambda one: one.length, default=None)
        if longest is None:
            return f"this computer never stood still for over {1e3 * LEAST_STANDSTILL:.0f} ms"
        return (
            f"this computer stood still {len(self.found())} times for over "
            f"{1e3 * LEAST_STANDSTILL:.0f} ms, at longest {longest}"
        )


def main() -> None:
    """Watch for a while and print every standstill."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--minutes", type=float, default=1.0)
    given = options.parse_args()
    watch = Standstills()
    watch.start()
    try:
        end = time.monotonic() + 60 * given.minutes
        shown = 0
        while time.monotonic() < end:
            time.sleep(1.0)
            for one in watch.found()[shown:]:
                print(f"{one.end:.3f} s: {one}", flush=True)
            shown = len(watch.found())
        print(watch)
    finally:
        watch.stop()


if __name__ == "__main__":
    main()
