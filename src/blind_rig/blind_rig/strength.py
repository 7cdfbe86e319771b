"""The strength of an effect is a share of the torque's variance.

It is the share that the effect adds beyond what the paper's model could absorb.

An effect that merely looks like a little more stiffness, or like a slightly later reflex, is no
mismatch: nobody could see it. Its strength is therefore what remains after inertia, viscosity,
stiffness and reflex, with its delay and dynamics, have been fitted again: (unexplained variance
with the effect - without it) / variance of the torque without it, in 0.1-80 Hz, without sensor
noise, the voluntary torque known, and all stretches answered alike. (A reflex that an effect makes
larger varies more from stretch to stretch. That is no sign of the effect.)
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.signal import butter, lfilter, sosfiltfilt

from blind_rig.anatomy import Reflex
from blind_rig.ankle_torque import reflex_series
from blind_rig.effects import Effect
from blind_rig.trial import Run, Trial, run

STRENGTHS = {"weak": 0.005, "moderate": 0.02, "strong": 0.06}
BAND = (0.1, 80.0)
# Rate at which variances are taken [Hz]; the band ends well below its half.
ANALYSIS_RATE = 500.0
# Stretch that tells the strength of an effect that does not depend on the whole trial [s].
STRETCH = 16.0
# Points between the weakest and the strongest magnitude that are tried where the strongest is not
# the most visible one.
SCAN_POINTS = 6
# Below this share nobody could see the effect; it says nothing about a diagnosis.
MIN_VISIBLE_SHARE = STRENGTHS["weak"] / 2
# Gains beyond this factor are no longer those of a healthy subject.
LARGEST_COMPENSATION = 12.0
# Steps of the derivatives of the reflex response: small against its delay of 40 ms, and several
# samples at 2048 Hz.
DELAY_STEP = 0.002  # s
DYNAMICS_STEP = 0.05
# Accuracy of the search, in the logarithm of the magnitude; about twice that in the share.
SEARCH_TOLERANCE = 0.02


class Scaled(NamedTuple):
    """Holds an effect brought to a strength.

    Attributes
    ----------
    changes
        What is to be replaced in the setup.
    target, share
        Demanded and reached share [1].
    """

    changes: dict[str, float]
    target: float
    share: float


def _banded(signal: np.ndarray, rate: float) -> np.ndarray:
    every = max(int(rate / ANALYSIS_RATE), 1)
    low = sosfiltfilt(butter(4, BAND[1], fs=rate, output="sos"), signal - signal.mean())[::every]
    return sosfiltfilt(butter(2, BAND[0], "highpass", fs=rate / every, output="sos"), low)


def unexplained_variance(done: Run, trial: Trial) -> tuple[float, float]:
    """Return the variance of the noise-free torque [N.m squared] and the part of it that the
    paper's model and the voluntary torque leave.

    The regressors come from the position as the sensor shows it: position, velocity, acceleration,
    and the reflex response to delayed rectified velocity, with its derivatives by delay, frequency
    and damping at the subject's own values.
    """
    rate = done.rate
    x = done.reading.position
    v = np.gradient(x, 1.0 / rate)
    intrinsic = [x, v, np.gradient(v, 1.0 / rate)]
    columns = [*intrinsic, *_reflex_columns(v, rate, trial.setup.reflex), done.course.steady]
    design = np.column_stack([_banded(column, rate) for column in columns])
    torque = _banded(done.reading.torque, rate)
    # The first second holds the filters' and the rig's own start.
    skip = int(ANALYSIS_RATE)
    design, torque = design[skip:], torque[skip:]
    scale = design.std(axis=0)
    scale[scale == 0] = 1.0
    solution = np.linalg.lstsq(design / scale, torque, rcond=None)[0]
    return float(torque.var()), float((torque - design / scale @ solution).var())


def _reflex_columns(velocity: np.ndarray, rate: float, reflex: Reflex) -> list[np.ndarray]:
    """Return the reflex response to rectified velocity, and how it changes with the delay, the
    frequency and the damping of the reflex.
    """
    stretch = np.maximum(velocity, 0.0)

    def response(delay: float, omega: float, zeta: float) -> np.ndarray:
        late = round(delay * rate)
        b, a = _semi_implicit(omega, zeta, rate)
        driven = lfilter(b, a, stretch)
        return np.concatenate([np.zeros(late), driven[: len(driven) - late]])

    delay, omega, zeta = reflex.delay, reflex.omega, reflex.zeta
    more, less = 1.0 + DYNAMICS_STEP, 1.0 - DYNAMICS_STEP
    return [
        response(delay, omega, zeta),
        response(delay + DELAY_STEP, omega, zeta) - response(delay - DELAY_STEP, omega, zeta),
        response(delay, omega * more, zeta) - response(delay, omega * less, zeta),
        response(delay, omega, zeta * more) - response(delay, omega, zeta * less),
    ]


def _semi_implicit(omega: float, zeta: float, rate: float) -> tuple[list[float], list[float]]:
    """Return second-order response with unit gain at rest, integrated as `ankle_torque` does:
    velocity first, then position.
    """
    d = 1.0 / rate
    return [omega**2 * d**2], [
        1.0,
        2 * zeta * omega * d + omega**2 * d**2 - 2.0,
        1.0 - 2 * zeta * omega * d,
    ]


def share(trial: Trial, plain: tuple[float, float], seconds: float | None = None) -> float:
    """Return the share of variance that a trial's effects add, against `plain`:
    `unexplained_variance` of the same trial without them.
    """
    _, left = unexplained_variance(run(trial, seconds), trial)
    return max((left - plain[1]) / plain[0], 1e-9)


def compensating_gain(trial: Trial, changes: dict[str, float], without: Run) -> float:
    """Return the reflex gain [N.m.s/rad] with which the changed reflex is as large as the plain one
    along the motion of `without`.

    A subject with a threshold has a threshold and a gain, not a weaker reflex than others.
    """
    dt, motion = 1.0 / without.rate, without.motion
    plain = reflex_series(motion.plate, motion.plate_velocity, trial.setup.reflex, dt)
    changed = reflex_series(
        motion.plate, motion.plate_velocity, trial.setup.replaced(changes).reflex, dt
    )
    factor = plain.std() / max(changed.std(), plain.std() / LARGEST_COMPENSATION)
    return trial.setup.reflex.G * float(factor)


def scale(
    trial: Trial,
    effect: Effect,
    shape: dict[str, float],
    limits: tuple[float, float],
    target: float,
) -> Scaled:
    """Return the magnitude at which an effect reaches a share.

    Some effects hide again when they grow: a threshold above all velocities is no reflex at all,
    which the paper's model knows. The search stays on the side of the peak towards the weak end.
    Where the target lies outside of what the effect's physiological or technical range allows, the
    nearest magnitude is taken, and the reached share says so.

    Parameters
    ----------
    trial
        Without the effect.
    effect
        What grows.
    shape, limits
        As `effects.draw_shape` gives.
    target
        Share [1].
    """
    trial = trial._replace(setup=trial.setup.replaced({"courses.stretch_variation": 0.0}))
    seconds = None if effect.slow else min(STRETCH, trial.protocol.duration)
    without = run(trial, seconds)
    plain = unexplained_variance(without, trial)
    sign = math.copysign(1.0, limits[0])
    seen: dict[float, float] = {}

    def changes(logarithm: float) -> dict[str, float]:
        change = {**shape, effect.magnitude: sign * math.exp(logarithm)}
        return (
            {**change, "reflex.G": compensating_gain(trial, change, without)}
            if effect.keeps_reflex
            else change
        )

    def excess(logarithm: float) -> float:
        if logarithm not in seen:
            changed = trial.setup.replaced(changes(logarithm))
            seen[logarithm] = share(trial._replace(setup=changed), plain, seconds)
        return math.log(seen[logarithm] / target)

    weak, strong = (math.log(abs(limit)) for limit in limits)
    if excess(weak) >= 0:
        best = weak
    else:
        if excess(strong) < 0:
            strong = max(np.linspace(weak, strong, SCAN_POINTS + 2)[1:].tolist(), key=excess)
        if excess(strong) <= 0:
            return Scaled(changes(strong), target, seen[strong])
        found = float(brentq(excess, weak, strong, xtol=SEARCH_TOLERANCE))
        excess(found)
        best = min(seen, key=lambda at: abs(math.log(seen[at] / target)))
    return Scaled(changes(best), target, seen[best])


def strength_of(reached: float) -> str:
    """Return the name of the strength that is nearest to a share, on a logarithmic scale;
    ``invisible`` below `MIN_VISIBLE_SHARE`.
    """
    if reached < MIN_VISIBLE_SHARE:
        return "invisible"
    return min(STRENGTHS, key=lambda name: abs(math.log(max(reached, 1e-9) / STRENGTHS[name])))
