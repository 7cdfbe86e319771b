"""The stiffness of a model in the course of a recording."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.stiffness_course import courses_of_stiffness


def changes_stiffness(terms: Iterable[str]) -> bool:
    """Say whether one of these terms changes the stiffness in the course of a recording."""
    return not courses_of_stiffness().isdisjoint(terms)


def stiffness_in_time(fitter: Fitter, fit: Fit) -> np.ndarray:
    """Return the stiffness at each time [N.m/rad], shape (n,), at the columns' rate.

    Parameters
    ----------
    fitter
        Of the recording.
    fit
        A model with `stiffness`.
    """
    motion, library = fitter.motion, term_library()
    still = np.zeros(len(motion.position))
    total = still + fit.values["stiffness"]["K"]
    for name in (name for name in fit.terms if name in courses_of_stiffness()):
        values, term = fit.values[name], library[name]()
        angle = still + values["xc"] + 1.0
        away = Signals(motion.rate, angle, still, still, motion.activation, motion.cocontraction)
        torque = term.torque(away, values, term.start(motion.rate))
        total = total + np.sum([values[s] * column for s, column in torque.items()], axis=0)
    return np.asarray(total)
