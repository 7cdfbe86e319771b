"""The slow torque that belongs to a surrogate of a recording's noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from model_discrepancy.fit.reflex_variation import reflex_variation
from model_discrepancy.problem import Problem
from model_discrepancy.recording.motion import ACTIVATION_HZ
from model_discrepancy.recording.spectrum import low_pass
from model_discrepancy.search.null import STRETCH_S, Null


def surrogate_activation(problem: Problem, null: Null) -> Callable[[int], np.ndarray]:
    """Return the slow torque that belongs to each surrogate of a recording's noise.

    A reflex that varies from stretch to stretch is a part of the slow torque, and changes sign with
    the surrogate; the rest of it does not, nor does activation that follows from EMG.

    Parameters
    ----------
    problem
        Of the recording.
    null
        With its surrogates.

    Returns
    -------
    Callable[[int], np.ndarray]
        From the number of a surrogate to slow torque [N.m], shape (samples,).
    """
    rows, motion = problem.fitter.rows, problem.fitter.motion
    varying = np.zeros(rows.count)
    if not problem.activation_by_emg:
        varying = reflex_variation(problem.fitter, problem.base).torque
    slow = low_pass(np.fft.rfftfreq(rows.count, 1.0 / rows.rate), ACTIVATION_HZ, 4)

    def activation(draw: int) -> np.ndarray:
        signs = null.signs[(rows.time / STRETCH_S).astype(int), draw]
        changed = (signs - 1.0) * varying
        leaked = np.fft.irfft(np.fft.rfft(changed) * slow, rows.count)
        return np.asarray(motion.activation + np.interp(motion.time, rows.time, leaked))

    return activation
