"""An effect is brought to a strength in a recorded human trial, before it is planted there.

Its own magnitude is searched for, such as the threshold of a reflex or the stiffness of a strap,
and the torque that it adds then is taken as it is. Torque that is multiplied afterwards would be
that of no effect: a reflex with a threshold is not five times another reflex less four times the
one without.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from blind_rig.strength import STRENGTHS
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.base_model import fit_base
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.recording.motion import ACTIVATION_HZ, Motion, motion_of
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.spectrum import low_pass

# The planted torque is no larger than this, of the rms that the paper's model leaves of the trial.
# A term that shows less then, such as a drift of stiffness that mostly looks like slow torque, is
# no effect in this trial.
MOST_PLANTED_RMS = 2.0
# Magnitudes that are tried from the weakest to the strongest one, evenly on a logarithmic scale.
# Some effects hide again when they grow: a threshold above all velocities is no reflex at all.
SCAN_POINTS = 12
# Of the logarithm of the magnitude: about as exact as a subject's strength is known.
SEARCH_TOLERANCE = 0.02

# The torque that an effect of some magnitude adds [N.m], at the motion's rate, shape (n,).
AddedTorque = Callable[[float], np.ndarray]


class Planted(NamedTuple):
    """Holds a trial with an effect.

    Attributes
    ----------
    recording
        With the effect's torque.
    share
        Variance that the effect adds beyond what the paper's model could imitate and beyond slow
        torque, of the torque's variance [1]; both between 0.1 and 80 Hz.
    magnitude
        Of the effect, in its own unit.
    """

    recording: Recording
    share: float
    magnitude: float


@dataclass(frozen=True)
class MeasuredTrial:
    """Holds a recorded human trial in which effects are planted.

    Parameters
    ----------
    recording
        As it was measured.

    Attributes
    ----------
    motion
        Of the recording.
    base
        The paper's model, fitted to it.
    """

    recording: Recording
    motion: Motion = field(init=False, repr=False)
    base: Fit = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Fit the paper's model."""
        motion = motion_of(self.recording)
        object.__setattr__(self, "motion", motion)
        object.__setattr__(self, "base", fit_base(Fitter.of(motion)))

    @property
    def held_torque(self) -> np.ndarray:
        """Return the torque that the muscles hold [N.m], at the motion's rate, shape (n,): slow
        torque that the paper's model does not make of the movement.
        """
        slow = self.base.rows.slow(self.base.left, ACTIVATION_HZ)
        return float(np.mean(self.motion.torque)) + slow

    def unseen(self, added: np.ndarray) -> float:
        """Return the rms of what the paper's model cannot imitate of an added torque [N.m], beyond
        slow torque.

        Torque that looks like another stiffness or another reflex is no effect that anybody could
        see, nor is slow torque, which the subject of any trial makes.

        Parameters
        ----------
        added
            [N.m], at the motion's rate, shape (n,).
        """
        explained = self.motion.torque - self.base.rows.torque(self.base.left)
        alone = fit_base(Fitter.of(replace(self.motion, torque=explained + added)))
        rows = alone.rows
        faster = rows.band * (1.0 - low_pass(rows.frequency, ACTIVATION_HZ, 4))
        return float(np.std(rows.filtered(alone.left, faster)[rows.used]))

    def _rms(self, torque: np.ndarray) -> float:
        """Return the rms of a torque between 0.1 and 80 Hz [N.m]."""
        rows = self.base.rows
        return float(np.std(rows.plain(rows.spectrum(torque))[rows.used]))

    def planted(self, name: str, added: AddedTorque, weak: float, strong: float) -> Planted:
        """Return the trial with the torque of an effect, whose magnitude is such that its share is
        that of a moderate effect of the independent rig, or its torque `MOST_PLANTED_RMS` of what
        the paper's model leaves; of the magnitude that comes nearest where none does.

        Parameters
        ----------
        name
            Of the effect.
        added
            Its torque.
        weak, strong
            Its weakest and its strongest magnitude, of one sign.

        Raises
        ------
        DiagnosisError
            The effect changes no torque on this movement.
        """
        whole = self._rms(self.motion.torque)
        wanted = math.sqrt(STRENGTHS["moderate"]) * whole
        largest = MOST_PLANTED_RMS * float(np.std(self.base.plain[self.base.rows.used]))

        def strength(magnitude: float) -> float:
            torque = added(magnitude)
            return max(self.unseen(torque) / wanted, self._rms(torque) / largest)

        magnitude = reaching(strength, weak, strong)
        torque = added(magnitude)
        if np.std(torque) == 0.0:
            raise DiagnosisError(f"{name} changes no torque on this movement")
        recording = self.recording
        time = np.arange(len(recording.torque)) / recording.rate
        planted = Recording(
            recording.rate,
            recording.position,
            recording.torque + CubicSpline(self.motion.time, torque - np.mean(torque))(time),
            name=f"{recording.name} + {name}",
        )
        share = (self.unseen(torque) / whole) ** 2
        return Planted(planted, share, magnitude)


def reaching(strength: Callable[[float], float], weak: float, strong: float) -> float:
    """Return the first magnitude from the weak end on whose strength is 1; the one of most strength
    where none is so strong.

    Parameters
    ----------
    strength
        Of a magnitude.
    weak, strong
        The weakest and the strongest magnitude, of one sign; either may be the larger number.
    """
    tried: list[tuple[float, float]] = []
    for magnitude in np.geomspace(weak, strong, SCAN_POINTS).tolist():
        tried.append((magnitude, strength(magnitude)))
        if tried[-1][1] >= 1.0:
            break
    else:
        return max(tried, key=lambda one: one[1])[0]
    if len(tried) == 1:
        return weak
    sign = math.copysign(1.0, weak)
    below, above = (math.log(abs(magnitude)) for magnitude, _ in tried[-2:])
    least, most = sorted((abs(weak), abs(strong)))

    def magnitude_at(logarithm: float) -> float:
        return sign * min(max(math.exp(logarithm), least), most)

    return magnitude_at(
        brentq(lambda at: strength(magnitude_at(at)) - 1.0, below, above, xtol=SEARCH_TOLERANCE)
    )
