"""The account of the samples of one topic: gaps, late and repeated samples, mixed sources.

Samples are counted by their own time: a step of more than one and a half sampling intervals is a
gap, a sample whose time lies in a gap came late and fills it, a sample whose time is there already
is repeated.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from ankle_interfaces.block import Block
from ankle_interfaces.continuity import STEP_TOLERANCE, sampling_rate

MAX_LATENESS = 5.0
"""[s] Longest delay of a block: blocks of one publisher come in their order, and one that a busy
network or computer holds up comes at most a few seconds late. Time that runs back further is a
clock that was set, or a source that started again."""
MAX_CLOCK = 1e11
"""[s] Latest possible time: times beyond are damaged: ROS counts from 1970, and this is the year
5138."""
MAX_PAUSE = 86_400.0
"""[s] Longest pause. Time that goes forward further within one recording is a clock that was set,
or damage; no recording pauses for a day."""
SHOWN_GAPS = 5
"""Gaps that a sentence names one by one; the longest ones."""
MIXED_SHARE = 0.05
"""Share of steps back in time per block from which two sources in one topic are likely. A busy
network reorders fewer than one block in a hundred."""
MIN_MIXED_STEPS = 10
"""Least number of steps back in time that distinguish two sources from a few late blocks."""
WHOLE_TOLERANCE = 0.2
"""Part of an interval by which a step may differ from a whole number of intervals."""
MAX_IRREGULAR_SHARE = 0.01
"""Share of steps that are no whole number of intervals, above which the sampling is irregular: a
short pause is then its nature and no loss."""
MIN_IRREGULAR_GAP = 4
"""Intervals that must be missing at once in irregular sampling before they count as loss."""


@dataclass
class Gap:
    """Describes a gap: samples that are missing between two others.

    Attributes
    ----------
    start, end
        Times of the samples around it [s].
    missing
        Samples that are still missing in it.
    """

    start: float
    end: float
    missing: int


@dataclass
class SampleAccount:
    """Counts the samples of one topic.

    Attributes
    ----------
    rate
        Sampling rate [Hz], from the first block; None before.
    samples
        Samples with a time of their own, late ones included.
    gaps
        Where samples are missing, in the order in which they were found.
    late
        Samples that came after later ones and fill a gap.
    repeated
        Samples whose time is there already.
    uneven
        Steps that are no whole number of intervals.
    clock_steps
        (time before [s], how far time was set back [s]) of each step back by more than
        `MAX_LATENESS`; negative for one forward by more than `MAX_PAUSE`.
    undated
        Samples whose time is not finite or beyond `MAX_CLOCK`.
    not_finite
        NaN or infinite values by column.
    blocks
        Blocks seen.
    first, last
        Times of the first and the latest sample [s]; None before any.
    """

    rate: float | None = None
    samples: int = 0
    gaps: list[Gap] = field(default_factory=list)
    late: int = 0
    repeated: int = 0
    uneven: int = 0
    clock_steps: list[tuple[float, float]] = field(default_factory=list)
    undated: int = 0
    not_finite: dict[str, int] = field(default_factory=dict)
    blocks: int = 0
    first: float | None = None
    last: float | None = None
    _steps_back: int = 0

    @property
    def irregular(self) -> bool:
        """Tell whether the sampling is irregular, so that no single missing sample can be
        recognised.
        """
        return self.uneven > MAX_IRREGULAR_SHARE * self.samples

    @property
    def lasting_gaps(self) -> list[Gap]:
        """Return the gaps that count as loss."""
        least = MIN_IRREGULAR_GAP if self.irregular else 1
        return [gap for gap in self.gaps if gap.missing >= least]

    @property
    def missing(self) -> int:
        """Return the number of samples that are missing in all gaps."""
        return sum(gap.missing for gap in self.lasting_gaps)

    @property
    def missing_time(self) -> float:
        """Return the length of what is missing [s]."""
        return self.missing / self.rate if self.rate else 0.0

    @property
    def mixed(self) -> bool:
        """Tell whether time runs back so often that two sources are likely to publish the topic."""
        return self._steps_back >= max(MIN_MIXED_STEPS, MIXED_SHARE * self.blocks)

    def add(self, block: Block) -> list[str]:
        """Count a block.

        Parameters
        ----------
        block
            Its first column is the time [s].

        Returns
        -------
        list[str]
            A sentence for each thing that is wrong with this block; mostly empty.
        """
        self.blocks += 1
        news = self._count_values(block)
        time = block.time
        dated = np.isfinite(time) & (np.abs(time) < MAX_CLOCK)
        if not dated.all():
            self.undated += int(np.count_nonzero(~dated))
            news.append(f"{np.count_nonzero(~dated)} samples have no possible time")
            time = time[dated]
        if self.rate is None:
            try:
                self.rate = sampling_rate(time)
            except ValueError as error:
                return [*news, str(error)]
        if not len(time):
            return news
        if self.first is None or self.last is None:
            self.first = float(time[0])
            self.last = float(time[0]) - 1.0 / self.rate
        steps = np.diff(time, prepend=self.last) * self.rate
        breaks = np.flatnonzero(~(np.abs(steps - 1.0) <= STEP_TOLERANCE))
        if not len(breaks):
            self._continue(time)
            return news
        bounds = sorted({0, *breaks.tolist(), len(time)})
        for start, stop in pairwise(bounds):
            news += self._add_run(time[start:stop])
        return news

    def _count_values(self, block: Block) -> list[str]:
        values = block.data[:, 1:]
        if np.isfinite(values).all():
            return []
        news = []
        for name, column in zip(block.columns[1:], values.T, strict=True):
            bad = int(np.count_nonzero(~np.isfinite(column)))
            if bad:
                self.not_finite[name] = self.not_finite.get(name, 0) + bad
                news.append(f"{bad} of {len(column)} samples of {name} are NaN or infinite")
        return news

    def _continue(self, time: np.ndarray) -> None:
        self.samples += len(time)
        self.last = float(time[-1])

    def _add_run(self, time: np.ndarray) -> list[str]:
        """Count samples that follow each other, after a step that is not one interval."""
        assert self.rate is not None
        assert self.last is not None
        step = (time[0] - self.last) * self.rate
        if step > 0.0 and abs(step - max(1.0, round(step))) > WHOLE_TOLERANCE:
            self.uneven += 1
        if float(time[0]) - self.last > MAX_PAUSE:
            self.clock_steps.append((self.last, self.last - float(time[0])))
            self._continue(time)
            return [f"time goes forward by {-self.clock_steps[-1][1]:.3f} s"]
        if step > 1.0 + STEP_TOLERANCE:
            gap = Gap(self.last, float(time[0]), round(step) - 1)
            self.gaps.append(gap)
            self._continue(time)
            return [
                f"{gap.missing} samples ({gap.missing / self.rate:.3f} s) missing before t = "
                f"{time[0]:.6f} s"
            ]
        if step > 0.0:
            self._continue(time)
            return []
        self._steps_back += 1
        back = self.last - float(time[0])
        if back > MAX_LATENESS:
            self.clock_steps.append((self.last, back))
            self._continue(time)
            return [f"time was set back by {back:.3f} s at t = {self.clock_steps[-1][0]:.6f} s"]
        return self._add_late(time)

    def _add_late(self, time: np.ndarray) -> list[str]:
        assert self.rate is not None
        assert self.last is not None
        half = STEP_TOLERANCE / self.rate
        late = 0
        # Gaps are in the order of time: those before the first sample stay as they are.
        first = len(self.gaps)
        while first and self.gaps[first - 1].end > time[0]:
            first -= 1
        gaps: list[Gap] = []
        for gap in self.gaps[first:]:
            inside = time[(time > gap.start + half) & (time < gap.end - half)]
            late += len(inside)
            gaps += self._left_of(gap, inside) if len(inside) else [gap]
        self.gaps[first:] = gaps
        new = time[time > self.last + half]
        repeated = len(time) - late - len(new)
        self.late += late
        self.samples += late
        self.repeated += repeated
        if len(new):
            self._continue(new)
        news = []
        if late:
            news.append(f"{late} samples came late, from t = {time[0]:.6f} s, and fill a gap")
        if repeated:
            news.append(f"{repeated} samples from t = {time[0]:.6f} s are there already")
        return news

    def _left_of(self, gap: Gap, inside: np.ndarray) -> list[Gap]:
        """Return what remains of a gap when samples that follow each other fill a part of it."""
        assert self.rate is not None
        ends = ((gap.start, float(inside[0])), (float(inside[-1]), gap.end))
        parts = [Gap(start, end, round((end - start) * self.rate) - 1) for start, end in ends]
        return [part for part in parts if part.missing > 0]

    def sentences(self, topic: str, origin: float) -> list[str]:
        """Return what is wrong, with numbers and places.

        Parameters
        ----------
        topic
            Named in each sentence.
        origin
            Time [s] from which places are counted.
        """
        found = []
        gaps = sorted(self.lasting_gaps, key=lambda gap: -gap.missing)
        if gaps:
            places = "; ".join(
                f"{gap.missing} at {gap.start - origin:.3f} s" for gap in gaps[:SHOWN_GAPS]
            )
            more = f"; and {len(gaps) - SHOWN_GAPS} shorter ones" if len(gaps) > SHOWN_GAPS else ""
            found.append(
                f"{topic}: {self.missing} samples ({self.missing_time:.3f} s) are missing in "
                f"{len(gaps)} gap{'s' if len(gaps) > 1 else ''}: {places}{more}"
            )
        if self.irregular:
            found.append(
                f"{topic}: the sampling is irregular: {self.uneven} steps are no whole number of "
                "intervals, so single missing samples cannot be told"
            )
        if self.late:
            found.append(f"{topic}: {self.late} samples came late and are in their place")
        if self.repeated:
            found.append(f"{topic}: {self.repeated} samples have a time that is there already")
        for at, back in self.clock_steps[:SHOWN_GAPS]:
            way = "back" if back > 0 else "forward"
            found.append(f"{topic}: time was set {way} by {abs(back):.3f} s at {at - origin:.3f} s")
        if self.undated:
            found.append(f"{topic}: {self.undated} samples have no possible time")
        for column, count in self.not_finite.items():
            found.append(f"{topic}: {count} samples of {column} are NaN or infinite")
        if self.mixed:
            found.append(
                f"{topic}: time runs back {self._steps_back} times in {self.blocks} blocks, as "
                "when two nodes publish the topic"
            )
        return found
