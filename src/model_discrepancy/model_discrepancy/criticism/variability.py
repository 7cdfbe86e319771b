"""A residual holds parts that no movement predicts, and they are described here.

These are tremor, slow torque, a reflex that varies from stretch to stretch, and what is beyond a
subject's usual variability.

Generic regressors of the movement cannot see any of them. The first three are properties of every
subject and no mismatch. A narrow line in the torque, or responses that vary more than a reflex
does, are not explained.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.signal import welch

from model_discrepancy.criticism.response_variation import (
    LEAST_VARIATION,
    response_variation,
)
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import MATERIAL_SHARE, Fitter
from model_discrepancy.fit.inertia_course import inertia_course
from model_discrepancy.fit.reflex_variation import (
    USUAL_REFLEX_VARIATION,
    reflex_variation,
)
from model_discrepancy.fit.rows import LOW_PASS_ORDER, Rows
from model_discrepancy.fit.stiffness_variation import (
    stiffness_after_movements,
    stiffness_variation,
)
from model_discrepancy.recording.resolution import coarse_step
from model_discrepancy.recording.spectrum import low_pass

# Physiological tremor of the ankle: 6 to 12 Hz (Lakie, Vernooij, Osborne & Reynolds 2012, J.
# Physiol. 590, 6145), and a margin.
TREMOR_HZ = (5.5, 13.0)
LINES_HZ = (13.0, 78.0)
# Power of a peak over the median of its surroundings, and over the same ratio of the movement.
# Residuals of 10 simulated recordings without tremor or line: 1.0 to 1.7.
LEAST_PEAK = 4.0
# Periodograms of 2 s: half a hertz wide, 30 of them in a minute.
SEGMENT_S = 2.0
# A line is narrow: of its power above the surroundings a periodogram shows 4 % a hertz beside it
# at most, and noise adds to that. What a servo's resonance leaves shows 33 and 52 % there.
LARGEST_SHOULDER = 0.3
_SHOULDER_HZ = 1.0
# Of the torque's variance: a tenth of what matters at all (`MATERIAL_SHARE`), since a line is seen
# far below it. What a low-pass left of a servo's resonance seemed to be one of 5e-7 once.
LEAST_LINE_SHARE = 1e-4
# Width of a tremor's peak, and of the surroundings that it is compared with.
_PEAK_HZ, _AROUND_HZ = 1.5, 5.0
# A subject's reflex comes at the same time after every stretch: two human trials show 0.0 +- 1.5
# and 0.0 +- 0.5 ms, simulated recordings without mismatch up to 0.8 ms.
USUAL_REFLEX_JITTER = 0.004
# Sizes of a subject's reflex differ from one stretch to the next independently of each other: they
# are correlated by 0.0 +- 0.1 in the human trial that has enough of them.
# Where they do not, and differ by more than this, the reflex is turned down and up again.
MATERIAL_REFLEX_COURSE = 0.2
# In 58 recordings of the independent rig without a mismatch the stiffness varies by up to 5.4 %,
# and by 4 to 11 % in those with startles that are not pulses.
USUAL_STIFFNESS_VARIATION = 0.08
# A tenth to a third of a second after movements it differed from one to the next by 0 to 8.1 % in
# the same recordings, and by 14 to 44 % in 10 with startles.
USUAL_STIFFNESS_AFTER_MOVEMENTS = 0.12
# A body's inertia stays the same. In 80 recordings of an engine that nothing was tuned to it seemed
# to drift by 9 and 16 % where the gain of the torque channel did, by 2 % under an equation that the
# library lacks, and in none without a mismatch.
USUAL_INERTIA_DRIFT = 0.03
# Standard errors of a correlation that chance does not reach in one of 700 recordings.
_SERIAL_ERRORS = 3.0


# A plate moves slower.
_MOVEMENT_HZ = 20.0
# Voluntary torque is slower than the perturbation.
_SLOW_HZ = 2.0


@dataclass(frozen=True)
class Variability:
    """Describes the part of a residual that no movement predicts.

    Attributes
    ----------
    tremor
        Frequency [Hz] and rms [N.m] with standard errors, or None.
    reflex
        Standard deviation of the reflex' size from stretch to stretch as a share of its mean, with
        its standard error; None where the reflex is too small or stretches are too few.
    slow_torque
        Rms of the torque below 2 Hz that no movement makes [N.m].
    line_hz
        Frequency of a narrow line outside the tremor's band that holds at least `LEAST_LINE_SHARE`
        of the recorded torque's power, or None.
    variation
        Largest ratio of the residual's power after movements to that at rest, the reflex' variation
        taken out; NaN where the joint is never at rest.
    window
        In which window after the movement [s].
    varying_share
        Power of the torque that varies there beyond that at rest, as a share of the recorded
        torque's: in the octaves where it exceeds that at rest by `LEAST_IN_OCTAVE`.
    serial
        Correlation of the reflex' size in successive stretches, with its standard error, or None.
    timing
        Standard deviation of the reflex' time from stretch to stretch [s], with its standard error,
        or None.
    stiffness
        Standard deviation of the stiffness over pieces of 0.1 s as a share of its mean, with its
        standard error, or None.
    stiffness_after
        The same from one movement to the next, a tenth to a third of a second after each.
    inertia
        Standard deviation of a slow drift of the inertia as a share of it, with its standard error,
        or None.
    torque_step
        Distance of the levels that the recorded torque lies at [N.m]; 0 where it lies anywhere.
    """

    tremor: tuple[tuple[float, float], tuple[float, float]] | None
    reflex: tuple[float, float] | None
    slow_torque: float
    line_hz: float | None
    variation: float
    window: tuple[float, float]
    varying_share: float = 0.0
    serial: tuple[float, float] | None = None
    timing: tuple[float, float] | None = None
    stiffness: tuple[float, float] | None = None
    stiffness_after: tuple[float, float] | None = None
    inertia: tuple[float, float] | None = None
    torque_step: float = 0.0

    @property
    def unusual(self) -> list[str]:
        """Return what is more than a subject's usual variability, one sentence each."""
        found = []
        if self.line_hz is not None:
            found.append(
                f"the torque holds a line at {self.line_hz:.1f} Hz that no movement makes: "
                "pick-up or a vibration"
            )
        if self.reflex is not None and _exceeds(self.reflex, USUAL_REFLEX_VARIATION):
            found.append(
                f"the reflex varies by {100 * self.reflex[0]:.0f} % from stretch to stretch, more "
                f"than the {100 * USUAL_REFLEX_VARIATION:.0f} % of a subject at rest"
            )
        found += self.unexplainable
        if self.variation > LEAST_VARIATION and self.varying_share > MATERIAL_SHARE:
            low, high = (1000 * side for side in self.window)
            found.append(
                f"{low:.0f} to {high:.0f} ms after a movement the torque differs from one "
                f"movement to the next {self.variation:.1f} times as much (in power) as at rest: "
                "something that is no function of the movement changes the response"
            )
        return found

    @property
    def unexplainable(self) -> list[str]:
        """Return what no term can make: a coarse torque channel, an inertia that changes, and a
        reflex that changes in the course of time as no subject's at rest does.
        """
        found = []
        if self.torque_step > 0.0:
            found.append(
                f"the torque comes in steps of {self.torque_step:.2g} N.m: sensor or converter is "
                "too coarse for what is to be seen"
            )
        if self.inertia is not None and _exceeds(self.inertia, USUAL_INERTIA_DRIFT):
            found.append(
                f"the inertia seems to drift by {100 * self.inertia[0]:.0f} % in the course of the "
                "recording, as no body's does: the gain of the torque channel drifts, or what "
                "holds the foot loosens"
            )
        if self.timing is not None and _exceeds(self.timing, USUAL_REFLEX_JITTER):
            found.append(
                f"the reflex comes earlier and later from stretch to stretch by "
                f"{1000 * self.timing[0]:.1f} ms (standard deviation), more than the "
                f"{1000 * USUAL_REFLEX_JITTER:g} ms of a subject at rest"
            )
        if (
            self.reflex is not None
            and self.serial is not None
            and _exceeds(self.reflex, MATERIAL_REFLEX_COURSE)
            and self.serial[0] > _SERIAL_ERRORS * self.serial[1]
        ):
            found.append(
                f"the reflex is smaller and larger by {100 * self.reflex[0]:.0f} % for several "
                f"stretches at a time (their sizes are correlated by {self.serial[0]:.2f}): its "
                "excitability changes in the course of time"
            )
        return found

    @property
    def unsteady(self) -> list[str]:
        """Return a sentence where the stiffness changes more than without a mismatch.

        It is no mismatch beside named effects: subjects differ, and little is known of it.
        """
        moments = (
            (self.stiffness, USUAL_STIFFNESS_VARIATION, "moment"),
            (self.stiffness_after, USUAL_STIFFNESS_AFTER_MOVEMENTS, "movement"),
        )
        return [
            f"the stiffness is larger and smaller by {100 * found[0]:.0f} % from one {unit} to the "
            "next: muscles that contract now and then (startle, effort) do that"
            for found, limit, unit in moments
            if found is not None and _exceeds(found, limit)
        ]

    def content(self) -> dict[str, Any]:
        """Return the verdict's ``variability``."""
        found: dict[str, Any] = {"slow_torque": {"rms[N.m]": round(self.slow_torque, 4)}}
        if self.tremor is not None:
            found["tremor"] = {
                "frequency[Hz]": list(self.tremor[0]),
                "rms[N.m]": list(self.tremor[1]),
            }
        if self.reflex is not None:
            found["reflex_from_stretch_to_stretch"] = {"share_of_mean[1]": list(self.reflex)}
            if self.serial is not None:
                found["reflex_from_stretch_to_stretch"]["serial_correlation[1]"] = list(self.serial)
            if self.timing is not None:
                found["reflex_from_stretch_to_stretch"]["timing[s]"] = list(self.timing)
        if self.stiffness is not None:
            found["stiffness_in_time"] = {"share_of_mean[1]": list(self.stiffness)}
        if self.inertia is not None and self.inertia[0] > 0.0:
            found["inertia_in_time"] = {"share_of_mean[1]": list(self.inertia)}
        if self.stiffness_after is not None:
            found["stiffness_after_movements"] = {"share_of_mean[1]": list(self.stiffness_after)}
        return found


