"""One session with a rig: a `Bridge`, its link, and the thread that keeps both going at the pace of
the line.

Another thread reports what the bridge has to say, so that a slow reader of topics does not block
the line.
"""

from __future__ import annotations

import math
import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ankle_actuator_driver.link.rig_link import RigLink
from ankle_actuator_driver.safety.bridge import Bridge
from ankle_actuator_driver.safety.limits import Limits
from ankle_actuator_driver.safety.rig import Interruption
from ankle_actuator_driver.safety.states import CONFIRMATION, POWERED, Answer, State
from ankle_actuator_driver.safety.watchdog import LOST_AFTER
from ankle_node.real_time import time_taken_by_host
from ankle_node.session_event import SessionEvent

POLL_PERIOD = 0.004
"""[s] Longest time between two looks at the line and the watchdogs."""
STOP_CONFIRMATION_TIMEOUT = 1.0
"""[s] Longest wait for the rig to confirm that it stopped before the driver falls silent."""
STOP_PATIENCE = 0.05
"""[s] Longest wait of a stop for a thread that holds the bridge; then the line is cut, and the
rig's own watchdog stops the plate."""
CLOCK_READING_TOLERANCE = 50e-6
"""[s] Longest time between two readings of clocks that count as one moment."""
CLOCK_READINGS = 5
LINE_CUT_REASON = "this driver hung when it was commanded to stop, and has cut the line to the rig"
NEWS_PERIOD = 1.0
"""[s] Longest time between two pieces of news."""
LONG_PAUSE = LOST_AFTER / 2
"""[s] Time without a look at the line that is worth a note: half of what the watchdogs allow."""
HOST_PERIOD = 1.0
"""[s] Time between two looks at what the host of a virtual machine takes."""


@dataclass(frozen=True)
class News:
    """Holds what one poll of the line brought.

    Attributes
    ----------
    blocks
        Samples: t [s], position [rad], velocity [rad/s], torque [N.m], shape (n, 4) each.
    notes
        Sentences for the operator.
    changes
        States entered, with their reasons.
    ros
        ROS time [s].
    """

    blocks: list[np.ndarray]
    notes: list[str]
    changes: list[tuple[State, str]]
    ros: float


def both_clocks(ros_time: Callable[[], float]) -> tuple[float, float]:
    """Return the steady clock and ROS time at the same moment [s].

    The process may be put aside between two readings, so they are repeated where that took long.

    Parameters
    ----------
    ros_time
        Reads ROS time [s].
    """
    best = (float("inf"), 0.0, 0.0)
    for _ in range(CLOCK_READINGS):
        before = time.monotonic()
        ros = ros_time()
        passed = time.monotonic() - before
        best = min(best, (passed, before, ros))
        if passed < CLOCK_READING_TOLERANCE:
            break
    return best[1], best[2]


def state_text(state: State, reason: str) -> str:
    """Return a state with its reason, as ``rig/state`` has it."""
    return f"{state.value}: {reason}" if reason else state.value


def state_event(state: State, reason: str, ros: float) -> SessionEvent:
    """Return the session event of a state that was entered at a ROS time [s]."""
    return SessionEvent(f"rig {state.value}", ros, {"reason": reason})


def host_words(taken: float) -> str:
    """Return what the host of a virtual machine had to do with a pause, in words; empty where it
    took nothing.

    Parameters
    ----------
    taken
        Processor time that it took within `HOST_PERIOD` before [s].
    """
    if taken <= 0.0:
        return ""
    return (
        f"; it is a virtual machine, whose host had just taken {1e3 * taken:.0f} ms of it: no "
        "computer to move a person with"
    )


