"""A stream's chunks become blocks of `/emg/samples`.

Muscles are in volts, times are ROS times, and bad channels are NaN.

Whatever is wrong becomes a sentence, and never plausible data: a stream that is not what it
declares is refused, a channel that is flat, saturated, full of hum or too large is NaN from the
moment it is known until it is good again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from emg_driver.clock_mapping import SampleLine
from emg_driver.electrode_quality import SHORTEST_STRETCH, WINDOW, defects
from emg_driver.errors import StreamRefused
from emg_driver.lsl_source import Chunk
from emg_driver.muscles import MUSCLES
from emg_driver.rate_check import RateCheck, Window
from emg_driver.settings import ElectrodeSettings
from emg_driver.stream_description import ChannelMap, StreamDescription, map_channels

BLOCK_RATE = 64.0
"""[Hz] Blocks per second, as every sampled topic."""
JUDGE_PERIOD = 0.25
"""[s] Time between two checks of the electrodes."""
START_WINDOW = Window(length=2.0, tolerance=0.05)
"""Window over which the rate is judged before anything is published."""
RATE_PATIENCE = 10.0
"""[s] Time after which a stream that has not come at its declared rate over `START_WINDOW` is
refused; until then a busy computer may be the reason.
"""
RUNNING_WINDOW = Window(length=30.0, tolerance=0.003)
"""Window over which the rate is judged once samples are published."""
RATE_ERROR_TIME = 10.0
"""[s] Time for which a wrong rate has to last: a third of `RUNNING_WINDOW`, after which the newest
delays that it compares are all new. A computer that is busy for a few seconds refuses no
amplifier."""


@dataclass
class Bridged:
    """Holds the blocks that one chunk gave.

    Attributes
    ----------
    blocks
        Each of shape (n, 5): t [s] and EMG [V] of SOL, TA, GL, GM.
    notes
        What is wrong, one sentence each.
    """

    blocks: list[np.ndarray] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


class EmgBridge:
    """Turns one connection to a stream into blocks.

    Parameters
    ----------
    stream
        What it says about itself.
    channels, unit, rate
        See `map_channels`.
    limits
        For a good electrode.
    ros_minus_lsl
        Present difference of the two clocks [s].
    after
        Time of the last sample that was published before [s]; nothing is dated at or before it.

    Raises
    ------
    StreamRefused
        The stream's description does not fit.

    Attributes
    ----------
    samples
        Published so far.
    missing
        Samples missing in gaps of the stream.
    last
        Time of the last sample published [s].
    """

    def __init__(
        self,
        stream: StreamDescription,
        channels: str,
        unit: str,
        rate: float,
        limits: ElectrodeSettings,
        ros_minus_lsl: Callable[[], float],
        after: float = float("-inf"),
    ) -> None:
        self.stream = stream
        self.samples = self.missing = 0
        self.last = after
        self._map: ChannelMap = map_channels(stream, channels, unit, rate)
        self._limits = limits
        self._line = SampleLine(stream.rate, ros_minus_lsl)
        self._block = max(round(stream.rate / BLOCK_RATE), 1)
        self._waiting: deque[Chunk] | None = deque()
        self._rate = RateCheck(stream.rate, START_WINDOW)
        self._received = 0
        self._odd_since: float | None = None
        self._pending: np.ndarray = np.empty((0, 1 + len(MUSCLES)))
        self._recent: np.ndarray = np.empty((0, len(MUSCLES)))
        self._unjudged = 0
        self._bad: np.ndarray = np.zeros(len(MUSCLES), dtype=bool)

    @property
    def drift(self) -> float:
        """Return the drift of the sender's stamps [1], positive when they lose time."""
        return self._line.drift_filter.drift

    @property
    def bad(self) -> dict[str, bool]:
        """Return the bad electrodes, by muscle."""
        return dict(zip(MUSCLES, self._bad.tolist(), strict=True))

    def feed(self, chunk: Chunk) -> Bridged:
        """Process a chunk.

        Raises
        ------
        StreamRefused
            The samples do not come at the declared rate.
        """
        out = Bridged()
        if self._waiting is not None:
            self._waiting.append(chunk)
        agrees = self._check_rate(chunk)
        if self._waiting is not None:
            if not agrees:
                return out
            chunks, self._waiting = self._waiting, None
            delays = [one.arrival - float(one.stamps[-1]) - one.correction for one in chunks]
            out.notes += [
                f"{self.stream.title}: {jump.message}" for jump in self._line.start(delays)
            ]
            for one in chunks:
                self._bridge(one, out)
        else:
            self._bridge(chunk, out)
        whole = len(self._pending) // self._block * self._block
        if whole:
            out.blocks += np.split(self._pending[:whole], whole // self._block)
            self._pending = self._pending[whole:]
            self.last = float(out.blocks[-1][-1, 0])
            self.samples += whole
        return out

    def _check_rate(self, chunk: Chunk) -> bool:
        """Return whether samples come as often as declared; False while it is open."""
        self._received += len(chunk.stamps)
        self._rate.add(chunk.arrival, self._received + self.missing)
        starting, agrees = self._waiting is not None, self._rate.agrees
        if agrees is None:
            return not starting
        if agrees:
            self._odd_since = None
            if starting:
                self._rate = RateCheck(self.stream.rate, RUNNING_WINDOW)
            return True
        if starting and self._waiting and chunk.arrival - self._waiting[0].arrival < RATE_PATIENCE:
            return False
        self._odd_since = chunk.arrival if self._odd_since is None else self._odd_since
        if not starting and chunk.arrival - self._odd_since < RATE_ERROR_TIME:
            return True
        raise StreamRefused(
            f"{self.stream.title} declares {self.stream.rate:g} Hz and sends "
            f"{self._rate.measured:.1f} Hz"
        )

    def _bridge(self, chunk: Chunk, out: Bridged) -> None:
        emg = self._map.volts(chunk.samples)
        times, jumps = self._line.place(chunk.stamps, chunk.correction, chunk.arrival)
        for jump in jumps:
            self.missing += jump.missing
            out.notes.append(f"{self.stream.title}: {jump.message}")
        if jumps:
            # A gap stays between two blocks and inside none; what was judged before it tells
            # nothing about what follows.
            if len(self._pending):
                out.blocks.append(self._pending)
                self.samples += len(self._pending)
                self.last = float(self._pending[-1, 0])
            self._pending = self._pending[:0]
            self._recent = self._recent[:0]
        self._judge(emg, out)
        emg = np.where(self._bad | ~np.isfinite(emg), np.nan, emg)
        keep = times > self.last
        if not keep.all():
            out.notes.append(
                f"{self.stream.title}: {int(np.count_nonzero(~keep))} samples are dated before "
                "those of the last connection and left out"
            )
        self._pending = np.concatenate([self._pending, np.column_stack([times, emg])[keep]])

    def _judge(self, emg: np.ndarray, out: Bridged) -> None:
        window = round(WINDOW * self.stream.rate)
        self._recent = np.concatenate([self._recent, emg])[-window:]
        self._unjudged += len(emg)
        if (
            self._unjudged < JUDGE_PERIOD * self.stream.rate
            or len(self._recent) < SHORTEST_STRETCH * self.stream.rate
        ):
            return
        self._unjudged = 0
        found = defects(self._recent, self.stream.rate, self._limits)
        out.notes += [
            f"{muscle}: {defect.message}"
            for muscle, defect in zip(MUSCLES, found, strict=True)
            if defect is not None
        ]
        self._bad = np.array([defect is not None for defect in found])