def _exceeds(found: tuple[float, float], limit: float) -> bool:
    """Tell whether a value exceeds a limit by more than two of its standard errors."""
    value, error = found
    return value - 2.0 * error > limit


def variability(
    fitter: Fitter, fit: Fit, torque: np.ndarray, base: Fit | None = None
) -> Variability:
    """Look for it in the residual of a fit.

    Parameters
    ----------
    fitter, fit
        Of the recording.
    torque
        As it was recorded [N.m], shape (n,).
    base
        The base model's fit, of whose stiffness a variation is a share; None: `fit` itself.
    """
    tremor, line = _peaks(fitter, fit, float(np.var(torque)))
    reflex = reflex_variation(fitter, fit)
    variation, window, share = response_variation(fitter, fit, reflex)
    slow = fitter.rows.slow(fit.left, _SLOW_HZ)
    mean = (fit if base is None else base).values.get("stiffness", {"K": 0.0})["K"]
    return Variability(
        tremor,
        reflex.spread,
        float(np.std(slow)),
        line,
        variation,
        window,
        share,
        reflex.serial,
        reflex.timing,
        stiffness_variation(fitter, fit, reflex, mean),
        stiffness_after_movements(fitter, fit, reflex, mean),
        inertia_course(fitter, fit),
        coarse_step(torque),
    )


