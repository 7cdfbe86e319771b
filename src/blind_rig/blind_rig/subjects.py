"""Subjects and faultless rigs, drawn from the ranges that the literature reports for the healthy
ankle.
"""

from __future__ import annotations

import numpy as np

from blind_rig.anatomy import Setup

# Mirbagheri, Barbeau & Kearney 2000; Kearney, Stein & Parameswaran 1997; van 't Veld 2018 (K 100, B
# 0.63, I 0.0137, G 10, omega 21, z 0.8, delay 40 ms): low contraction levels, mid-range ankle. SNR:
# van 't Veld 2018 gives 52.7 / 37.7 / 24.1 dB, other rigs are better in torque.
RANGES: dict[str, tuple[float, float]] = {
    "muscle.K": (45.0, 170.0),
    "muscle.B": (0.4, 1.2),
    "reflex.G": (4.0, 15.0),
    "reflex.delay": (0.036, 0.050),
    "reflex.omega": (16.0, 30.0),
    "reflex.zeta": (0.6, 1.0),
    "rig.foot_inertia": (0.008, 0.015),
    "rig.plate_inertia": (0.002, 0.004),
    "rig.foot_mass": (0.8, 1.2),
    "rig.foot_forward": (0.04, 0.06),
    "rig.foot_below": (0.03, 0.04),
    "rig.drive_hz": (30.0, 60.0),
    "rig.drive_zeta": (0.65, 0.85),
    "courses.torque_level": (2.0, 8.0),
    "courses.voluntary_hz": (0.3, 1.0),
    "sensors.position_snr": (50.0, 56.0),
    "sensors.velocity_snr": (35.0, 42.0),
    "sensors.torque_snr": (24.0, 38.0),
}
# Force fluctuation of a steady contraction is 2 to 7 % of its level (Enoka et al. 2003).
FORCE_FLUCTUATION = (0.02, 0.07)
# Mean ankle angle of the trials, plate against horizontal [rad].
OPERATING_ANGLE = (0.0, 0.2)
SAMPLING_RATES = (1000.0, 2048.0)


def draw_subject(generator: np.random.Generator) -> Setup:
    """Return a subject and a rig without any effect; ranges in `RANGES`, drawn log-uniformly where
    they span more than a factor of 2.
    """
    changes = {}
    for path, (low, high) in RANGES.items():
        if low > 0 and high / low > 2 and not path.endswith("snr"):
            changes[path] = float(np.exp(generator.uniform(np.log(low), np.log(high))))
        else:
            changes[path] = float(generator.uniform(low, high))
    changes["courses.voluntary_rms"] = changes["courses.torque_level"] * float(
        generator.uniform(*FORCE_FLUCTUATION)
    )
    return Setup().replaced(changes)
