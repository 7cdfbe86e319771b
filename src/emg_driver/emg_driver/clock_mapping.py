"""The mapping from the stamps of a stream to ROS time.

The times are evenly spaced, without jumps and without the sender's drift.

A stamp s of the sender's clock becomes ``h = s + correction + (ROS - LSL)``, where Lab Streaming
Layer measures the correction between the two computers and the difference of ROS and LSL clock on
this one is known. What is left are two errors:

1. Drift of the stamps themselves. An amplifier that counts its samples with a crystal of its own
   stamps by a clock that nobody measures. Samples cannot arrive before they are taken, and some
   arrive without waiting: the smallest delay (arrival - h) in each `DELAY_WINDOW` is latency plus
   drift. `DriftFilter` separates them: the latency is constant, the drift begins at zero.
2. Jitter. `SampleLine` follows the corrected stamps with a second-order loop and hands out times on
   a line whose slope and offset change slowly, so that neighbouring samples stay one interval
   apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

DELAY_WINDOW = 4.0
"""[s] Window of which one smallest delay is used: of 256 chunks one has not waited, also on a busy
computer; a crystal at 100e-6 moves by 0.4 ms."""
FIRST_WINDOW = 1.0
"""[s] Window of the smallest delay until the drift is known to `CRYSTAL_DRIFT`, and after a clock
was set: the chunk that the time was taken from may have waited, and is to be found out soon."""
CRYSTAL_DRIFT = 100e-6
"""[1] Largest drift of a crystal."""
LARGEST_DRIFT = 500e-6
"""[1] Standard deviation of the drift that is expected before anything is known: five times
`CRYSTAL_DRIFT`, because a clock that is set while it runs drifts faster than any crystal."""
DRIFT_WANDER = 0.1e-6
"""[1/sqrt(s)] How fast a crystal's drift changes: by 1e-6 in 100 s, while an amplifier warms up."""
DELAY_NOISE = 0.5e-3
"""[s] Standard deviation of the smallest delays on a computer that does other things too."""
LATE_DELAY_RATIO = 3.0
"""Multiple of `DELAY_NOISE` above expectation from which a smallest delay comes from a busy
computer; it is left out."""
PATIENCE = 5
"""Number of windows left out in a row after which the latency itself has changed, and is learned
anew."""
READINGS = 20
"""Number of odd readings of two clocks in a row after which they are believed: 40 s of time
corrections, which Lab Streaming Layer measures every 2 s."""
LARGEST_STEP_OF_CORRECTION = 2e-3
"""[s] Largest step of the correction: two computers' crystals move apart by less than 1 ms in the
seconds between two measurements."""
LOOP = 0.02
"""[Hz] Bandwidth of the loop: 8 s, long against the jitter of USB frames, short against the wander
of crystals.
"""
DAMPING = 0.7
INITIAL_LOOP_SHARE = 0.1
"""Share of the time since the start within which the loop follows at first."""
LARGEST_STEP = 0.3
"""Largest change of the sampling interval by the loop: readers take half an interval as a missing
sample.
"""
JITTER = 1e-3
"""[s] Jitter of the stamps before it is known: one USB frame."""
JUMP_JITTER_RATIO = 8.0
"""Multiple of the jitter from which a chunk is off the line: samples are missing, or the clock was
set."""
DELAY_TOLERANCE = 0.2
"""[s] Largest change of the delay with which a jump means missing samples; stamps and arrival moved
together."""
LARGEST_LATENCY = 1.0
"""[s] Largest age of a stamp: older ones, or from the future, are of another clock than LSL's."""
LARGEST_LEAD = 5e-3
"""[s] Largest time by which a stamp may lie in the future, because LSL's correction has an error.
"""


CLOCK_READINGS = 3
"""Number of readings of a pair of clocks; the one that took the shortest time counts."""
LONGEST_READING_TIME = 0.2e-3
"""[s] Longest reading of two clocks: one that took longer was interrupted by another program."""


class ClockDifference:
    """Measures the difference of two clocks of this computer.

    Readings that another program interrupted are left out.

    Parameters
    ----------
    first, second
        The clocks [s]; the difference is first less second.
    """

    def __init__(self, first: Callable[[], float], second: Callable[[], float]) -> None:
        self._first, self._second = first, second
        self._value = math.nan
        self._kept = 0

    def __call__(self) -> float:
        """Return the present difference [s].

        It is the last one while `READINGS` looks in a row are interrupted.
        """
        looks = []
        for _ in range(CLOCK_READINGS):
            before, now, after = self._second(), self._first(), self._second()
            looks.append((after - before, now - 0.5 * (before + after)))
        width, value = min(looks)
        self._kept = self._kept + 1 if width > LONGEST_READING_TIME else 0
        if self._kept == 0 or self._kept >= READINGS or math.isnan(self._value):
            self._value, self._kept = value, 0
        return self._value