def _peaks(
    fitter: Fitter, fit: Fit, variance: float
) -> tuple[tuple[tuple[float, float], tuple[float, float]] | None, float | None]:
    """Return tremor, as `Variability.tremor`, and the frequency of a narrow line, given the
    variance of the recorded torque [N.m^2].
    """
    rows = fitter.rows
    segments = int(rows.used.sum() / (SEGMENT_S * rows.rate))
    frequency, power, around = _periodogram(rows, fit.plain)
    # A sum of sines or a binary sequence makes peaks in what no term describes, too. They are no
    # tremor and no pick-up.
    made = [_periodogram(rows, rows.plain(rows.spectrum(one))) for one in _products(fitter)]
    by_movement = np.max([own / level for _, own, level in made], axis=0)
    by_movement = maximum_filter1d(by_movement, 3)
    ratio = power / around / np.maximum(by_movement, 1.0)
    tremor = None
    k = _highest(ratio, frequency, TREMOR_HZ)
    if ratio[k] > LEAST_PEAK:
        rms = float(np.sqrt(_power_of_peak(frequency, power, around, k)))
        # A narrow-band process has 2 T Δf degrees of freedom, at least the number of segments.
        error = rms / np.sqrt(2.0 * max(segments, 1))
        tremor = (float(frequency[k]), float(frequency[1])), (rms, error)
    beside = round(_SHOULDER_HZ * SEGMENT_S)
    shoulder = np.maximum(np.roll(ratio, beside), np.roll(ratio, -beside))
    ratio = np.where(shoulder - 1.0 < LARGEST_SHOULDER * (ratio - 1.0), ratio, 0.0)
    k = _highest(ratio, frequency, LINES_HZ)
    passed = low_pass(frequency[k], rows.limit, LOW_PASS_ORDER) ** 2
    share = _power_of_peak(frequency, power, around, k) / passed / variance
    line = ratio[k] > LEAST_PEAK and share > LEAST_LINE_SHARE
    return tremor, float(frequency[k]) if line else None


