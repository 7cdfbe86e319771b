"""Whether the samples of a stream follow each other: gaps, steps back in time, damaged values.

No block may be lost silently: a reader that finds a gap reports it and stays right.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ankle_interfaces.errors import SamplingError

# Clocks of rigs drift by parts per million; a tenth of a per cent tells 1000 Hz from 1024 Hz.
RATE_TOLERANCE = 1e-3
# Half a sample: less is rounding of t, more means that a sample is missing or doubled.
STEP_TOLERANCE = 0.5


@dataclass(frozen=True)
class Finding:
    """Describes a finding about the samples between or inside blocks.

    Attributes
    ----------
    kind
        ``gap``, ``backwards``, ``rate`` or ``not_finite``.
    message
        One sentence with numbers.
    missing
        Samples that a gap leaves out, else 0.
    """

    kind: str
    message: str
    missing: int = 0


def sampling_rate(time: np.ndarray) -> float:
    """Return the sampling rate [Hz] of a signal by the median step between its times.

    Parameters
    ----------
    time
        Sample times [s], shape (n,) with n of at least 2.

    Returns
    -------
    float
        A whole number where the rate is one within 1e-4.

    Raises
    ------
    SamplingError
        Fewer than two samples or a median step that is not positive.
    """
    if len(time) < 2:
        raise SamplingError(
            f"{len(time)} sample(s) do not tell a sampling rate; at least 2 are needed"
        )
    steps = np.diff(time)
    step = float(np.median(steps))
    if np.isinf(step):
        raise SamplingError(f"a median step of {step:g} s is no sampling interval")
    regular = steps[np.abs(steps - step) < STEP_TOLERANCE * abs(step)]
    step = float(np.mean(regular)) if len(regular) else step
    if not step > 0:
        raise SamplingError(f"time does not increase: median step {step:g} s")
    rate = 1.0 / step
    if not np.isfinite(rate):
        raise SamplingError(f"a median step of {step:g} s is no sampling interval")
    return float(round(rate)) if abs(rate - round(rate)) < 1e-4 * rate else rate


class Continuity:
    """Follows one stream of blocks and counts what is missing.

    Parameters
    ----------
    rate
        Sampling rate [Hz] where it is known beforehand.
    sparse
        Whether NaN stands for a value that does not exist, and so is no damage but in the time.

    Attributes
    ----------
    rate
        Sampling rate [Hz] from the first block with two samples, None before.
    missing
        Samples missing in all gaps so far.
    blocks
        Blocks seen.
    """

    def __init__(self, rate: float | None = None, sparse: bool = False) -> None:
        self.rate = rate
        self._sparse = sparse
        self.missing = 0
        self.blocks = 0
        self._last: float | None = None

    def check(self, data: np.ndarray) -> list[Finding]:
        """Return findings for a block of shape (n, m) whose first column is time [s].

        The result is empty where all is well.

        Time running backwards is reported once: the stream is followed from its new time on.
        """
        self.blocks += 1
        time = data[:, 0]
        if not len(time):
            return []
        findings = self._damage(data)
        if self.rate is None:
            if len(time) < 2:
                self._last = float(time[-1])
                return findings
            try:
                self.rate = sampling_rate(time)
            except ValueError as error:
                return [*findings, Finding("backwards", str(error))]
        before = time[:1] - 1.0 / self.rate if self._last is None else np.array([self._last])
        steps = np.diff(np.concatenate([before, time])) * self.rate
        for index in np.flatnonzero(~(np.abs(steps - 1.0) <= STEP_TOLERANCE)):
            if np.isfinite(steps[index]):
                findings.append(_step_finding(float(steps[index]), float(time[index]), self.rate))
                self.missing += findings[-1].missing
        findings += _rate_findings(steps, float(time[0]), self.rate)
        if np.isfinite(time[-1]):
            self._last = float(time[-1])
        return findings

    def _damage(self, data: np.ndarray) -> list[Finding]:
        damaged = ~np.isfinite(data)
        if self._sparse:
            damaged[:, 1:] &= ~np.isnan(data[:, 1:])
        if not damaged.any():
            return []
        bad = int(np.count_nonzero(damaged.any(axis=1)))
        return [
            Finding(
                "not_finite",
                f"{bad} of {len(data)} samples from t = {data[0, 0]:.6f} s are NaN or infinite",
            )
        ]


def _step_finding(step: float, at: float, rate: float) -> Finding:
    """Describe a step in time of so many samples, up to a time [s], that is not one sample."""
    if step <= 0:
        return Finding(
            "backwards", f"time runs back by {(1 - step) / rate:.6f} s at t = {at:.6f} s"
        )
    if step < 1:
        return Finding(
            "rate",
            f"samples {step / rate:.6f} s apart at t = {at:.6f} s, expected {1 / rate:.6f} s",
        )
    lost = round(step) - 1
    return Finding(
        "gap", f"{lost} samples ({lost / rate:.3f} s) missing before t = {at:.6f} s", lost
    )


def _rate_findings(steps: np.ndarray, at: float, rate: float) -> list[Finding]:
    """Compare the rate within a block that begins at a time [s]; its steps are in samples."""
    if len(steps) < 2:
        return []
    # The median, without the time that np.median needs for 32 values.
    middle = float(np.sort(steps[1:])[len(steps) // 2 - 1])
    if not (middle > 0 and abs(middle - 1.0) > RATE_TOLERANCE):  # also where times are NaN
        return []
    return [
        Finding(
            "rate",
            f"sampling rate {rate / middle:.2f} Hz at t = {at:.6f} s, expected {rate:.2f} Hz",
        )
    ]
