"""EMG and onsets in, background and reflex activity for every onset out: the one path of the node,
the replay and the file.

The result depends on the samples alone, not on how they are split or on which topic comes first: an
onset waits for its EMG, EMG is kept until onsets can no longer come.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from ankle_interfaces.continuity import STEP_TOLERANCE, sampling_rate
from ankle_interfaces.errors import SamplingError
from emg_driver.electrode_quality import SHORTEST_STRETCH, WINDOW, defects
from emg_driver.emg_memory import EmgMemory
from emg_driver.muscles import MUSCLES, STRETCHED_BY
from emg_driver.rectification import Rectifier
from emg_driver.reflex_response import respond
from emg_driver.settings import Settings
from emg_driver.stretch_onsets import REFERENCE_REST, OnsetDetector

LARGEST_REFERENCE_DELAY = 2.0
"""[s] Largest delay of the reference behind the EMG: a replay at full speed sends up to 32 blocks,
half a second, of one topic before the other."""
LOWEST_RATE = 1000.0
"""[Hz] Lowest sampling rate: below, half the sampling rate cuts into the band of EMG (up to 450
Hz)."""
MAX_LAG = 0.05
"""[s] Longest time from a command to the plate's movement. Servos lag by 4 to 10 ms; the paper's
pulses turn round after 40 ms and more, in the other direction."""
MAX_LEAD = 0.002
"""[s] Largest time by which a movement may seem to begin before its command: noise of the measured
velocity crosses the limit of rest a few samples before."""
LONGEST_UNSEEN = 0.005
"""[s] Longest step between two samples of the motion between which a plate is said to stand still:
the paper's fastest edges take longer."""
SHOWN_LAGS = 200
"""Number of onsets whose median lag is reported: those of the last minute or two."""
MEMORY = WINDOW + 2.0 * LARGEST_REFERENCE_DELAY + 1.0
"""[s] Length of the EMG that is kept."""
RATE_SAMPLES = 256
"""Number of samples whose median interval gives the sampling rate."""


@dataclass
class Responses:
    """Holds the responses that became due.

    Attributes
    ----------
    rows
        Shape (k, 10), columns `muscles.RESPONSE_COLUMNS`.
    notes
        Bad electrodes and missing samples, one sentence each behind the muscle or ``EMG``.
    """

    rows: np.ndarray = field(default_factory=lambda: np.empty((0, 2 + 2 * len(MUSCLES))))
    notes: list[str] = field(default_factory=list)


def warm_up() -> None:
    """Run every part of the processing once.

    Loading compiled code takes a second, in which queues of blocks overflow.
    """
    time = np.arange(round(2.0 * WINDOW * LOWEST_RATE)) / LOWEST_RATE
    position = np.clip(time - WINDOW, 0.0, 0.1)
    processor = EmgProcessor()
    processor.feed_motion(time, np.gradient(position, time))
    processor.feed_reference(time, position)
    processor.feed_emg(time, np.random.default_rng(0).standard_normal((len(time), len(MUSCLES))))
    processor.ensemble()


