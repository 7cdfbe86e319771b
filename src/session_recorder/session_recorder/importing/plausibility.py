"""Whether recorded signals can be what was stated about them: units, sign of torque, sampling rate.

An ankle is a body part of known size. Its range of movement, strength, inertia and stiffness leave
room for every subject, but not for a factor of 57 (degrees) or 1000 (millinewton-metres), and
inertia and stiffness are positive. They are estimated around fast movements by least squares of

    torque(t) = I acceleration(t) + B velocity(t) + K position(t)            (paper, figure 1)
              + sum over lags of reflexes to stretches at t - lag of either direction

with every signal band-passed alike, in segments whose scatter gives the uncertainty.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.signal import butter, sosfiltfilt

from ankle_physics.reflex_arc import RESPONSE_LAGS, late_stretches

# From 50 degrees plantarflexion to 30 degrees dorsiflexion is the joint's range; with room for
# where zero was put.
LARGEST_POSITION = 1.5  # rad
LARGEST_SPREAD = 1.6  # rad
# Twice the strongest maximal voluntary contractions in the literature (about 200 N.m in
# plantarflexion).
LARGEST_TORQUE = 400.0  # N.m
# Sprinting reaches 15 rad/s.
LARGEST_VELOCITY = 40.0  # rad/s
# Amplifiers end at 10 or 15 V.
LARGEST_EMG = 20.0  # V
# Foot alone 0.005 to 0.015 kg.m^2; with a heavy footplate up to 0.1.
INERTIA_RANGE = (0.002, 0.25)  # kg.m^2
# Relaxed about 10, maximally contracted about 500 N.m/rad; the recording includes what reflexes
# add.
STIFFNESS_RANGE = (2.0, 2000.0)  # N.m/rad
# What resonates between sensor and foot, or a leg that gives way, multiplies what is seen of
# inertia or stiffness; a wrong unit multiplies it by 57 and more.
RESONANCE_FACTOR = 4.0
# Below 5 Hz voluntary torque dominates, above 40 Hz the noise of differentiated positions.
BAND = (5.0, 40.0)  # Hz
SEGMENT = 2.0  # s; ten periods of the band's lower edge
FEWEST_SEGMENTS = 4
# Standard errors from zero before a sign counts as known.
MIN_SIGN_SIGNIFICANCE = 5.0
# Less of the torque's variance explained says nothing about the ankle.
MIN_EXPLAINED_SHARE = 0.05
# A measured velocity may have its own filter and calibration, not another factor or no resemblance.
VELOCITY_GAIN_RANGE = (0.7, 1.4)
LEAST_CORRELATION = 0.7
# Share of impossible samples that are faults of single ones; a wrong unit makes more impossible.
MAX_CODED_SHARE = 0.01
# Units that are mistaken for each other, as factors to SI.
ANGLE_UNITS = {"deg": np.pi / 180, "mrad": 1e-3}
TORQUE_UNITS = {"mN.m": 1e-3, "N.cm": 1e-2, "kN.m": 1e3}


@dataclass(frozen=True)
class Intrinsic:
    """Holds the estimates over the segments of a recording.

    Attributes
    ----------
    inertia, viscosity, stiffness
        Means [kg.m^2, N.m.s/rad, N.m/rad].
    inertia_error, viscosity_error, stiffness_error
        Their standard errors.
    explained
        Share of the torque's variance in the band, 0 to 1.
    upright
        By how much more of that variance inertia, viscosity and stiffness explain when they may not
        be negative than when they may not be positive, -1 to 1.
    """

    inertia: float
    inertia_error: float
    viscosity: float
    viscosity_error: float
    stiffness: float
    stiffness_error: float
    explained: float
    upright: float

    @property
    def contradicts_itself(self) -> bool:
        """Say whether inertia, viscosity and stiffness contradict each other for certain: something
        resonates between sensor and foot, or the torque is late.
        """
        return len(self._certain_signs) > 1

    @property
    def sign(self) -> int:
        """Return 1 where positive torque moves the ankle in the direction in which its angle rises,
        -1 where it is the opposite, and 0 where this is not known.

        Where the three quantities contradict each other, the sign is that with which a passive
        joint explains more.
        """
        if self.contradicts_itself:
            return int(np.sign(self.upright))
        return next(iter(self._certain_signs), 0)

    @property
    def _certain_signs(self) -> set[int]:
        """Return the signs of those of the three quantities that are certain."""
        return {
            _certain_sign(self.inertia, self.inertia_error),
            _certain_sign(self.viscosity, self.viscosity_error),
            _certain_sign(self.stiffness, self.stiffness_error),
        } - {0}


def _certain_sign(value: float, error: float) -> int:
    """Return the sign of a value, and 0 where it is not certain."""
    return int(np.sign(value)) if abs(value) > MIN_SIGN_SIGNIFICANCE * error else 0


def check_ranges(columns: dict[str, np.ndarray]) -> list[str]:
    """Return contradictions between SI columns and what an ankle can do.

    Columns are given by full name, shape (n,).
    """
    found = []
    columns = {
        name: values[np.isfinite(values)]
        for name, values in columns.items()
        if np.isfinite(values).any()
    }
    position = columns.get("position[rad]")
    if position is not None:
        spread, largest = float(np.ptp(position)), float(np.max(np.abs(position)))
        if spread > LARGEST_SPREAD or largest > LARGEST_POSITION:
            found.append(
                f"position spans {spread:.4g} rad and reaches {largest:.4g} rad, an ankle's range "
                f"is {LARGEST_SPREAD:g} rad"
                + _suggest(largest, ANGLE_UNITS, LARGEST_POSITION)
                + _suggest_neutral(position)
            )
    for name, limit, units in (
        ("torque[N.m]", LARGEST_TORQUE, TORQUE_UNITS),
        (
            "velocity[rad/s]",
            LARGEST_VELOCITY,
            {f"{unit}/s": factor for unit, factor in ANGLE_UNITS.items()},
        ),
        *(
            (name, LARGEST_EMG, {"mV": 1e-3, "uV": 1e-6})
            for name in columns
            if name.endswith("[V]")
        ),
    ):
        values = columns.get(name)
        if values is not None and (largest := float(np.max(np.abs(values)))) > limit:
            quantity, unit = name[:-1].split("[")
            beyond = int(np.sum(np.abs(values) > limit))
            found.append(
                f"{quantity} reaches {largest:.4g} {unit}, more than {limit:g} {unit} is not "
                "possible"
                + (
                    f"; {beyond} of {len(values)} samples do: is {largest:.4g} written where a "
                    "value is missing? Then leave these cells empty"
                    if beyond <= MAX_CODED_SHARE * len(values)
                    else _suggest(largest, units, limit)
                )
            )
    return found


def _suggest_neutral(position: np.ndarray) -> str:
    """Return the option for a file that counts angles from another zero than the neutral ankle."""
    if np.ptp(position) > LARGEST_SPREAD:
        return ""
    return (
        " Or does the file count from another zero? Then state its angle of the neutral ankle, as "
        "in --neutral 90"
    )


def _suggest(largest: float, units: dict[str, float], limit: float) -> str:
    fitting = [unit for unit, factor in units.items() if largest * factor <= limit]
    return f"; is it in {' or '.join(fitting)}?" if fitting else ""


def segments(rate: float, *signals: np.ndarray) -> Iterator[tuple[np.ndarray, ...]]:
    """Return pieces of `SEGMENT` seconds in which every signal is finite, band-passed to `BAND`,
    without the ends where the filter rings.

    Parameters
    ----------
    rate
        Sampling rate [Hz].
    signals
        Shape (n,) each; the samples must be equally spaced, except where one is NaN.
    """
    length, edge = int(SEGMENT * rate), int(rate / BAND[0])
    if rate < 2.5 * BAND[1]:
        return
    band = butter(2, BAND, "bandpass", fs=rate, output="sos")
    for start in range(0, len(signals[0]) - length + 1, length):
        pieces = [signal[start : start + length] for signal in signals]
        if all(np.isfinite(piece).all() for piece in pieces):
            yield tuple(sosfiltfilt(band, piece - piece.mean())[edge:-edge] for piece in pieces)


def intrinsic(rate: float, position: np.ndarray, torque: np.ndarray) -> Intrinsic | None:
    """Estimate inertia and stiffness of a recording in SI, shape (n,) each.

    The result is None where the recording does not determine them.

    It does not where fewer than `FEWEST_SEGMENTS` are intact, nothing moves, or movement explains
    less than `MIN_EXPLAINED_SHARE` of the torque.
    """
    # Strong reflexes of a relaxed ankle turn the sign of its stiffness around in this band where
    # they are not beside it. Which direction stretches the calf is not known yet.
    estimates, weights, left, upright, total = [], [], 0.0, 0.0, 0.0
    for x, y, *reflexes in segments(
        rate, position, torque, *late_stretches(np.gradient(position), rate)
    ):
        velocity = np.gradient(x, 1 / rate)
        moved = np.column_stack([np.gradient(velocity, 1 / rate), velocity, x])
        scale = np.sqrt(np.mean(moved**2, axis=0))
        if not (scale > 0).all() or np.linalg.matrix_rank(moved / scale, tol=1e-6) < 3:
            continue
        regressors = np.column_stack([moved / scale, *reflexes])
        solution, *_ = np.linalg.lstsq(regressors, y, rcond=1e-6)
        estimates.append(solution[:3] / scale)
        weights.append(float(np.mean(x**2)))
        left += float(np.sum((y - regressors @ solution) ** 2))
        total += float(np.sum(y**2))
        upright += _upright(y, moved / scale, np.column_stack(reflexes))
    if len(estimates) < FEWEST_SEGMENTS or total == 0:
        return None
    # So many independent values has a segment in the band: regressors explain their share of noise.
    values = 2.0 * (BAND[1] - BAND[0]) * (SEGMENT - 2.0 / BAND[0])
    explained = 1.0 - left / total / (1.0 - (3 + 2 * len(RESPONSE_LAGS)) / values)
    if explained < MIN_EXPLAINED_SHARE:
        return None
    # A segment without a perturbation tells little: each counts by the movement in it.
    share = np.array(weights) / np.sum(weights)
    mean = share @ np.array(estimates)
    error = np.sqrt(share**2 @ (np.array(estimates) - mean) ** 2 * len(share) / (len(share) - 1))
    (inertia, viscosity, stiffness), errors = mean.tolist(), error.tolist()
    return Intrinsic(
        inertia,
        errors[0],
        viscosity,
        errors[1],
        stiffness,
        errors[2],
        float(explained),
        upright / total,
    )


def _upright(torque: np.ndarray, joint: np.ndarray, reflexes: np.ndarray) -> float:
    """Return how much less of the sum of squares of a torque inertia, viscosity and stiffness, the
    columns of `joint`, leave when they may not be negative than when they may not be positive; the
    reflexes beside them may be either.
    """
    signals = np.column_stack([torque, joint])
    signals -= reflexes @ np.linalg.lstsq(reflexes, signals, rcond=1e-6)[0]
    left, mirrored = (nnls(sign * signals[:, 1:], signals[:, 0])[1] for sign in (1.0, -1.0))
    return float(mirrored**2 - left**2)


def check_intrinsic(found: Intrinsic, stated_sign: str) -> list[str]:
    """Return contradictions between an ankle's inertia and stiffness and those found under the
    stated units and sign.

    Units are told by inertia where it is certain, and by stiffness otherwise.
    """
    values = f"inertia {found.inertia:.3g} ± {found.inertia_error:.1g} kg.m^2"
    values += f", viscosity {found.viscosity:.3g} ± {found.viscosity_error:.1g} N.m.s/rad"
    values += f", stiffness {found.stiffness:.4g} ± {found.stiffness_error:.2g} N.m/rad"
    contradictions = []
    if found.sign < 0:
        other = "subject" if stated_sign == "rig" else "rig"
        positive = (
            "and with the other sign a passive joint explains more"
            if found.contradicts_itself
            else "which are positive in an ankle"
        )
        contradictions.append(
            f"the torque's sign is not '{stated_sign}': it gives {values}, {positive}; state "
            f"'{other}'"
        )
    inertia = _certain_sign(found.inertia, found.inertia_error)
    # An inertia of the other sign is that of a resonance, beside which stiffness tells no unit.
    if found.sign == 0 or inertia == -found.sign:
        return contradictions
    value, (lowest, highest), unit = (
        (found.inertia, INERTIA_RANGE, "kg.m^2")
        if inertia
        else (found.stiffness, STIFFNESS_RANGE, "N.m/rad")
    )
    factor = RESONANCE_FACTOR if found.contradicts_itself else 1.0
    if not lowest / factor <= abs(value) <= factor * highest:
        guess = (
            "position in degrees, torque already in N.m, or torque by body mass"
            if abs(value) < lowest
            else "torque in mN.m, or position already in rad"
        )
        contradictions.append(
            f"the units of position and torque do not fit each other: {values}, an ankle has "
            f"{lowest:g} to {highest:g} {unit}; {guess}?"
        )
    return contradictions


def velocity_gain(
    rate: float, position: np.ndarray, velocity: np.ndarray
) -> tuple[float, float] | None:
    """Return how a velocity follows the derivative of a position.

    Parameters
    ----------
    rate
        Sampling rate [Hz].
    position, velocity
        Samples of both signals, shape (n,) each.

    Returns
    -------
    tuple[float, float] | None
        Gain and correlation; None where nothing moves.
    """
    cross = own = other = 0.0
    for x, v in segments(rate, position, velocity):
        slope = np.gradient(x, 1 / rate)
        cross, own, other = (
            cross + float(slope @ v),
            own + float(slope @ slope),
            other + float(v @ v),
        )
    if own == 0:
        return None
    return cross / own, cross / np.sqrt(own * other) if other else 0.0


def check_velocity(rate: float, position: np.ndarray, velocity: np.ndarray) -> list[str]:
    """Return contradictions between a velocity [rad/s] and the derivative of position [rad]."""
    found = velocity_gain(rate, position, velocity)
    if found is None:
        return []
    gain, correlation = found
    if correlation < -LEAST_CORRELATION:
        return [
            "velocity has the opposite sign of the derivative of position (correlation "
            f"{correlation:.2f})"
        ]
    if correlation < LEAST_CORRELATION:
        return [
            f"velocity does not follow the derivative of position (correlation {correlation:.2f})"
        ]
    if not VELOCITY_GAIN_RANGE[0] <= gain <= VELOCITY_GAIN_RANGE[1]:
        near = [
            f"{unit}/s"
            for unit, factor in ANGLE_UNITS.items()
            if VELOCITY_GAIN_RANGE[0] <= gain * factor <= VELOCITY_GAIN_RANGE[1]
        ]
        return [
            f"velocity is {gain:.4g} times the derivative of position"
            + (f"; is it in {near[0]}?" if near else "")
        ]
    return []
