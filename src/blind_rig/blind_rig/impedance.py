"""True K, B, I and G of a trial: what the joint itself was, about the recording's own mean.

K is the slope of the elastic torque of muscle and tissues against the foot's angle, at its mean
angle; the foot's weight turns with the foot and adds its own slope. What has memory (relaxation,
cross-bridges, bonds, dry friction) and what belongs to straps and rig count in none of the values.
G is the torque impulse of the reflexes to the calf's stretch, for each radian of stretch.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from blind_rig.trial import Run, Trial


class TrueImpedance(NamedTuple):
    """Holds values over a stretch of a trial.

    Attributes
    ----------
    K
        [N.m/rad].
    B
        [N.m.s/rad], mean of both directions.
    I
        Of foot and plate [kg.m^2].
    G
        [N.m.s/rad].
    """

    K: float
    B: float
    I: float
    G: float


def true_impedance(
    trial: Trial, done: Run, start: float = 0.0, end: float = math.inf
) -> TrueImpedance:
    """Return values between two times [s] of a trial.

    Parameters
    ----------
    trial
        What was run.
    done
        As it went.
    start, end
        The stretch [s]; to the end of the trial where `end` lies beyond it.
    """
    rig, muscle, reflex = trial.setup.rig, trial.setup.muscle, trial.setup.reflex
    last = None if math.isinf(end) else round(end * done.rate)
    part = slice(round(start * done.rate), last)
    foot = done.motion.foot[part]
    scale = float(np.mean(done.course.muscle_scale[part]))
    x = float(np.mean(foot))
    slope = (
        muscle.K * scale * (1.0 + 2.0 * muscle.position_slope * x + 3.0 * muscle.hardening * x**2)
    )
    # The torque of the arc is unity at rest times its drive, so the areas of both are equal.
    stretch = np.sum(np.maximum(np.diff(foot), 0.0)) * done.rate
    reflex_scale = done.course.reflex_scale[part]
    gain = reflex.G * float(np.sum(reflex_scale * done.motion.drive[part])) / stretch
    return TrueImpedance(
        slope + weight_stiffness(trial),
        muscle.B * scale,
        rig.foot_inertia + rig.plate_inertia,
        gain + reflex.late_G * float(np.mean(reflex_scale)),
    )


def weight_stiffness(trial: Trial) -> float:
    """Return the slope of the foot's weight against its angle [N.m/rad]."""
    rig, angle = trial.setup.rig, trial.operating_angle
    return (
        rig.foot_mass
        * 9.81
        * (rig.foot_below * math.cos(angle) - rig.foot_forward * math.sin(angle))
    )
