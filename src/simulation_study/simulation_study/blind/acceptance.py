"""Names of the diagnosis' library that count as the right answer to a hidden effect.

The rig's physics is not the library's: a MuJoCo strap has its own mass behind it, a cable its own
law. A name counts when it says the same physics, or when no perturbation of a recording of that
kind can tell the two apart. These tables belong to the adversary; the diagnosing side does not see
them.
"""

from __future__ import annotations

from typing import NamedTuple


class Answer(NamedTuple):
    """Describes what counts as naming an effect.

    Attributes
    ----------
    names
        Names of library terms, the plainest first.
    reason
        Why the further ones count.
    parameters
        Number of the rig -> (library term, its parameter, factor on the rig's number) where both
        mean the same.
    """

    names: tuple[str, ...]
    reason: str = ""
    parameters: dict[str, tuple[str, str, float]] = {}  # noqa: RUF012


# What every subject has is measured as variability and is no mismatch: hidden effect -> key of the
# verdict's ``variability``.
VARIABILITY = {"tremor": "tremor"}

ANSWERS: dict[str, Answer] = {
    "strap": Answer(
        ("fixation_compliance",),
        "straps in series with the joint",
        {
            "rig.strap_k": ("fixation_compliance", "k_s[N.m/rad]", 1.0),
            "rig.strap_b": ("fixation_compliance", "b_s[N.m.s/rad]", 1.0),
        },
    ),
    "strap_backlash": Answer(
        ("fixation_stops", "fixation_compliance", "backlash"),
        "a soft pad inside the gap, stops outside: both halves are true",
    ),
    "bearing_friction": Answer(
        ("coulomb_friction", "dahl_hysteresis"),
        "dry friction; Dahl's law with a short travel is the same",
        {"rig.bearing_friction": ("coulomb_friction", "F[N.m]", 1.0)},
    ),
    "soft_shaft": Answer(
        ("fixation_compliance", "torque_sensor_mode"),
        "a spring between encoder and foot, whichever side of the cell it is on, is a compliance "
        "with a lightly damped mode",
    ),
    "torque_sensor_mode": Answer(
        ("torque_sensor_mode",),
        "",
        {
            "sensors.mode_hz": ("torque_sensor_mode", "frequency[Hz]", 1.0),
            "sensors.mode_zeta": ("torque_sensor_mode", "damping[1]", 1.0),
        },
    ),
    "torque_delay": Answer(
        ("channel_skew", "torque_sensor_lag"),
        "a lag and a delay of a few milliseconds agree below 80 Hz",
        {"sensors.torque_delay": ("channel_skew", "skew[s]", 1.0)},
    ),
    "torque_lag": Answer(
        ("torque_sensor_lag", "channel_skew"),
        "a lag and a delay of a few milliseconds agree below 80 Hz",
        {"sensors.torque_lag": ("torque_sensor_lag", "T[s]", 1.0)},
    ),
    "position_gain": Answer(
        ("channel_gain", "gain_error", "position_gain", "sensor_gain"),
        "one thing, whatever it is called",
    ),
    "encoder_backlash": Answer(
        ("backlash",), "", {"sensors.encoder_backlash": ("backlash", "gap[rad]", 1.0)}
    ),
    "gear_error": Answer(
        ("cyclic_angle_error",),
        "",
        {"sensors.gear_pitch": ("cyclic_angle_error", "p[rad]", 1.0)},
    ),
    "maxwell": Answer(
        ("maxwell_relaxation", "fractional_damping"),
        "one relaxation with finite data is also a fractional element",
        {
            "muscle.maxwell_k": ("maxwell_relaxation", "k[N.m/rad]", 1.0),
            "muscle.maxwell_tau": ("maxwell_relaxation", "T[s]", 1.0),
        },
    ),
    "short_range_stiffness": Answer(
        ("short_range_stiffness", "dahl_hysteresis", "thixotropy"),
        "elastic, then yielding: with Dahl's smooth corner, or with bonds that re-form at rest",
        {
            "muscle.bridge_k": ("short_range_stiffness", "k[N.m/rad]", 1.0),
            "muscle.bridge_yield": ("short_range_stiffness", "yield[rad]", 1.0),
        },
    ),
    "thixotropy": Answer(
        ("thixotropy", "short_range_stiffness"),
        "bonds that break with travel and re-form at rest; the same as bridges that yield when "
        "rests are alike",
    ),
    "tissue_friction": Answer(
        ("dahl_hysteresis", "coulomb_friction", "short_range_stiffness"),
        "friction that builds up over a travel: Coulomb for a short travel, yielding "
        "cross-bridges with slow recovery",
        {"muscle.hysteresis_torque": ("dahl_hysteresis", "F[N.m]", 1.0)},
    ),
    "position_stiffness": Answer(
        ("position_dependent_stiffness", "hardening_stiffness"), "both bend the static curve"
    ),
    "hardening": Answer(
        ("hardening_stiffness", "position_dependent_stiffness"), "both bend the static curve"
    ),
    "asymmetric_damping": Answer(("asymmetric_damping",), ""),
    "tendon": Answer(
        ("maxwell_relaxation", "fractional_damping", "fixation_compliance"),
        "a viscous muscle behind a spring is exactly a Maxwell element beside a spring; the term "
        "'tendon' is a lag of the spindles' drive and no spring",
    ),
    "stiffness_follows_torque": Answer(("activation_stiffness",), ""),
    "fatigue": Answer(
        ("stiffness_drift", "reflex_drift"),
        "the rig lets stiffness, viscosity and reflex decline together",
    ),
    "tremor": Answer((), "a property of every subject, see `VARIABILITY`"),
    "reflex_threshold": Answer(
        ("reflex_threshold", "reflex_exponent"),
        "with few velocities a threshold and an exponent above 1 bend the curve alike",
        {"reflex.threshold": ("reflex_threshold", "vt[rad/s]", 1.0)},
    ),
    "reflex_exponent": Answer(
        ("reflex_exponent", "reflex_threshold", "reflex_saturation"),
        "an exponent above 1 bends like a threshold, below 1 like a saturation",
        {"reflex.exponent": ("reflex_exponent", "p[1]", 1.0)},
    ),
    "reflex_saturation": Answer(
        ("reflex_saturation", "reflex_exponent"),
        "an exponent below 1 levels off likewise",
        {"reflex.saturation": ("reflex_saturation", "vs[rad/s]", 1.0)},
    ),
    "reflex_depression": Answer(("reflex_depression",), ""),
    "reflex_position": Answer(("position_reflex_gain",), ""),
    "reflex_follows_torque": Answer(("activation_reflex_gain",), ""),
    "antagonist_reflex": Answer(
        ("antagonist_reflex",),
        "",
        {
            "reflex.antagonist_G": ("antagonist_reflex", "Ga[N.m.s/rad]", 1.0),
            "reflex.antagonist_delay": ("antagonist_reflex", "delay[s]", 1.0),
        },
    ),
    "late_reflex": Answer(
        ("long_latency_reflex",),
        "",
        {
            "reflex.late_G": ("long_latency_reflex", "Gl[N.m.s/rad]", 1.0),
            "reflex.late_delay": ("long_latency_reflex", "delay[s]", 1.0),
        },
    ),
    "length_reflex": Answer(
        ("position_reflex", "length_threshold_reflex"),
        "the same arc, whose threshold a movement may meet",
        {"reflex.length_G": ("position_reflex", "Gp[N.m/rad]", 1.0)},
    ),
}