class SteadyCorrection:
    """Keeps LSL's time correction without its outliers.

    A measurement on a busy computer is off by tens of milliseconds.

    Parameters
    ----------
    first
        The first measurement [s].
    """

    def __init__(self, first: float) -> None:
        self.value = first
        self._odd: list[float] = []

    def measure(self, correction: float) -> None:
        """Process a reading [s].

        One far from the last counts only after `READINGS` of them have agreed with each other: a
        clock that was set stays where it is, what a busy computer measures is scattered. Lab
        Streaming Layer gives the same measurement several times; it counts once.
        """
        if abs(correction - self.value) <= LARGEST_STEP_OF_CORRECTION:
            self.value, self._odd = correction, []
        elif not self._odd or abs(correction - self._odd[-1]) > LARGEST_STEP_OF_CORRECTION:
            self._odd = [correction]
        elif correction != self._odd[-1]:
            self._odd.append(correction)
        if len(self._odd) >= READINGS:
            self.value, self._odd = correction, []


class DriftFilter:
    """Estimates latency, shift and drift of a sender's clock from smallest delays by a Kalman
    filter.

    The state is the latency L, the shift x of the stamps against ROS time since the start, and the
    drift d with ``x' = d``. Measured is L + x.
    """

    def __init__(self) -> None:
        self._state: np.ndarray = np.zeros(3)
        self._covariance = np.diag([LARGEST_LATENCY**2, 0.0, LARGEST_DRIFT**2])
        self._late = 0

    @property
    def shift(self) -> float:
        """Return the time [s] by which the stamps lag behind ROS time by now."""
        return float(self._state[1])

    @property
    def drift(self) -> float:
        """Return the seconds that the sender's clock loses per second [1]."""
        return float(self._state[2])

    @property
    def drift_error(self) -> float:
        """Return the standard error of the drift [1]."""
        return math.sqrt(self._covariance[2, 2])

    @property
    def delay(self) -> float:
        """Return the smallest delay that is expected now [s]."""
        return float(self._state[0] + self._state[1])

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        step = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, seconds], [0.0, 0.0, 1.0]])
        self._state = step @ self._state
        self._covariance = step @ self._covariance @ step.T
        self._covariance[2, 2] += DRIFT_WANDER**2 * seconds

    def measure(self, delay: float) -> None:
        """Process the smallest delay [s] of a window."""
        look = np.array([1.0, 1.0, 0.0])
        expected = float(look @ self._covariance @ look)
        surprise = delay - self.delay
        likely = LATE_DELAY_RATIO * math.sqrt(expected + DELAY_NOISE**2)
        if surprise > likely:
            self._late += 1
            if self._late < PATIENCE:
                return
        if abs(surprise) > likely:
            # Sooner than possible: what the latency was learned from had waited, all of it. Later
            # for long: it has changed.
            self._covariance[0, :] = self._covariance[:, 0] = 0.0
            self._covariance[0, 0] = LARGEST_LATENCY**2
            expected = float(look @ self._covariance @ look)
        self._late = 0
        gain = self._covariance @ look / (expected + DELAY_NOISE**2)
        self._state = self._state + gain * surprise
        self._covariance = self._covariance - np.outer(gain, look @ self._covariance)


@dataclass(frozen=True)
class Jump:
    """Names the meaning of a chunk far off the line.

    Attributes
    ----------
    kind
        ``gap`` or ``clock``.
    message
        One sentence with numbers.
    missing
        Samples that a gap leaves out, else 0.
    """

    kind: str
    message: str
    missing: int = 0


