"""Effects planted in recorded human trials: ``python -m simulation_study.planted_in_human
RECORDINGS --out FOLDER``.

For every trial and term: the paper's model is fitted to the trial and run in the time domain on its
measured movement, with and without the term; the difference, scaled to half the rms of what the
paper's model leaves of the trial, is added to the recorded torque. A name counts only where the
trial as it was recorded does not show it already. Results are appended to ``results.jsonl``; an
interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from ankle_physics.model import PAPER_TERMS, Model
from ankle_physics.term import Place, term_library
from model_discrepancy.diagnose import diagnose
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.base_model import fit_base
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.recording.motion import Motion, motion_of
from model_discrepancy.recording.recording import Recording
from model_discrepancy.tools.resimulation import simulated_torque
from simulation_study.human_trials import load_trial, trial_paths
from simulation_study.planted_trials import STRENGTHS, outcome, run_all

# Of the rms that the paper's model leaves of the trial, between 0.1 and 80 Hz.
PLANTED_RMS = 0.5


def added_torque(name: str, motion: Motion, base: Fit, rms: float) -> np.ndarray:
    """Return the torque that a term adds to the fitted paper model on this movement [N.m], at the
    motion's rate, shape (n,), scaled to `rms` [N.m].

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
    added -= np.mean(added)
    if np.std(added) == 0.0:
        raise DiagnosisError(f"{name} changes no torque on this movement")
    return added * (rms / np.std(added))


def plant(recording: Recording, name: str) -> Recording:
    """Return the trial with the term's torque added to the recorded one."""
    motion = motion_of(recording)
    base, rms = _fitted_base(motion)
    added = added_torque(name, motion, base, rms)
    time = np.arange(len(recording.torque)) / recording.rate
    return with_torque(recording, np.interp(time, motion.time, added), name)


def residual_rms(recording: Recording) -> float:
    """Return the rms that planted torque is scaled to [N.m]: a part of what the paper's model
    leaves of the trial.
    """
    return _fitted_base(motion_of(recording))[1]


def with_torque(recording: Recording, added: np.ndarray, name: str) -> Recording:
    """Return the trial with a torque [N.m], shape (n,), added to the recorded one."""
    return Recording(
        recording.rate,
        recording.position,
        recording.torque + added,
        name=f"{recording.name} + {name}",
    )


def _fitted_base(motion: Motion) -> tuple[Fit, float]:
    """Return the paper's model, fitted, and the rms that planted torque is scaled to [N.m]."""
    fitter = Fitter.of(motion)
    base = fit_base(fitter)
    return base, PLANTED_RMS * float(np.std(base.plain[fitter.rows.used]))


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
                diagnose(trial if case["planted"] is None else plant(trial, case["planted"]))
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
