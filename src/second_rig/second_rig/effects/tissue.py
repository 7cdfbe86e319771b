"""What tissue and muscle may hold beside the joint's elasticity, all with memory."""

from __future__ import annotations

import numpy as np

from second_rig.drawing import evenly
from second_rig.effects.effect import Change, Effect
from second_rig.subject import Subject


def relaxation(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw three Maxwell arms; the strength is their scale in units of K [1].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    times = [evenly(generator, *limits) for limits in ((0.03, 0.08), (0.25, 0.6), (2.0, 5.0))]
    weights = [evenly(generator, 0.3, 1.0) for _ in times]

    def change(strength: float) -> Change:
        arms = range(len(times))
        stiffness = {
            f"relaxation.stiffness_{arm + 1}": strength * weights[arm] * subject.K for arm in arms
        }
        return Change(stiffness | {f"relaxation.time_{arm + 1}": times[arm] for arm in arms})

    return Effect(
        "viscoelastic relaxation in the joint (three Maxwell arms beside K)",
        "T += sum k_i (x - y_i); y_i' = (x - y_i)/tau_i",
        change,
        0.2,
        0.01,
        1.2,
        {"tau": times, "weights": weights},
    )


def friction(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw friction of LuGre; the strength is the torque of sliding [N.m].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    travel = evenly(generator, 0.0015, 0.004)
    ratio = evenly(generator, 1.1, 1.4)
    velocity = evenly(generator, 0.05, 0.2)

    def change(strength: float) -> Change:
        return Change(
            {
                "friction.torque": strength,
                "friction.bristle_travel": travel,
                "friction.breakaway_ratio": ratio,
                "friction.stribeck_velocity": velocity,
            }
        )

    return Effect(
        "friction in the joint (LuGre)",
        "z' = v - s0 |v| z/g(v); g = Fc (1 + (Fs/Fc - 1) exp(-(v/vs)^2)); s0 = Fc/zb; T += s0 z",
        change,
        0.6,
        0.05,
        2.5,
        {"zb": travel, "Fs_ratio": ratio, "vs": velocity},
    )


def slip_elements(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw springs with sliders; the strength is the torque at which all slide [N.m].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    stiffness = evenly(generator, 120.0, 300.0)

    def change(strength: float) -> Change:
        return Change({"slip_elements.torque": strength, "slip_elements.stiffness": stiffness})

    return Effect(
        "dry friction in the tissue (8 parallel Jenkins elements)",
        "T += sum sat_j; limits f_j = F (0.25 + 0.5 j)/16; total initial stiffness F k",
        change,
        0.6,
        0.05,
        2.5,
        {"k": stiffness},
    )


def cross_bridges(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw cross-bridges; the strength is their stiffness, all attached, in units of K [1].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    drawn = {
        "cross_bridges.attachment": evenly(generator, 6.0, 12.0),
        "cross_bridges.detachment": evenly(generator, 1.5, 4.0),
        "cross_bridges.forced_detachment": evenly(generator, 10.0, 40.0),
        "cross_bridges.critical_extension": evenly(generator, 0.008, 0.018),
    }

    def change(strength: float) -> Change:
        return Change(drawn | {"cross_bridges.stiffness": strength * subject.K})

    return Effect(
        "short-range stiffness (two-moment cross-bridge population)",
        "T += ks N x; x' = v - x f (1 - N)/N; N' = f (1 - N) - (g0 + g1 (x/xc)^2) N",
        change,
        1.0,
        0.05,
        5.0,
        drawn,
    )
