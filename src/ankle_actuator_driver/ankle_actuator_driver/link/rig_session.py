"""One session with a rig: a `Bridge`, its line, and the thread that keeps both going at the pace of
the line.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ankle_actuator_driver.link.transport import Transport
from ankle_actuator_driver.safety.bridge import Bridge
from ankle_actuator_driver.safety.states import POWERED, Answer, State

POLL = 0.004
"""[s] The line is looked at, and the watchdogs, at least so often."""
FAREWELL = 1.0
"""[s] For the rig to confirm that it stopped before the driver falls silent."""
SAME_MOMENT = 50e-6
"""[s] Longest time between two readings of clocks that count as one moment."""
CLOCK_READINGS = 5


@dataclass(frozen=True)
class News:
    """What a look at the line gave.

    Attributes
    ----------
    blocks
        Samples: t [s], position [rad], velocity [rad/s], torque [N.m], shape (n, 4) each.
    notes
        Sentences that a person should know.
    changes
        States entered, with their reasons.
    ros
        ROS time [s].
    """

    blocks: list[np.ndarray]
    notes: list[str]
    changes: list[tuple[State, str]]
    ros: float


class RigSession:
    """Talks to the rig from `begin` to `end`.

    Parameters
    ----------
    bridge
        The driver.
    line
        To the rig; closed by `close`.
    ros_time
        Reads ROS time [s].
    tell
        Called in the session's thread after each look at the line.
    fail
        Called with an error that ended the thread.
    """

    def __init__(
        self,
        bridge: Bridge,
        line: Transport,
        ros_time: Callable[[], float],
        tell: Callable[[News], None],
        fail: Callable[[Exception], None],
    ) -> None:
        self.bridge = bridge
        self._line, self._ros_time, self._tell, self._fail = line, ros_time, tell, fail
        self._busy = threading.Lock()
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def begin(self) -> None:
        """Start to talk; the rig stays off."""
        self._ended.clear()
        self._thread = threading.Thread(target=self._run, name="rig", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Bring the rig to rest and off, then fall silent."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        self.operate("stop")
        deadline = time.monotonic() + FAREWELL
        while (
            thread.is_alive()
            and self.bridge.states.state in POWERED
            and time.monotonic() < deadline
        ):
            time.sleep(POLL)
        self._ended.set()
        thread.join(timeout=FAREWELL)

    def close(self) -> None:
        """Give the line back."""
        self._line.close()

    def operate(self, name: str) -> Answer:
        """Carry out an operator's command; see `Bridge.command`."""
        with self._busy:
            answer = self.bridge.command(name, *self._clocks())
            self._send()
        return answer

    def refer(self, motion: np.ndarray) -> None:
        """Pass a block of reference on: t [s], position [rad], velocity [rad/s], acceleration
        [rad/s^2], shape (n, 4).
        """
        with self._busy:
            self.bridge.reference(motion[:, 0], motion[:, 1:], *self._clocks())
            self._send()

    def change(self, apply: Callable[[Bridge], None]) -> None:
        """Change settings of the bridge between two looks at the line."""
        with self._busy:
            apply(self.bridge)

    def _clocks(self) -> tuple[float, float]:
        """The steady clock and ROS time at the same moment [s], though the process may be put aside
        between two readings.
        """
        best = (float("inf"), 0.0, 0.0)
        for _ in range(CLOCK_READINGS):
            before = time.monotonic()
            ros = self._ros_time()
            passed = time.monotonic() - before
            best = min(best, (passed, before, ros))
            if passed < SAME_MOMENT:
                break
        return best[1], best[2]

    def _send(self) -> None:
        for packet in self.bridge.take_outgoing():
            self._line.send(packet)

    def _run(self) -> None:
        try:
            while not self._ended.is_set():
                self._tell(self._look())
        # whatever it is: the thread must not end unheard; the rig's own watchdog stops the plate
        except Exception as error:
            self._fail(error)

    def _look(self) -> News:
        packets = self._line.receive(POLL)
        bridge = self.bridge
        now, ros = self._clocks()
        with self._busy:
            for packet in packets:
                bridge.take(packet, now, ros)
            bridge.advance(now, ros)
            self._send()
            news = News(bridge.samples, bridge.notes, bridge.states.changes, ros)
            bridge.samples, bridge.notes, bridge.states.changes = [], [], []
        return news
