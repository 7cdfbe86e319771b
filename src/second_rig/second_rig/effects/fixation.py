"""What may be between plate and foot: straps, a pad, or play."""

from __future__ import annotations

import numpy as np

from second_rig.drawing import evenly
from second_rig.effects.effect import Change, Effect
from second_rig.subject import Subject

# Scale of a pad's torque, at which its tangent stiffness has risen by about 40 % [N.m]: soft
# tissue of a foot under a few N.m is on the bend of its curve.
PAD_TORQUE = 4.0


def _plate_inertia(subject: Subject, generator: np.random.Generator) -> float:
    """Return what goes with the plate, of the inertia that the joint has without the effect."""
    return subject.I * evenly(generator, 0.25, 0.4)


def _coupled(plate: float, stiffness: float, damping: float) -> dict[str, float]:
    """Return the numbers of a foot that moves against the plate."""
    return {
        "fixation.compliant": 1.0,
        "fixation.plate_inertia": plate,
        "fixation.stiffness": stiffness,
        "fixation.damping": damping,
    }


def _damping(subject: Subject, plate: float, stiffness: float, ratio: float) -> float:
    """Return the damping of the foot on the fixation [N.m.s/rad], from its ratio [1]."""
    return 2.0 * ratio * float(np.sqrt((subject.I - plate) * stiffness))


def strap(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw straps; the strength is their compliance [rad/(N.m)].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    plate = _plate_inertia(subject, generator)
    ratio = evenly(generator, 0.1, 0.4)

    def change(strength: float) -> Change:
        stiffness = 1.0 / strength
        damping = _damping(subject, plate, stiffness, ratio)
        return Change(_coupled(plate, stiffness, damping))

    return Effect(
        "linear straps or soft tissue between footplate and foot",
        "Tc = kc (p - f) + dc (p' - f'); If f'' = Tc - Tjoint; T = Ip p'' + Tc",
        change,
        1 / 2500.0,
        1 / 12000.0,
        1 / 600.0,
        {"Ip": plate, "zeta": ratio},
    )


def pad(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a pad that stiffens with load; the strength is its compliance unloaded [rad/(N.m)].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    plate = _plate_inertia(subject, generator)
    ratio = evenly(generator, 0.15, 0.4)

    def change(strength: float) -> Change:
        stiffness = 1.0 / strength
        damping = _damping(subject, plate, stiffness, ratio)
        stiffening = {"fixation.stiffening_extension": PAD_TORQUE / stiffness}
        return Change(_coupled(plate, stiffness, damping) | stiffening)

    return Effect(
        "soft tissue between plate and foot that stiffens with load",
        "Tc = kc x0 sinh((p - f)/x0) + dc cosh((p - f)/x0) (p' - f'); x0 = 4 N.m/kc; "
        "If f'' = Tc - Tjoint",
        change,
        1 / 1500.0,
        1 / 9000.0,
        1 / 500.0,
        {"Ip": plate, "zeta": ratio},
    )


def backlash(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a foot that rattles in the plate; the strength is the play, side to side [rad].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    plate = _plate_inertia(subject, generator)
    stiffness = evenly(generator, 7000.0, 14000.0)
    ratio = evenly(generator, 0.3, 0.5)
    damping = _damping(subject, plate, stiffness, ratio)

    def change(strength: float) -> Change:
        return Change(_coupled(plate, stiffness, damping) | {"fixation.gap": strength})

    return Effect(
        "foot rattles in the plate (play, contact without adhesion)",
        "|p - f| < gap/2: Tc ~ 0, else kc (|p - f| - gap/2) sign + dc (p' - f'), no pull",
        change,
        0.0015,
        0.0008,
        0.006,
        {"Ip": plate, "kc": stiffness, "dc": damping},
    )