def _power_of_peak(
    frequency: np.ndarray, power: np.ndarray, around: np.ndarray, peak: int
) -> float:
    """Return the power [N.m^2] of a periodogram about a peak, beyond that of its surroundings."""
    inside = np.abs(frequency - frequency[peak]) < _PEAK_HZ
    excess = np.sum(power[inside] - around[inside]) * (frequency[1] - frequency[0])
    return float(max(excess, 0.0))


def _periodogram(rows: Rows, series: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return frequency, power, and the power around each frequency of rows (count,)."""
    frequency, power = welch(series[rows.used], rows.rate, nperseg=int(SEGMENT_S * rows.rate))
    distance = np.abs(frequency[:, None] - frequency[None, :])
    level = np.array([np.median(power[(d < _AROUND_HZ) & (d > _PEAK_HZ)]) for d in distance])
    return frequency, power, np.maximum(level, 1e-30)


def _products(fitter: Fitter) -> tuple[np.ndarray, ...]:
    """Return what a movement drives a joint by, linear or not, shape (n,) each."""
    rows, motion = fitter.rows, fitter.columns.motion
    # Noise of the encoder would hide their higher lines.
    angle = rows.slow(rows.spectrum(motion.position), _MOVEMENT_HZ)
    velocity = rows.slow(rows.spectrum(motion.velocity), _MOVEMENT_HZ)
    stretch = np.maximum(velocity, 0.0)
    return velocity, stretch, stretch**2, stretch**3, angle * velocity, angle**3, velocity**3


def _highest(ratio: np.ndarray, frequency: np.ndarray, band: tuple[float, float]) -> int:
    return int(np.argmax(np.where((frequency >= band[0]) & (frequency <= band[1]), ratio, 0.0)))
