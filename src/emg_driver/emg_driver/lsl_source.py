"""A thread that finds a Lab Streaming Layer stream, reads it, and finds it again.

What happens comes out as events in the order in which it happened; nothing is judged here.
Connections are not recovered by the library, because it would hide that the sender started anew
with another clock.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pylsl

from emg_driver.clock_mapping import SteadyCorrection
from emg_driver.stream_description import StreamDescription

SEARCH = 1.0
"""[s] Length of one search; each ends with an event."""
OPENING_TIMEOUT = 5.0
"""[s] Longest wait for the stream's description and the first measurement of its clock."""
POLL_TIMEOUT = 0.2
"""[s] Longest wait for samples before looking whether to stop."""
BUFFER = 10
"""[s] Length of the samples that the library keeps for us."""
CORRECTION_PERIOD = 1.0
"""[s] Time between two readings of the time correction; the library measures it every few seconds
in the background."""
LARGEST_CHUNK = 4096
RETRY_PERIOD = 2.0
"""[s] Time before a stream that was refused is looked at again."""


@dataclass(frozen=True)
class Searching:
    """Tells that no stream fits; `predicate` says what is looked for."""

    predicate: str


@dataclass(frozen=True)
class Connected:
    """Tells that samples of this stream follow."""

    stream: StreamDescription


@dataclass(frozen=True)
class Chunk:
    """Holds samples of a stream that came together.

    Attributes
    ----------
    samples
        Shape (n, channels), in the stream's units.
    stamps
        By the sender's clock [s], shape (n,).
    correction
        That LSL measured [s].
    arrival
        By this computer's LSL clock [s].
    """

    samples: np.ndarray
    stamps: np.ndarray
    correction: float
    arrival: float


@dataclass(frozen=True)
class Lost:
    """Tells that the connection is gone."""

    reason: str


def predicate(name: str, kind: str, source_id: str) -> str:
    """Return the search expression for a stream by name, type and source id.

    An empty one fits any stream.
    """
    wanted = [
        f"{key}='{value}'"
        for key, value in (("name", name), ("type", kind), ("source_id", source_id))
        if value
    ]
    return " and ".join(wanted) or "channel_count > 0"


class LslSource:
    """Reads a stream until `stop`.

    Parameters
    ----------
    wanted
        Search expression, as `predicate` makes it.
    notify
        Called, in the thread, after each event.

    Attributes
    ----------
    events
        What happened; read by one thread.
    """

    def __init__(self, wanted: str, notify: Callable[[], None]) -> None:
        self.events: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._wanted = wanted
        self._notify = notify
        self._stopped = threading.Event()
        self._dropped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="lsl", daemon=True)
        self._thread.start()

    def drop(self) -> None:
        """Leave the present stream and look again after `RETRY_PERIOD`."""
        self._dropped.set()

    def stop(self) -> None:
        """End the thread."""
        self._stopped.set()
        self._thread.join(OPENING_TIMEOUT + SEARCH)

    def _tell(self, event: object) -> None:
        self.events.put(event)
        self._notify()

    def _run(self) -> None:
        while not self._stopped.is_set():
            found = pylsl.resolve_bypred(self._wanted, 1, SEARCH)
            if not found:
                self._tell(Searching(self._wanted))
                continue
            try:
                self._read(found[0])
            except RuntimeError as error:  # the base of all errors of pylsl
                self._tell(Lost(f"{type(error).__name__} {error}".strip()))
            if self._dropped.is_set():
                self._stopped.wait(RETRY_PERIOD)
                self._dropped.clear()

    def _read(self, info: Any) -> None:
        inlet = pylsl.StreamInlet(info, max_buflen=BUFFER, recover=False, as_numpy=True)
        try:
            stream = describe(inlet.info(OPENING_TIMEOUT))
            inlet.open_stream(OPENING_TIMEOUT)
            correction = SteadyCorrection(inlet.time_correction(OPENING_TIMEOUT))
            corrected = time.monotonic()
            self._tell(Connected(stream))
            while not (self._stopped.is_set() or self._dropped.is_set()):
                samples, stamps = inlet.pull_chunk(POLL_TIMEOUT, LARGEST_CHUNK, min_samples=1)
                arrival = pylsl.local_clock()
                if time.monotonic() - corrected > CORRECTION_PERIOD:
                    correction.measure(inlet.time_correction(OPENING_TIMEOUT))
                    corrected = time.monotonic()
                if len(stamps):
                    self._tell(
                        Chunk(np.array(samples), np.array(stamps), correction.value, arrival)
                    )
        finally:
            inlet.close_stream()


def describe(info: Any) -> StreamDescription:
    """Return a stream's description from its ``StreamInfo``.

    Labels and units come from ``desc/channels`` where the sender gave them.
    """
    count = info.channel_count()
    labels, units = [""] * count, [""] * count
    channel = info.desc().child("channels").child("channel")
    for number in range(count):
        if channel.empty():
            break
        labels[number], units[number] = channel.child_value("label"), channel.child_value("unit")
        channel = channel.next_sibling("channel")
    return StreamDescription(
        info.name(),
        info.type(),
        info.source_id(),
        f"{info.uid()}",
        info.nominal_srate(),
        tuple(labels),
        tuple(units),
    )
