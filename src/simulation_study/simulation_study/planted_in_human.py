"""Effects planted in recorded human trials: ``python -m simulation_study.planted_in_human
RECORDINGS --out FOLDER``.

For every trial and term: the paper's model is fitted to the trial and run in the time domain on its
measured movement, with and without the term. The difference is added to the recorded torque, scaled
so that what the paper's model cannot imitate of it has half the rms of what that model leaves of
the trial. A name counts only where the
trial as it was recorded does not show it already. Results are appended to ``results.jsonl``; an
interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ankle_physics.model import PAPER_TERMS, Model
from ankle_physics.term import Place, term_library
from model_discrepancy.diagnose import diagnose
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.base_model import fit_base
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.recording.motion import ACTIVATION_HZ, Motion, motion_of
from model_discrepancy.recording.recording import Recording
from model_discrepancy.tools.resimulation import simulated_torque
from simulation_study.human_trials import load_trial, trial_paths
from simulation_study.planted_trials import STRENGTHS, contraction, outcome, run_all

# Of the rms that the paper's model leaves of the trial, between 0.1 and 80 Hz: what it cannot
# imitate of the planted torque.
PLANTED_RMS = 0.5
# The planted torque itself is no larger than this. A term that shows less then, such as a drift of
# stiffness that mostly looks like slow torque, is no effect in this trial.
MOST_PLANTED_RMS = 2.0
# The part that can be imitated changes with the size of a torque a little.
SCALINGS = 3
# Of the course of a contraction that is planted: any, and the same in each trial.
CONTRACTION_SEED = 0


def added_torque(name: str, motion: Motion, base: Fit) -> np.ndarray:
    """Return the torque that a term adds to the fitted paper model on this movement [N.m], at the
    motion's rate, shape (n,), without its mean.

    Raises
    ------
    DiagnosisError
        The term changes no torque on this movement.
    """
    values = {
        term: base.values[term]
        for term in PAPER_TERMS
        if term in base.values and term != "voluntary_torque"
    }
    with_term = Model.of({**values, name: STRENGTHS.get(name, {})})
    added = simulated_torque(with_term, motion) - simulated_torque(Model.of(values), motion)
    if np.std(added) == 0.0:
        raise DiagnosisError(f"{name} changes no torque on this movement")
    return added - np.mean(added)


class Planted(NamedTuple):
    """Holds a trial with an effect.

    Attributes
    ----------
    recording
        With the effect's torque.
    share
        Variance that the effect adds beyond what the paper's model could imitate, of the torque's
        variance [1]; both between 0.1 and 80 Hz.
    """

    recording: Recording
    share: float


def plant(recording: Recording, name: str) -> Planted:
    """Return the trial with the term's torque added to the recorded one.

    Parameters
    ----------
    recording
        A human trial.
    name
        Of the term.

    Raises
    ------
    DiagnosisError
        The term changes no torque on this movement.
    """
    motion = motion_of(recording)
    base = fit_base(Fitter.of(motion))
    motion = replace(
        motion,
        activation=held_torque(motion, base),
        cocontraction=contraction(CONTRACTION_SEED, motion.time),
    )
    added = added_torque(name, motion, base)
    time = np.arange(len(recording.torque)) / recording.rate
    return with_torque(recording, np.interp(time, motion.time, added), name)


def held_torque(motion: Motion, base: Fit) -> np.ndarray:
    """Return the torque that the muscles hold [N.m], at the motion's rate, shape (n,): slow torque
    that the paper's model does not make of the movement.

    Parameters
    ----------
    motion
        Of the trial.
    base
        The paper's model, fitted to it.
    """
    return float(np.mean(motion.torque)) + base.rows.slow(base.left, ACTIVATION_HZ)


def with_torque(recording: Recording, added: np.ndarray, name: str) -> Planted:
    """Return the trial with a torque added, scaled so that what the paper's model cannot imitate of
    it is `PLANTED_RMS` of what that model leaves of the trial.

    Torque that looks like another stiffness or another reflex is no effect that anybody could see.

    Parameters
    ----------
    recording
        A human trial.
    added
        Torque of an effect [N.m], shape (n,).
    name
        Of the effect.
    """
    motion = motion_of(recording)
    base = fit_base(Fitter.of(motion))
    left = float(np.std(base.plain[base.rows.used]))
    explained = motion.torque - base.rows.torque(base.left)
    on_motion = np.interp(motion.time, np.arange(len(added)) / recording.rate, added)
    largest = MOST_PLANTED_RMS * left / float(np.std(added))
    scale, unseen = largest, 0.0
    for _ in range(SCALINGS):
        alone = Fitter.of(replace(motion, torque=explained + scale * on_motion))
        unseen = float(np.std(fit_base(alone).plain[base.rows.used]))
        scale *= PLANTED_RMS * left / unseen
        if scale >= largest:
            scale = largest
            break
    whole = float(np.var(base.rows.plain(base.rows.spectrum(motion.torque))[base.rows.used]))
    planted = Recording(
        recording.rate,
        recording.position,
        recording.torque + scale * added,
        name=f"{recording.name} + {name}",
    )
    return Planted(planted, unseen**2 / whole)


def summary(results: list[dict[str, Any]]) -> str:
    """Return names and sets, of the terms that the trial as recorded does not show; what the others
    did stands beside it.
    """
    own = {
        r["trial"]: {name for effect in r["effects"] for name in effect[1:]}
        for r in results
        if r["planted"] is None
    }
    fresh = [r for r in results if r["planted"] is not None and r["planted"] not in own[r["trial"]]]
    exact = sum(any(e[1] == r["planted"] for e in r["effects"]) for r in fresh)
    within = sum(any(r["planted"] in e[1:4] for e in r["effects"]) for r in fresh)
    known = sum(r["planted"] is not None for r in results) - len(fresh)
    return (
        f"of {len(fresh)} effects planted: named exactly {exact} "
        f"({100 * exact / max(len(fresh), 1):.0f} %), in a set of three {within} "
        f"({100 * within / max(len(fresh), 1):.0f} %); {known} more were left out of the count "
        "because the trial shows them itself"
    )


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", type=Path)
    parser.add_argument("--out", type=Path, required=True, help="folder for results.jsonl")
    options = parser.parse_args()
    trials = {path.stem: load_trial(path) for path in trial_paths(options.recordings)}
    # What the position sensor does, changes no torque.
    names = [
        n
        for n, term in term_library().items()
        if term.searched and term.place is not Place.POSITION_SENSOR
    ]
    todo = [{"trial": trial, "planted": name} for trial in trials for name in (None, *names)]

    def run(case: dict[str, Any]) -> dict[str, Any]:
        trial = trials[case["trial"]]
        return {
            **case,
            **outcome(
                diagnose(
                    trial if case["planted"] is None else plant(trial, case["planted"]).recording
                )
            ),
        }

    print(
        summary(
            run_all(
                [{"seed": number, **case} for number, case in enumerate(todo)], run, options.out
            )
        )
    )


if __name__ == "__main__":
    main()
