"""Every effect by its identifier, and in which company recordings hide it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from second_rig.effects import damping, fixation, reflex, sensors, stiffness, tissue, unlisted
from second_rig.effects.effect import Effect
from second_rig.subject import Subject

Draw = Callable[[np.random.Generator, Subject, np.ndarray], Effect]

EFFECTS: dict[str, Draw] = {
    draw.__name__: draw
    for draw in (
        fixation.strap,
        fixation.pad,
        fixation.backlash,
        tissue.relaxation,
        tissue.friction,
        tissue.slip_elements,
        tissue.cross_bridges,
        stiffness.stiffness_rise,
        stiffness.hardening,
        stiffness.stiffness_drift,
        stiffness.cocontraction,
        reflex.gain_drift,
        reflex.reflex_threshold,
        reflex.reflex_saturation,
        reflex.reflex_exponent,
        reflex.reflex_fading,
        reflex.tonic_reflex,
        reflex.late_reflex,
        reflex.antagonist_reflex,
        damping.damping_direction,
        damping.shear_thinning,
        sensors.sensor_resonance,
        sensors.late_torque,
        sensors.mains_hum,
        sensors.unequal_gain,
        unlisted.tremor_reset,
        unlisted.spindle_slack,
        unlisted.air_cushion,
        unlisted.reflex_contraction,
    )
}
"""Draws an effect for a subject, from a generator and the time since the recording's start [s]."""

UNLISTED = ("tremor_reset", "spindle_slack", "air_cushion", "reflex_contraction")
"""Physics that nobody lists."""

PAIRS = (
    ("strap", "reflex_threshold"),
    ("mains_hum", "hardening"),
    ("slip_elements", "gain_drift"),
    ("shear_thinning", "late_reflex"),
    ("unequal_gain", "antagonist_reflex"),
    ("relaxation", "reflex_saturation"),
)
"""Two effects of one recording."""

ONLY_IN_PAIRS = frozenset(
    {"mains_hum", "hardening", "slip_elements", "shear_thinning", "unequal_gain"}
)
"""Effects that no recording hides alone: half of what a pair holds is then not known from others.
"""

SINGLE = tuple(name for name in EFFECTS if name not in ONLY_IN_PAIRS and name not in UNLISTED)
"""Effects that a recording hides alone."""
