"""Fixed magnitudes of each effect at three strengths, for studies that cannot search for them.

On the nominal subject (`anatomy.Setup`) they leave about 0.5, 2 and 6 % of the torque's variance
unexplained by the paper's model with the reflex' delay and dynamics held; where the effect's range
ends before that, the values spread over the range. Strength differs between subjects.
"""

from __future__ import annotations

import numpy as np

from blind_rig import strength
from blind_rig.effects import EFFECTS_BY_NAME
from blind_rig.trial import Trial, run

# Weak, moderate, strong, in the unit of the effect's magnitude.
MAGNITUDES: dict[str, tuple[float, float, float]] = {
    "strap": (2450.0, 1400.0, 400.0),
    "strap_backlash": (0.0009, 0.004, 0.010),
    "bearing_friction": (0.6, 1.3, 2.4),
    "soft_shaft": (82.0, 68.0, 58.0),
    "torque_sensor_mode": (84.0, 73.0, 66.0),
    "torque_delay": (0.0016, -0.0035, 0.0075),
    "torque_lag": (0.002, 0.006, 0.012),
    "position_gain": (0.05, 0.10, 0.20),
    "encoder_backlash": (0.0025, 0.005, 0.0095),
    "maxwell": (18.0, 37.0, 63.0),
    "short_range_stiffness": (92.0, 185.0, 320.0),
    "thixotropy": (250.0, 420.0, 800.0),
    "tissue_friction": (1.5, 3.0, 4.0),
    "position_stiffness": (10.0, 20.0, 30.0),
    "hardening": (360.0, 720.0, 1240.0),
    "asymmetric_damping": (0.3, 0.6, 1.0),
    "tendon": (0.028, 0.046, 0.077),
    "stiffness_follows_torque": (1.65, 3.3, 5.7),
    "fatigue": (0.26, 0.53, 0.85),
    "tremor": (0.13, 0.27, 0.46),
    "reflex_threshold": (0.24, 0.51, 0.81),
    "reflex_exponent": (0.7, 1.7, 3.0),
    "reflex_saturation": (0.45, 0.2, 0.09),
    "reflex_depression": (40.0, 100.0, 200.0),
    "reflex_position": (40.0, 80.0, 120.0),
    "reflex_follows_torque": (3.0, 6.0, 12.0),
    "antagonist_reflex": (1.5, 3.0, 6.0),
    "late_reflex": (1.5, 3.0, 6.0),
    "length_reflex": (15.0, 31.0, 53.0),
    "foot_sliding": (0.44, 0.66, 0.9),
    "heel_lift": (0.7, 1.1, 1.5),
    "startle_stiffening": (0.24, 0.47, 0.82),
    "reflex_bouts": (0.26, 0.51, 0.89),
    "wandering_delay": (0.006, 0.010, 0.015),
    "mains_pickup": (0.09, 0.19, 0.32),
    "coarse_torque": (0.37, 0.69, 1.3),
    "cable_resonance": (0.1, 0.2, 0.35),
    "gear_error": (0.0005, 0.001, 0.0015),
}
# Motion on which a subject's gain is made up for what a nonlinear reflex takes [s].
COMPENSATION_DURATION = 8.0


def brought_in(trial: Trial, effect: str, level: str) -> Trial:
    """Return the trial with an effect at one of `strength.STRENGTHS`.

    Parameters
    ----------
    trial
        Without effects.
    effect
        Name of the effect.
    level
        ``weak``, ``moderate`` or ``strong``.

    Raises
    ------
    KeyError
        No such effect or strength.
    """
    known = EFFECTS_BY_NAME[effect]
    magnitude = MAGNITUDES[effect][list(strength.STRENGTHS).index(level)]
    changes = {path: float(np.mean(limits)) for path, limits in known.shape.items()}
    changes[known.magnitude] = magnitude
    if known.keeps_reflex:
        without = run(trial, COMPENSATION_DURATION)
        changes["reflex.G"] = strength.compensating_gain(trial, changes, without)
    return trial._replace(setup=trial.setup.replaced(changes))
