"""Whether the torque stands at the end of a sensor's range, below the noise that is added to it.

A converter that can show no more gives equal values, which `ankle_interfaces.saturation` finds.
Where a sensor or its amplifier can give no more, the noise of what follows is added: the torque
stays within that noise of one value. The torque of a joint that is held may do so, too. So only
samples in which the plate moves count, at speeds that differ.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.joint_profile import joint_in_force

# [s] Over which the plate's speed is measured, about a sample.
_AROUND_S = 0.005
# Of the fastest movements: below it the plate rests, or nearly.
MOVING_SHARE = 0.1
# Bands at the end, as shares of the torque's range: from below a sensor's noise to a thirtieth. In
# 60 recordings of two engines wider ones held the peaks of equal pulses.
BANDS = np.geomspace(1e-3, 1.0 / 30.0, 25)
# The samples in such a band over those in the next one inwards. About the smooth peak of a response
# there are 2.4 times as many; in those 60 recordings up to 3.0, and 8.2 where torque was cut.
LEAST_PILE = 5.0
# Of the moving samples: fewer are a few peaks.
LEAST_SHARE = 0.02
# Standard deviation over mean of the speeds there. At one speed viscosity and friction hold the
# torque at one value, too.
LEAST_SPEED_VARIATION = 0.25
# Samples beyond the end, which noise makes.
_BEYOND = 1e-4


def range_sentences(torque: np.ndarray, position: np.ndarray, rate: float) -> list[str]:
    """Return a sentence for each end at which the torque stands while the plate moves.

    Parameters
    ----------
    torque
        As it was recorded [N.m, or the unit of the joint in force], shape (n,).
    position
        Of the plate [rad, or the unit of the joint in force], shape (n,).
    rate
        Of both [Hz].
    """
    around = max(1, int(_AROUND_S * rate))
    speed = np.abs(position[2 * around :] - position[: -2 * around])
    moving = speed > MOVING_SHARE * np.quantile(speed, 0.99)
    if not moving.any():
        return []
    unit, found = joint_in_force().torque_unit, []
    for side, sign in (("upper", 1.0), ("lower", -1.0)):
        inward = -sign * torque[around:-around]
        band = _end_of(inward[moving])
        if band is None:
            continue
        at_end = inward < band
        there = speed[moving & at_end]
        if np.std(there) > LEAST_SPEED_VARIATION * np.mean(there):
            found.append(
                f"torque is saturated: {100 * np.mean(at_end):.1f} % of the samples stand at its "
                f"{side} end, about {-sign * np.median(inward[at_end]):.3g} {unit}, also while the "
                "plate moves, and what was beyond it is lost: record again with a larger range or "
                "a lower gain"
            )
    return found


def _end_of(inward: np.ndarray) -> float | None:
    """Return up to which value a signal that rises from its end stands there; None where it does
    not.
    """
    ordered = np.sort(inward)
    edge = ordered[int(_BEYOND * len(ordered))]
    span = ordered[-1] - edge
    piles = {}
    for width in span * BANDS:
        first, second = np.searchsorted(ordered, [edge + width, edge + 2.0 * width])
        if first > LEAST_SHARE * len(ordered):
            piles[float(edge + width)] = first / max(second - first, 1)
    best = max(piles, key=lambda end: piles[end], default=None)
    return best if best is not None and piles[best] > LEAST_PILE else None
