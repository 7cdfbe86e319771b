"""The stiffness that dry friction may imitate where the plate rests.

Friction may hold any torque up to its own once a movement has ended, and its equation gives none.
Where each angle is always reached from the same side, such torque cannot be told from that of a
spring. Where angles are reached from both sides, the recording tells how much is held.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import term_library
from ankle_physics.terms.coulomb_friction import CoulombFriction, direction
from model_discrepancy.fit.block_bootstrap import STRETCH_S
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter

# Of the friction: where more is held at rest for sure, the other values have bent to it, and the
# recording tells no bound.
LEAST_HELD = 0.1
# Standard errors of it that make it sure.
_SURE = 2.0
# The plate moves where friction has more than half of its size.
_MOVING = 0.5
_STIFFNESS = ("stiffness", "K")


def held_at_rest(moving: np.ndarray) -> np.ndarray:
    """Return what friction of unit size holds where the plate rests, if it holds all: the direction
    of the movement that has ended, and nothing while the plate moves.

    Parameters
    ----------
    moving
        Direction of the movement as friction has it, -1...1, shape (n,).

    Returns
    -------
    np.ndarray
        [1], shape (n,); nothing before the first movement.
    """
    moves = np.abs(moving) > _MOVING
    last = np.maximum.accumulate(np.where(moves, np.arange(len(moving)), -1))
    held = np.where(last >= 0, np.sign(moving[last]), 0.0)
    return np.asarray(held * (1.0 - np.abs(moving)))


def stiffness_of_friction_at_rest(fitter: Fitter, fit: Fit, step: float) -> float:
    """Return the standard error of K by the torque that friction may hold at rest [N.m/rad].

    Before the recording, any torque up to the friction is as probable, and all of it would be a
    spring. The recording tells less as far as it shows that nothing is held (a normal prior of that
    variance; its error from the scatter of stretches).

    Parameters
    ----------
    fitter
        Whose whitening applies.
    fit
        The final model.
    step
        Size of the movements [rad], over which all of the friction would be a spring.
    """
    library = term_library()
    frictions = [name for name in fit.terms if library[name].rest_torque]
    size = sum(fit.values[name][library[name].rest_torque] for name in frictions)
    spring = size / (np.sqrt(3.0) * step)
    if not size > 0.0:
        return 0.0
    derivatives, labels = fitter.derivatives(fit)
    if _STIFFNESS not in labels:
        return spring
    motion, rows = fitter.motion, fitter.rows
    # A friction of one's own may have other parameters: typical ones tell when it rests.
    values = {p.symbol: p.default for p in CoulombFriction.parameters} | fit.values[frictions[0]]
    signals = Signals(motion.rate, motion.position, motion.velocity, motion.acceleration)
    held = held_at_rest(direction(signals, values["v0"], values["T"]))
    used = rows.used
    column = rows.whitened(rows.spectrum(held))[used]
    slopes = np.linalg.lstsq(derivatives[used], column, rcond=None)[0]
    column = column - derivatives[used] @ slopes
    power = float(column @ column)
    if not power > 0.0:
        return spring
    stretch = (rows.time[used] / STRETCH_S).astype(int)
    score = np.bincount(stretch, column * fit.residual[used])
    found, variance = float(score.sum()) / power, float(score @ score) / power**2
    if abs(found) > max(LEAST_HELD * size, _SURE * np.sqrt(variance)):
        return spring
    before = size**2 / 3.0
    likely = found * before / (before + variance)
    left = before * variance / (before + variance)
    told = abs(float(slopes[labels.index(_STIFFNESS)])) * float(np.sqrt(likely**2 + left))
    return min(told, spring)
