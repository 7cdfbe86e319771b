"""Recordings of an investigation from a simulated subject instead of a rig."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ankle_physics.model import Model
from ankle_physics.scenario import Scenario
from ankle_physics.virtual_rig import simulate
from model_discrepancy.recording.recording import Recording
from model_discrepancy.tools.candidate_movements import LEVEL_S, LEVELS, Candidate
from model_discrepancy.tools.written_bag import write_bag

RATE = 2048.0


@dataclass(frozen=True)
class SimulatedConduct:
    """Makes the recordings that `investigation.investigate` asks for.

    Attributes
    ----------
    model
        Rig and subject; a candidate with torque levels needs the term ``voluntary_torque``.
    seed
        Of the noise in the first round; each further round takes the next.
    out
        Folder that gets each recording as a bag ``round_1`` and so on; None keeps none.
    """

    model: Model
    seed: int = 1
    out: Path | None = None

    def __call__(self, candidate: Candidate, duration: float, number: int) -> Recording:
        """Simulate a movement of a duration [s] in a round."""
        reference = candidate.reference(duration, RATE)
        made = simulate(
            reference,
            RATE,
            self.model,
            scenario=_levels(duration) if candidate.levels else None,
            seed=self.seed + number - 1,
        )
        recording = Recording(
            RATE,
            made.position,
            made.torque,
            made.velocity,
            reference[:, 0],
            name=f"round {number}, simulated",
        )
        if self.out is not None:
            write_bag(recording, recording.torque, self.out / f"round_{number}")
        return recording


def _levels(duration: float) -> Scenario:
    """Return the torque levels of a task, one after the other."""
    changes = [
        {
            "at[s]": LEVEL_S * k,
            "voluntary_torque.level[N.m]": LEVELS[k % len(LEVELS)],
        }
        for k in range(int(duration // LEVEL_S) + 1)
    ]
    return Scenario.from_content({"scenario": "torque levels", "changes": changes})
