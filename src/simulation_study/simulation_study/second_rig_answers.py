"""Names of the diagnosis' library that count as the right answer to an effect of `second_rig`.

A name counts when it says the same physics, or when no movement of such a recording tells the two
apart. Where the library holds no such term the effect has no answer: a name that is stated for it
is wrong, and of a pair only the other effect can be named.
"""

from __future__ import annotations

from simulation_study.blind.acceptance import ANSWERS, Answer

OF_SECOND_RIG: dict[str, Answer] = {
    "strap": ANSWERS["strap"],
    "pad": Answer(
        ("stiffening_fixation", "fixation_stops", "fixation_compliance"),
        "a pad is a compliance, its curve is nearly an exponential under load, and it ends like "
        "stops without load",
    ),
    "backlash": Answer(
        ("backlash", "fixation_stops"), "the skin that rubs in the gap is a soft pad between stops"
    ),
    "relaxation": ANSWERS["maxwell"],
    "friction": ANSWERS["tissue_friction"],
    "slip_elements": Answer(
        (
            "distributed_short_range_stiffness",
            "dahl_hysteresis",
            "coulomb_friction",
            "short_range_stiffness",
        ),
        "sliders that let go one after the other: with slow recovery, or with one smooth corner",
    ),
    "cross_bridges": Answer(
        (
            "short_range_stiffness",
            "distributed_short_range_stiffness",
            "dahl_hysteresis",
            "thixotropy",
        ),
        "elastic, then yielding, and bonds that form anew at rest",
    ),
    "stiffness_rise": ANSWERS["position_stiffness"],
    "hardening": ANSWERS["hardening"],
    "stiffness_drift": Answer(
        ("settling_stiffness", "stiffness_drift"), "a drift that has not settled is a steady one"
    ),
    "cocontraction": Answer(
        ("cocontraction", "activation_stiffness"),
        "the bouts change the torque that is held with the stiffness",
    ),
    "gain_drift": Answer(("reflex_drift",)),
    "reflex_threshold": ANSWERS["reflex_threshold"],
    "reflex_saturation": ANSWERS["reflex_saturation"],
    "reflex_exponent": Answer(
        ("reflex_exponent", "reflex_saturation"), "an exponent below 1 levels off likewise"
    ),
    "reflex_fading": ANSWERS["reflex_depression"],
    "tonic_reflex": ANSWERS["length_reflex"],
    "late_reflex": ANSWERS["late_reflex"],
    "antagonist_reflex": ANSWERS["antagonist_reflex"],
    "damping_direction": ANSWERS["asymmetric_damping"],
    "shear_thinning": Answer(("saturating_damping",)),
    "sensor_resonance": Answer(
        ("torque_sensor_mode", "partial_sensor_mode"),
        "a mode of the whole torque is one of a part that is nearly all",
    ),
    "late_torque": ANSWERS["torque_delay"],
    "mains_hum": Answer(()),
    "unequal_gain": Answer(()),
    "tremor_reset": Answer(()),
    "spindle_slack": Answer(()),
    "air_cushion": Answer(()),
    "reflex_contraction": Answer(
        ("reflex_stiffening",), "the same muscle, stiffened by the contraction of its reflex"
    ),
}
"""What counts as naming each effect."""


def answers_of(effects: list[str] | tuple[str, ...]) -> list[list[str]]:
    """Return the names that answer each effect which the library holds.

    Parameters
    ----------
    effects
        Identifiers of `second_rig`.

    Raises
    ------
    KeyError
        Nobody has said what answers an effect.
    """
    return [list(OF_SECOND_RIG[name].names) for name in effects if OF_SECOND_RIG[name].names]
