"""Effects that a case may hide: which number of the setup carries the effect, how far it may go,
what else it needs.

`KNOWN_EFFECTS` are effects that the field's literature describes, and that a diagnosis should be
able to name. `UNKNOWN_EFFECTS` are effects that a library of such terms is unlikely to hold: the
right answer to them is that they are not explained, and where they sit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Effect(NamedTuple):
    """Describes one effect and the number of the setup that carries it.

    Attributes
    ----------
    name
        Of the truth, not of anybody's library.
    place
        In the signal path: intrinsic, reflex input, reflex dynamics, activation, coupling,
        actuator, position sensor, torque sensor.
    magnitude
        Path of the number in `anatomy.Setup` that scales the effect.
    ranges
        (weakest, strongest) values of it; one pair is drawn. Descending where a smaller number is
        more.
    shape
        Other numbers that belong to it and the ranges they are drawn from.
    slow
        Plays on the scale of the whole trial, so that its strength cannot be judged on a part.
    keeps_reflex
        The subject's gain makes up for what the effect takes, so that the reflex torque stays as
        large as without it.
    protocols
        Under which it shows at all; empty is all of them.
    levels
        Magnitudes for weak, moderate and strong where the torque's variance says nothing about the
        effect.
    needs
        Columns or topics that the bag must have for the effect to show at all.
    source
        Who described it, or what it is.
    """

    name: str
    place: str
    magnitude: str
    ranges: tuple[tuple[float, float], ...]
    shape: dict[str, tuple[float, float]] = {}  # noqa: RUF012
    slow: bool = False
    keeps_reflex: bool = False
    protocols: tuple[str, ...] = ()
    levels: tuple[float, float, float] = ()  # type: ignore[assignment]
    needs: tuple[str, ...] = ()
    source: str = ""


# Stretches of one size and rise time tell nothing about how the reflex depends on velocity.
MIXED_VELOCITIES = ("random_levels",)

KNOWN_EFFECTS: tuple[Effect, ...] = (
    Effect(
        "strap",
        "coupling",
        "rig.strap_k",
        ((20000.0, 80.0),),
        {"rig.strap_b": (0.3, 1.5)},
        source="foot fixed by straps over soft tissue (de Vlugt 2003; Schouten 2008)",
    ),
    Effect(
        "strap_backlash",
        "coupling",
        "rig.strap_gap",
        ((0.0002, 0.02),),
        {"rig.strap_k": (500.0, 900.0), "rig.strap_b": (0.5, 1.5)},
        source="foot free on its pad between hard stops",
    ),
    Effect(
        "bearing_friction",
        "actuator",
        "rig.bearing_friction",
        ((0.01, 3.0),),
        source="dry friction of the plate's bearing",
    ),
    Effect(
        "soft_shaft",
        "actuator",
        "rig.cell_hz",
        ((500.0, 25.0),),
        {"rig.cell_zeta": (0.03, 0.10), "rig.encoder_on_motor": (1.0, 1.0)},
        source="elastic shaft between encoder and foot",
    ),
    Effect(
        "torque_sensor_mode",
        "torque sensor",
        "sensors.mode_hz",
        ((500.0, 35.0),),
        {"sensors.mode_zeta": (0.02, 0.10)},
        source="lightly damped load cell",
    ),
    Effect(
        "torque_delay",
        "torque sensor",
        "sensors.torque_delay",
        ((0.0002, 0.015), (-0.0002, -0.015)),
        source="channels sampled apart",
    ),
    Effect(
        "torque_lag",
        "torque sensor",
        "sensors.torque_lag",
        ((0.0002, 0.015),),
        source="low-pass in the torque amplifier",
    ),
    Effect(
        "position_gain",
        "position sensor",
        "sensors.position_gain",
        ((0.03, 0.25), (-0.03, -0.25)),
        levels=(0.05, 0.10, 0.20),
        needs=("velocity", "reference"),
        source="calibration error of the encoder; shows against tachometer and reference only",
    ),
    Effect(
        "encoder_backlash",
        "position sensor",
        "sensors.encoder_backlash",
        ((0.0002, 0.015),),
        source="backlash between shaft and encoder",
    ),
    Effect(
        "gear_error",
        "position sensor",
        "sensors.gear_error",
        ((0.00005, 0.0015),),
        {"sensors.gear_pitch": (0.02, 0.05), "sensors.gear_skewness": (0.0, 0.2)},
        source="kinematic error of strain wave gears (Tuttle & Seering 1996)",
    ),
    Effect(
        "maxwell",
        "intrinsic",
        "muscle.maxwell_k",
        ((1.0, 400.0),),
        {"muscle.maxwell_tau": (0.03, 0.30)},
        source="stress relaxation (Fung 1993; Kirsch & Kearney 1997)",
    ),
    Effect(
        "short_range_stiffness",
        "intrinsic",
        "muscle.bridge_k",
        ((1.0, 600.0),),
        {"muscle.bridge_yield": (0.003, 0.010), "muscle.bridge_recovery": (0.1, 0.5)},
        source="Rack & Westbury 1974; Kirsch, Boskov & Rymer 1994; Loram 2007",
    ),
    Effect(
        "thixotropy",
        "intrinsic",
        "muscle.thixotropy_k",
        ((1.0, 800.0),),
        {"muscle.thixotropy_break": (0.005, 0.02), "muscle.thixotropy_set": (0.2, 1.0)},
        source="Lakie & Robson 1988; Proske 1993",
    ),
    Effect(
        "tissue_friction",
        "intrinsic",
        "muscle.hysteresis_torque",
        ((0.01, 4.0),),
        {"muscle.hysteresis_travel": (0.001, 0.008)},
        source="Dahl friction of tissues",
    ),
    Effect(
        "position_stiffness",
        "intrinsic",
        "muscle.position_slope",
        ((0.2, 30.0),),
        source="stiffness rises with dorsiflexion (Weiss 1986)",
    ),
    Effect(
        "hardening",
        "intrinsic",
        "muscle.hardening",
        ((10.0, 6000.0),),
        source="passive tissue hardens with stretch (Riener & Edrich 1999)",
    ),
    Effect(
        "asymmetric_damping",
        "intrinsic",
        "muscle.damping_asymmetry",
        ((0.01, 1.0), (-0.01, -1.0)),
        source="Hill: lengthening is not shortening",
    ),
    Effect(
        "tendon",
        "intrinsic",
        "muscle.tendon_share",
        ((0.003, 0.85),),
        {"muscle.contractile_b": (2.0, 12.0)},
        source="Achilles tendon in series with the contractile part (Loram & Lakie 2002: as "
        "compliant as the muscle, and more)",
    ),
    Effect(
        "stiffness_follows_torque",
        "activation",
        "courses.stiffness_follows",
        ((0.1, 8.0),),
        slow=True,
        source="Hunter & Kearney 1982; Weiss 1988",
    ),
    Effect(
        "fatigue",
        "activation",
        "courses.fatigue",
        ((0.02, 0.85),),
        slow=True,
        source="contractile properties decline within minutes",
    ),
    Effect(
        "tremor",
        "activation",
        "courses.tremor_rms",
        ((0.01, 1.5),),
        {"courses.tremor_hz": (7.0, 11.0)},
        source="physiological tremor",
    ),
    Effect(
        "reflex_threshold",
        "reflex input",
        "reflex.threshold",
        ((0.02, 1.5),),
        keeps_reflex=True,
        protocols=MIXED_VELOCITIES,
        source="velocity threshold (Stein & Kearney 1995)",
    ),
    Effect(
        "reflex_exponent",
        "reflex input",
        "reflex.exponent",
        ((1.03, 3.5), (0.97, 0.1)),
        keeps_reflex=True,
        protocols=MIXED_VELOCITIES,
        source="spindle power law (Houk 1981)",
    ),
    Effect(
        "reflex_saturation",
        "reflex input",
        "reflex.saturation",
        ((10.0, 0.05),),
        keeps_reflex=True,
        protocols=MIXED_VELOCITIES,
        source="recruitment saturates (Stein & Kearney 1995)",
    ),
    Effect(
        "reflex_depression",
        "reflex dynamics",
        "reflex.depression",
        ((0.5, 200.0),),
        {"reflex.depression_recovery": (0.3, 1.5)},
        keeps_reflex=True,
        source="post-activation depression (Hultborn 1996)",
    ),
    Effect(
        "reflex_position",
        "reflex dynamics",
        "reflex.position_gain",
        ((1.0, 120.0),),
        source="reflex gain rises with dorsiflexion (Mirbagheri 2000)",
    ),
    Effect(
        "reflex_follows_torque",
        "activation",
        "courses.reflex_follows",
        ((0.2, 14.0),),
        slow=True,
        source="automatic gain (Matthews 1986)",
    ),
    Effect(
        "antagonist_reflex",
        "reflex dynamics",
        "reflex.antagonist_G",
        ((0.2, 25.0),),
        {"reflex.antagonist_delay": (0.038, 0.055)},
        source="tibialis anterior stretch reflex",
    ),
    Effect(
        "late_reflex",
        "reflex dynamics",
        "reflex.late_G",
        ((0.2, 25.0),),
        {"reflex.late_delay": (0.080, 0.120)},
        source="Petersen 1998",
    ),
    Effect(
        "length_reflex",
        "reflex input",
        "reflex.length_G",
        ((1.0, 150.0),),
        source="spindle secondaries (Houk & Rymer 1981)",
    ),
)

UNKNOWN_EFFECTS: tuple[Effect, ...] = (
    Effect(
        "foot_sliding",
        "coupling",
        "interface.slide_share",
        ((0.02, 0.9),),
        {"interface.slide_velocity": (0.02, 0.2)},
        source="the foot slides over on its plate: more inertia on the way up",
    ),
    Effect(
        "heel_lift",
        "coupling",
        "interface.lift_share",
        ((0.02, 1.5),),
        {"interface.lift_angle": (0.006, 0.010), "interface.lift_return": (0.001, 0.004)},
        source="the heel lets go beyond an angle and sticks later",
    ),
    Effect(
        "startle_stiffening",
        "activation",
        "courses.startle_share",
        ((0.05, 5.0),),
        {"courses.startle_chance": (0.2, 0.5)},
        slow=True,
        source="co-contraction after some movements, at random",
    ),
    Effect(
        "reflex_bouts",
        "reflex dynamics",
        "courses.burst_share",
        ((0.05, 1.0),),
        slow=True,
        source="habituation in random bouts",
    ),
    Effect(
        "wandering_delay",
        "reflex dynamics",
        "courses.delay_wander",
        ((0.0005, 0.015),),
        slow=True,
        source="excitability wanders",
    ),
    Effect(
        "mains_pickup",
        "torque sensor",
        "sensors.mains",
        ((0.02, 4.0),),
        source="50 Hz modulated by activity",
    ),
    Effect(
        "coarse_torque",
        "torque sensor",
        "sensors.torque_step",
        ((0.02, 3.0),),
        source="quantisation with hysteresis",
    ),
    Effect(
        "cable_resonance",
        "torque sensor",
        "sensors.cable",
        ((0.01, 20.0),),
        {"sensors.cable_hz": (12.0, 30.0), "sensors.cable_zeta": (0.03, 0.15)},
        source="a cable swings with the square of the velocity and pulls on the cell",
    ),
)

EFFECTS_BY_NAME = {effect.name: effect for effect in (*KNOWN_EFFECTS, *UNKNOWN_EFFECTS)}


def draw_shape(
    effect: Effect, generator: np.random.Generator
) -> tuple[dict[str, float], tuple[float, float]]:
    """Return numbers that go with the effect, drawn, and the (weakest, strongest) magnitude of one
    of its variants.
    """
    shape = {path: float(generator.uniform(*limits)) for path, limits in effect.shape.items()}
    return shape, effect.ranges[int(generator.integers(len(effect.ranges)))]