class RigSession:
    """Talks to the rig from `begin` to `end`.

    Parameters
    ----------
    bridge
        The safety logic of the driver.
    link
        To the rig; closed by `close`.
    clocks
        Reads the steady clock and ROS time at the same moment [s].
    tell
        Called in a thread of its own with what a look at the line gave, and at least once a second.
    fail
        Called with an error that ended a thread.

    Attributes
    ----------
    longest_pause
        Longest time between two looks at the line [s]; a computer that is too busy for the rig
        shows here.
    """

    def __init__(
        self,
        bridge: Bridge,
        link: RigLink,
        clocks: Callable[[], tuple[float, float]],
        tell: Callable[[News], None],
        fail: Callable[[Exception], None],
    ) -> None:
        self.bridge, self.link = bridge, link
        self._clocks, self._tell, self._fail = clocks, tell, fail
        self.longest_pause = 0.0
        self._looked = self._reported = -math.inf  # [s] of the steady clock
        self._host_asked, self._taken = -math.inf, 0.0  # [s] of the steady clock; of its processors
        self._busy = threading.Lock()
        self._line_was_cut = False
        self._ended = threading.Event()
        self._threads: list[threading.Thread] = []
        self._news: queue.SimpleQueue[News | None] = queue.SimpleQueue()

    def begin(self) -> None:
        """Start to talk; the rig stays off."""
        self._ended.clear()
        self._looked = -math.inf
        self._threads = [
            threading.Thread(target=self._guarded, args=(work,), name=name, daemon=True)
            for work, name in ((self._run, "rig"), (self._report, "rig news"))
        ]
        for thread in self._threads:
            thread.start()

    def end(self) -> None:
        """Bring the rig to rest and off, then fall silent."""
        threads, self._threads = self._threads, []
        if not threads:
            return
        self.operate("stop")
        deadline = time.monotonic() + STOP_CONFIRMATION_TIMEOUT
        while (
            threads[0].is_alive()
            and self.bridge.states.state in POWERED
            and time.monotonic() < deadline
        ):
            time.sleep(POLL_PERIOD)
        self._ended.set()
        threads[0].join(timeout=STOP_CONFIRMATION_TIMEOUT)
        self._news.put(None)
        threads[1].join(timeout=STOP_CONFIRMATION_TIMEOUT)

    def close(self) -> None:
        """Close the line."""
        self.link.close()

    def operate(self, name: str) -> Answer:
        """Carry out an operator's command; see `Bridge.command`.

        A stop that finds the driver hanging cuts the line. That is a fault once the driver works
        again, and its reset opens the line.
        """
        if not self._busy.acquire(timeout=STOP_PATIENCE if name == "stop" else CONFIRMATION):
            if name != "stop":
                return Answer(False, f"{name} is refused: the driver hangs; stop it")
            self.link.silence()
            self._line_was_cut = True
            return Answer(
                True,
                "stop: the driver hangs and has cut the line; the rig stops by its own watchdog",
            )
        try:
            answer = self.bridge.command(name, *self._clocks())
            if name == "reset_fault" and answer.done:
                self.link.speak()
            self._send()
        finally:
            self._busy.release()
        return answer

    def confirmed(self, state: State) -> Answer | None:
        """Return the answer to an arming or a start; None while the rig has not confirmed it yet.

        Parameters
        ----------
        state
            The state that the rig has entered.
        """
        states = self.bridge.states
        if states.state is not state:
            return Answer(False, f"the driver is {states.state.value}: {states.reason}")
        return Answer(True, "") if states.confirmed else None

    def refer(self, data: np.ndarray) -> None:
        """Take in a block of the reference.

        Parameters
        ----------
        data
            t [s], position [rad], velocity [rad/s], acceleration [rad/s^2], shape (n, 4).
        """
        with self._busy:
            self.bridge.reference(data[:, 0], data[:, 1:], *self._clocks())
            self._send()

    def change(self, limits: Limits, apply: Callable[[Bridge], None]) -> None:
        """Change the limits and other properties of the bridge between two looks at the line."""
        with self._busy:
            self.bridge.change_limits(limits, *self._clocks())
            apply(self.bridge)
            self._send()

    def tell_operator_alive(self) -> None:
        """Note that the operator's page is connected and watched."""
        with self._busy:
            self.bridge.operator_alive(self._clocks()[0])

    def tell_sources(self, names: list[str], readers: list[str]) -> None:
        """Note which nodes publish and read the reference; see `Bridge.reference_sources`."""
        with self._busy:
            self.bridge.reference_sources(names, self._clocks()[0], readers)
            self._send()

    def figures(self) -> dict[str, object]:
        """Return what ``/diagnostics`` shows of the session, by its words there."""
        bridge = self.bridge
        return {
            "state": bridge.states.state.value,
            "reference samples not followed": bridge.unused,
            "reference blocks not followed": bridge.left_out,
            "samples away from the command": bridge.sensors.spikes,
            "longest pause of the driver [ms]": f"{1e3 * self.longest_pause:.0f}",
            **self.link.figures(),
        }

    def _send(self) -> None:
        for order in self.bridge.take_orders(self._clocks()[0]):
            self.link.send(order)

    def _guarded(self, work: Callable[[], None]) -> None:
        # Whatever it is: a thread must not end unheard; the rig's own watchdog stops the plate.
        try:
            work()
        except Exception as error:
            self.link.silence()
            self._fail(error)

    def _run(self) -> None:
        while not self._ended.is_set():
            self._look()

    def _look(self) -> None:
        arrivals = self.link.receive(POLL_PERIOD)
        bridge = self.bridge
        with self._busy:
            if self._line_was_cut:
                self._line_was_cut = False
                bridge.take(Interruption(LINE_CUT_REASON), self._clocks()[0])
            for arrival in arrivals:
                bridge.take(arrival.event, arrival.now)
            now, ros = self._clocks()
            self._note_pause(now)
            if alarm := self.link.alarm():
                bridge.take(Interruption(alarm), now)
            if bridge.advance(now, ros):
                self.link.ros_time_was_set()
            self._send()
            news = News(bridge.samples, bridge.notes, bridge.states.changes, ros)
            bridge.samples, bridge.notes, bridge.states.changes = [], [], []
        if news.blocks or news.notes or news.changes or now - self._reported > NEWS_PERIOD:
            self._reported = now
            self._news.put(news)

    def _note_pause(self, now: float) -> None:
        """Note how long the line was not looked at."""
        pause, self._looked = now - self._looked, now
        if math.isinf(pause):
            return
        self.longest_pause = max(self.longest_pause, pause)
        if pause > LONG_PAUSE:
            self.bridge.notes.append(
                f"this computer kept the driver from the line for {1e3 * pause:.0f} ms"
                + host_words(time_taken_by_host() - self._taken)
            )
        if now - self._host_asked > HOST_PERIOD:
            self._host_asked, self._taken = now, time_taken_by_host()

    def _report(self) -> None:
        while (news := self._news.get()) is not None:
            self._tell(news)