class SampleLine:
    """Gives ROS times to the samples of one connection to a stream, by a line through their stamps.

    Parameters
    ----------
    rate
        Nominal sampling rate [Hz].
    ros_minus_lsl
        Present difference of the ROS clock and this computer's LSL clock [s], as of
        `ClockDifference`.
    """

    def __init__(self, rate: float, ros_minus_lsl: Callable[[], float]) -> None:
        self.rate = rate
        self.drift_filter = DriftFilter()
        self._ros_minus_lsl = ros_minus_lsl
        self._foreign = (
            0.0  # what a clock that is not LSL's is off [s]; samples are then dated by arrival
        )
        self._stamped = math.nan  # last stamp [s], as ROS time
        self._own = math.nan  # the same by the sender's clock [s]
        self._end = math.nan  # of the line: time of the newest sample [s]
        self._slope = 0.0  # relative deviation of the sampling interval
        self._jitter = JITTER
        self._elapsed = 0.0
        self._window_start = 0.0
        self._smallest = math.inf

    def start(self, delays: Sequence[float]) -> list[Jump]:
        """Look at the first chunks before any is placed.

        Parameters
        ----------
        delays
            Arrival less corrected stamp of the last sample of each [s]. Where LSL's clock cannot
            have given such stamps, samples are dated by arrival, taking the smallest delay as none.
        """
        self._smallest = min(delays)
        if -LARGEST_LEAD <= self._smallest <= LARGEST_LATENCY:
            return []
        self._foreign, self._smallest = self._smallest, 0.0
        side = "behind" if self._foreign > 0 else "ahead of"
        return [
            Jump(
                "clock",
                f"the stamps are {abs(self._foreign):.3f} s {side} LSL's clock; the samples are "
                "dated by their arrival",
            )
        ]

    def place(
        self, stamps: np.ndarray, correction: float, arrival: float
    ) -> tuple[np.ndarray, list[Jump]]:
        """Return the times [s] of the samples of a chunk, shape (n,).

        They increase strictly over all chunks.

        Parameters
        ----------
        stamps
            By the sender's clock [s], shape (n,), n >= 1.
        correction
            LSL's time correction [s].
        arrival
            When the chunk came, by this computer's LSL clock [s].
        """
        offset, n = self._ros_minus_lsl(), len(stamps)
        came, seconds = arrival + offset, n / self.rate
        # Of the last sample, by all stamps of the chunk.
        own = float(np.mean(stamps)) + 0.5 * (n - 1) / self.rate
        stamped = own + correction + offset + self._foreign
        if math.isnan(self._end):
            self._own = own - seconds
            self._stamped = self._end = stamped - seconds
            self._window_start = came
        expected = self._end + (1.0 + self._slope) * seconds
        jumps: list[Jump] = []
        step, own_step = stamped - self._stamped - seconds, own - self._own - seconds
        self._own = own
        largest = max(JUMP_JITTER_RATIO * self._jitter, 0.75 / self.rate)
        if abs(own_step) <= largest and abs(step) <= largest + LARGEST_STEP_OF_CORRECTION:
            # The difference of the clocks was measured anew; the loop follows it.
            step = own_step
        elif abs(step) > largest:
            jump, stamped = self._explain(step, stamped, came)
            jumps.append(jump)
            expected += max(stamped - self._stamped - seconds, 0.0)
            step = 0.0
            if jump.kind == "clock":
                self._elapsed = 0.0
        self._jitter = max(
            math.sqrt(
                self._jitter**2 + min(LOOP * seconds * 6.0, 1.0) * (step**2 - self._jitter**2)
            ),
            0.1 / self.rate,
        )
        self._stamped = stamped
        self._note_delay(came - stamped, came)
        end = expected + self._follow(self._stamped + self.drift_filter.shift - expected, seconds)
        begin = self._end if not jumps else end - seconds
        self._end = end
        return begin + (end - begin) * np.arange(1, n + 1) / n, jumps

    def _explain(self, step: float, stamped: float, came: float) -> tuple[Jump, float]:
        """Return whether stamps that step by `step` [s] mean missing samples or another clock, and
        the stamp as it counts now [s].
        """
        delay = came - stamped
        unexpected = delay - self.drift_filter.delay
        # Stamps that LSL's clock can still have given are believed, however late a busy computer
        # reads them.
        believed = not self._foreign and -LARGEST_LEAD <= delay <= LARGEST_LATENCY
        if step > 0 and (believed or abs(unexpected) < DELAY_TOLERANCE):
            missing = max(round(step * self.rate), 1)
            return Jump(
                "gap",
                f"{missing} samples ({missing / self.rate:.3f} s) are missing in the stream",
                missing,
            ), stamped
        self._foreign += unexpected
        return Jump(
            "clock",
            f"the stream's clock jumped by {step:.3f} s; the samples are dated by their arrival",
        ), stamped + unexpected

    def _note_delay(self, delay: float, came: float) -> None:
        passed, drift = came - self._window_start, self.drift_filter.drift
        # As it would be at the beginning of the window: the delay of a clock that loses time grows.
        self._smallest = min(self._smallest, delay - drift * passed)
        soon = self._foreign or self.drift_filter.drift_error > CRYSTAL_DRIFT
        if passed < (FIRST_WINDOW if soon else DELAY_WINDOW):
            return
        self._smallest += drift * passed
        self.drift_filter.advance(passed)
        sooner = self.drift_filter.delay - self._smallest
        if self._foreign and sooner > DELAY_NOISE:
            # The chunk that set the time had waited: it was dated too late.
            self._foreign -= sooner
            self._stamped -= sooner
            self._elapsed = 0.0
        else:
            self.drift_filter.measure(self._smallest)
        self._smallest, self._window_start = math.inf, came

    def _follow(self, error: float, seconds: float) -> float:
        """Take one step of the loop after a chunk of so many seconds; return the correction of
        the line's end [s].
        """
        self._elapsed += seconds
        omega = 2.0 * math.pi * LOOP
        # The first chunks, also of a new clock, count more: the line starts at their mean and not
        # at the first one's jitter.
        quick = max(omega, 2.0 * math.pi * INITIAL_LOOP_SHARE / self._elapsed)
        self._slope += omega**2 * seconds * error
        return float(
            np.clip(
                2.0 * DAMPING * quick * seconds * error,
                -LARGEST_STEP * seconds,
                LARGEST_STEP * seconds,
            )
        )
