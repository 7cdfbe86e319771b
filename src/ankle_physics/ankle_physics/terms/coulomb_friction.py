"""Coulomb friction of the footplate: ``torque = F * tanh((v + T * a) / v0)``, its v and a."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Owner, Parameter, Place, State, Term, Values

# The same curve over a wider range of speeds is no dry friction: it is a damping that weakens with
# speed (`saturating_damping`), whose range begins here.
FASTEST_CHANGE = 0.05  # rad/s
# A tenth of the velocity noise of the paper's encoder: what changes within less is not told apart.
SLOWEST_CHANGE = 0.003  # rad/s
# Half of the shortest edge of a movement that rigs make, 24 ms: friction that led by more would act
# before the movement does.
LONGEST_LEAD = 0.012  # s
# A velocity that changes by less within a sample is constant: below any v0 by three powers of ten,
# above the rounding of the difference between two logarithms by as many.
LEAST_CHANGE = 3e-6  # rad/s


class CoulombFriction(Term):
    """Models the dry friction of footplate bearings and seals; v0 rounds the jump at rest so that
    noise does not switch it. Friction at rest opposes what is about to move the plate, and so turns
    T before the velocity does.

    The torque sensor feels it in front of the straps: it follows the plate's velocity, not the
    foot's. Models of friction are compared by Armstrong-Hélouvry, Dupont & Canudas de Wit 1994
    (Automatica 30, 1083); that at rest is Karnopp's (1985, J. Dyn. Syst. Meas. Control 107, 100).
    """

    name = "coulomb_friction"
    place = Place.COUPLING
    belongs_to = Owner.RIG
    rest_torque = "F"
    turned_by = "friction_turning"
    family = "intrinsic memory"
    separated_by = "slow triangular movements of several sizes"
    sentence = "A constant torque opposes every movement, however fast: dry friction."
    parameters = (
        Parameter(
            "F",
            "N.m",
            0.0,
            10.0,
            0.5,
            "bearings and seals of ankle rigs: below 2 N.m",
            description="It is the torque with which friction opposes the movement of the plate.",
            linear=True,
        ),
        Parameter(
            "v0",
            "rad/s",
            SLOWEST_CHANGE,
            FASTEST_CHANGE,
            0.03,
            "from a tenth of the velocity noise of the paper's encoder to a speed that most "
            "movements of an ankle exceed; beyond it, damping levels off",
            description=(
                "It is the speed within which the friction changes its direction gradually."
            ),
        ),
        Parameter(
            "T",
            "s",
            -LONGEST_LEAD,
            LONGEST_LEAD,
            0.0,
            "0 where the friction follows the velocity; at rest it balances the force that would "
            "move the plate, before the velocity tells; a seal that shears turns later",
            description="It is the time by which the friction turns before the velocity does.",
            tried=(0.0,),
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"F": direction(signals, float(values["v0"]), float(values["T"]))}

    @classmethod
    def drag(cls, values: Values, velocity: float) -> float:
        size, rounding = (float(np.ravel(values[symbol])[0]) for symbol in ("F", "v0"))
        return size * steepness(velocity, rounding)


def direction(
    signals: Signals, rounding: float | np.ndarray, lead: float | np.ndarray
) -> np.ndarray:
    """Return the direction of the plate's movement as friction has it, -1...1.

    It turns within a sample, so that its mean over each sample is taken, of a velocity that changes
    evenly. The integral of tanh is ln cosh.

    Parameters
    ----------
    signals
        Of n samples.
    rounding, lead
        v0 [rad/s] and T [s], a number each, or several of shape (k, 1).

    Returns
    -------
    np.ndarray
        [1], shape (n,), or (k, n).
    """
    turning = signals.velocity + lead * signals.acceleration
    change = np.maximum(np.abs(signals.acceleration) / (2.0 * signals.rate), LEAST_CHANGE)
    later, sooner = (
        _log_cosh((turning + change) / rounding),
        _log_cosh((turning - change) / rounding),
    )
    return np.asarray(rounding * (later - sooner) / (2.0 * change))


def steepness(velocity: float, rounding: float) -> float:
    """Return the slope of the direction over the velocity [s/rad] at one [rad/s]; it turns within
    the rounding [rad/s].
    """
    return float((1.0 - np.tanh(velocity / rounding) ** 2) / rounding)


def _log_cosh(x: np.ndarray) -> np.ndarray:
    """Return ln(cosh x), but for a constant, at any x."""
    size = np.abs(x)
    return np.asarray(size + np.log1p(np.exp(-2.0 * size)))