class EmgProcessor:
    """Computes responses from streams of EMG, reference and motion.

    Attributes
    ----------
    rate
        Of the EMG [Hz]; None before 256 samples.
    onsets
        Onsets used so far.
    unconfirmed
        Commanded onsets without a measured movement; their windows start at the command, plus the
        median lag of the others.
    motionless
        Commanded onsets at which the measured plate stood still, as that of a rig that is stopped;
        they have no response.
    """

    def __init__(self, settings: Settings | None = None) -> None:
        self.settings = settings or Settings()
        self.rate: float | None = None
        self.onsets = 0
        self.unconfirmed = 0
        self.motionless = 0
        # Times [s] of the measured motion, and whether the plate moved then.
        self._moving: deque[tuple[np.ndarray, np.ndarray]] = deque()
        self._lags: deque[float] = deque(maxlen=SHOWN_LAGS)
        least = self.settings.onset_velocity
        self._reference = OnsetDetector(REFERENCE_REST, least)
        self._motion = OnsetDetector(self.settings.rest_velocity, least)
        self._from_reference: deque[tuple[float, float]] = deque()
        self._from_motion: deque[tuple[float, float]] = deque()
        self._waiting: list[np.ndarray] = []
        self._rectifier: Rectifier | None = None
        self._memory = EmgMemory(0, len(MUSCLES))
        self._averages: dict[int, deque[np.ndarray]] = {
            direction: deque(maxlen=self.settings.ensemble_size)
            for direction in set(STRETCHED_BY.values())
        }
        self._to_average: deque[tuple[float, int, np.ndarray]] = deque()

    @property
    def lag(self) -> float:
        """Return the median time from a command to the plate's movement [s].

        It is that of the last `SHOWN_LAGS` onsets; NaN before any was measured.
        """
        return float(np.median(self._lags)) if self._lags else math.nan

    def feed_reference(self, time: np.ndarray, position: np.ndarray) -> Responses:
        """Process the commanded reference: time [s] and position [rad], each of shape (n,)."""
        if self.settings.onset_source != "velocity":
            self._from_reference.extend(
                (float(t), float(d)) for t, d in self._reference.from_position(time, position)
            )
        return self._due()

    def feed_motion(self, time: np.ndarray, velocity: np.ndarray) -> Responses:
        """Process the measured motion: time [s] and velocity [rad/s], each of shape (n,)."""
        if self.settings.onset_source != "reference":
            self._from_motion.extend(
                (float(t), float(d)) for t, d in self._motion.from_velocity(time, velocity)
            )
            self._keep_motion(time, velocity)
        return self._due()

    def feed_emg(self, time: np.ndarray, emg: np.ndarray) -> Responses:
        """Process EMG.

        Parameters
        ----------
        time
            Times of the samples [s], shape (n,).
        emg
            [V], shape (n, 4), muscles in the order of `MUSCLES`; NaN where a channel is bad.

        Raises
        ------
        SamplingError
            A sampling rate below `LOWEST_RATE`, or times that give none.
        """
        notes: list[str] = []
        samples = np.column_stack([time, emg])
        samples = samples[np.isfinite(samples[:, 0])]
        if self.rate is None:
            self._waiting.append(samples)
            samples = np.concatenate(self._waiting)
            if len(samples) < RATE_SAMPLES:
                return Responses()
            self._waiting = []
            self._start(sampling_rate(samples[:RATE_SAMPLES, 0]))
        self._keep(samples, notes)
        due = self._due()
        return Responses(due.rows, notes + due.notes)

    def finish(self) -> Responses:
        """Return what is still waiting, when no further sample will come."""
        return self._due(final=True)

    def ensemble(self) -> np.ndarray:
        """Return mean rectified EMG about the last onsets that stretch each muscle, shape (L, 5).

        The columns are `muscles.ENSEMBLE_COLUMNS`.

        NaN for a muscle without onsets so far. L is 0 before the EMG's rate is known.
        """
        if self.rate is None:
            return np.empty((0, 1 + len(MUSCLES)))
        lags = self._ensemble_lags()
        out = np.column_stack([lags, np.full((len(lags), len(MUSCLES)), np.nan)])
        for index, muscle in enumerate(MUSCLES):
            waves = [
                wave[:, index]
                for wave in self._averages[STRETCHED_BY[muscle]]
                if np.isfinite(wave[:, index]).all()
            ]
            if waves:
                out[:, 1 + index] = np.mean(waves, axis=0)
        return out

    def _start(self, rate: float) -> None:
        if rate < LOWEST_RATE:
            raise SamplingError(
                f"EMG comes at {rate:g} Hz; at least {LOWEST_RATE:g} Hz are needed for a signal "
                "of up to 450 Hz"
            )
        self._rectifier = Rectifier(
            rate, len(MUSCLES), self.settings.highpass_cutoff, self.settings.highpass_order
        )
        self.rate = rate
        self._memory = EmgMemory(math.ceil(MEMORY * rate), len(MUSCLES))

    def _keep(self, samples: np.ndarray, notes: list[str]) -> None:
        """Rectify and append; time that jumps restarts the filter, time that runs back or another
        rate forgets what was kept.
        """
        assert self.rate is not None
        assert self._rectifier is not None
        if not len(samples):
            return
        time = samples[:, 0]
        last = self._memory.time[-1] if len(self._memory) else time[0] - 1.0 / self.rate
        steps = np.diff(time, prepend=last) * self.rate
        breaks = np.flatnonzero(np.abs(steps - 1.0) > STEP_TOLERANCE)
        if len(time) > 2 and len(breaks) > len(time) // 2:
            notes.append(
                f"EMG: it no longer comes at {self.rate:g} Hz, the processing starts anew at t = "
                f"{time[0]:.3f} s"
            )
            self.rate = None
            self._forget()
            self._waiting = [samples]
            return
        for start, stop in zip([0, *breaks], [*breaks, len(time)], strict=True):
            if stop <= start:
                continue
            if start in breaks:
                self._rectifier.restart()
                if steps[start] <= 0:
                    notes.append(
                        f"EMG: time runs back at t = {time[start]:.3f} s, what came before is "
                        "forgotten"
                    )
                    self._forget()
            emg = samples[start:stop, 1:]
            self._memory.append(time[start:stop], emg, self._rectifier.run(emg))

    def _forget(self) -> None:
        self._memory.clear()
        self._to_average.clear()

    def _due(self, final: bool = False) -> Responses:
        """Return responses to all onsets whose EMG is there."""
        out = Responses()
        if self.rate is None or not len(self._memory):
            return out
        known = math.inf if final else float(self._memory.time[-1])
        rows = []
        while (onset := self._next_onset(known)) is not None:
            rows.append(self._respond(*onset, out.notes))
        self._average(known)
        if rows:
            out.rows = np.array(rows)
        return out

    def _next_onset(self, known: float) -> tuple[float, float] | None:
        """Return the next onset whose windows end before `known`, commanded ones before those that
        only the measured velocity shows.
        """
        end = self.settings.reflex_end + 1.0 / (self.rate or LOWEST_RATE)
        while self._from_reference and self._stood_still(self._from_reference[0][0]):
            self._from_reference.popleft()
            self.motionless += 1
        onset = self._commanded_onset(known)
        if onset is not None:
            if onset[0] + end > known:
                return None
            commanded, direction = self._from_reference.popleft()
            if (onset[0], direction) in self._from_motion:
                self._lags.append(onset[0] - commanded)
            else:
                self.unconfirmed += 1
            return onset
        # Without a reference for that time after `LARGEST_REFERENCE_DELAY` there will be none.
        wait = end if self.settings.onset_source == "velocity" else LARGEST_REFERENCE_DELAY
        while self._from_motion and self._from_motion[0][0] + wait <= known:
            onset = self._from_motion.popleft()
            if not self._reference.first <= onset[0] <= self._reference.last:
                return onset
        return None

    def _commanded_onset(self, known: float) -> tuple[float, float] | None:
        """Return the first commanded onset, at the time when the plate moved; None while that is
        not known.
        """
        if not self._from_reference:
            return None
        commanded, direction = self._from_reference[0]
        if self.settings.onset_source == "reference":
            return commanded, direction
        moved = next(
            (
                time
                for time, way in self._from_motion
                if way == direction and -MAX_LEAD <= time - commanded <= MAX_LAG
            ),
            None,
        )
        if moved is not None:
            return moved, direction
        measured_past = self._motion.last >= commanded + MAX_LAG
        if not measured_past and commanded + LARGEST_REFERENCE_DELAY > known:
            return None
        lag = self.lag
        return commanded + (0.0 if math.isnan(lag) else lag), direction

    def _keep_motion(self, time: np.ndarray, velocity: np.ndarray) -> None:
        """Keep when the plate moved, as long as a reference may still come."""
        if not len(time):
            return
        # A velocity that is not finite does not show that the plate stands still.
        self._moving.append((time, ~(np.abs(velocity) <= self.settings.rest_velocity)))
        while self._moving[0][0][-1] < time[-1] - MEMORY:
            self._moving.popleft()

    def _stood_still(self, commanded: float) -> bool:
        """Say whether the measured plate stood still when it should have begun to move; not as long
        as that is not measured.
        """
        start, end = commanded - MAX_LEAD, commanded + MAX_LAG
        kept = [one for one in self._moving if one[0][-1] >= start and one[0][0] <= end]
        if not kept:
            return False
        time, moving = (np.concatenate(parts) for parts in zip(*kept, strict=True))
        about = (time >= start) & (time <= end)
        steps = np.diff(np.concatenate([[start], time[about], [end]]))
        return bool(steps.max() <= LONGEST_UNSEEN) and not moving[about].any()

    def _respond(self, onset: float, direction: float, notes: list[str]) -> np.ndarray:
        assert self.rate is not None
        self.onsets += 1
        background, reflex = respond(
            self._memory.time, self._memory.rectified, self.rate, onset, self.settings
        )
        end = onset + self.settings.reflex_end
        bad = self._bad_channels(end, notes)
        background, reflex = np.where(bad, np.nan, background), np.where(bad, np.nan, reflex)
        self._to_average.append((onset, int(direction), bad))
        return np.concatenate([[onset, direction], background, reflex])

    def _bad_channels(self, end: float, notes: list[str]) -> np.ndarray:
        """Return which channels are bad in the last second before `end`, shape (4,)."""
        assert self.rate is not None
        stop = int(np.searchsorted(self._memory.time, end))
        start = int(np.searchsorted(self._memory.time, end - WINDOW))
        steps = np.diff(self._memory.time[start:stop])
        jumps = np.flatnonzero(np.abs(steps * self.rate - 1.0) > STEP_TOLERANCE)
        start += int(jumps[-1]) + 1 if len(jumps) else 0
        if stop - start < SHORTEST_STRETCH * self.rate:
            notes.append(
                f"EMG: less than {SHORTEST_STRETCH:g} s without a gap before t = {end:.3f} s, "
                "no response"
            )
            return np.full(len(MUSCLES), True)
        found = defects(self._memory.raw[start:stop], self.rate, self.settings.electrodes)
        notes += [
            f"{muscle}: {defect.message}"
            for muscle, defect in zip(MUSCLES, found, strict=True)
            if defect is not None
        ]
        return np.array([defect is not None for defect in found])

    def _ensemble_lags(self) -> np.ndarray:
        assert self.rate is not None
        s = self.settings
        return (
            np.arange(-round(s.ensemble_before * self.rate), round(s.ensemble_after * self.rate))
            / self.rate
        )

    def _average(self, known: float) -> None:
        assert self.rate is not None
        while (
            self._to_average
            and self._to_average[0][0] + self.settings.ensemble_after + 1.0 / self.rate <= known
        ):
            onset, direction, bad = self._to_average.popleft()
            first = int(np.searchsorted(self._memory.time, onset - self.settings.ensemble_before))
            wave = self._memory.rectified[first : first + len(self._ensemble_lags())]
            if len(wave) == len(self._ensemble_lags()):
                self._averages[direction].append(np.where(bad, np.nan, wave))
