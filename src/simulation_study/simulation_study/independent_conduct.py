"""Recordings of an investigation from the independent rig."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from blind_rig.protocols import onset_times
from blind_rig.trial import Movement, Trial, run, simulation_rate
from model_discrepancy.recording.recording import Recording
from model_discrepancy.tools.candidate_movements import LEVEL_S, LEVELS, Candidate
from simulation_study.verdict_cases import Plan, recorded


@dataclass(frozen=True)
class IndependentConduct:
    """Makes the recordings that `investigation.investigate` asks for, of the subject and rig of a
    case.

    Attributes
    ----------
    plan
        The case: rate and channels.
    trial
        Subject and rig with what they hide.
    """

    plan: Plan
    trial: Trial

    def __call__(self, candidate: Candidate, duration: float, number: int) -> Recording:
        """Record a movement of a duration [s] in a round, with voluntary torque and noise of its
        own.
        """
        trial = self.trial._replace(seed=self.trial.seed + number)
        rate = simulation_rate(trial)
        reference = candidate.reference(duration, rate)
        times = np.arange(len(reference)) / rate
        task = np.zeros(len(reference))
        if candidate.levels:
            task = np.array(LEVELS)[(times / LEVEL_S).astype(int) % len(LEVELS)]
        movement = Movement(reference[:, 0], onset_times(reference[:, 1], rate), task)
        return recorded(self.plan, trial, run(trial, movement=movement))
