"""Effects planted in recorded human trials: ``python -m simulation_study.planted_in_human
RECORDINGS --out FOLDER``.

For every trial and term: the paper's model is fitted to the trial and run in the time domain on its
measured movement, with and without the term. The difference is added to the recorded torque. The
term's own magnitude is searched for with which it adds as much as a moderate effect of the
independent rig, beyond what the paper's model could imitate. It acts about the trial's mean angle
and mean torque. A name counts only where the trial as it was recorded does not show it already.
Results are appended to ``results.jsonl``; an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ankle_physics.model import PAPER_TERMS, Model
from ankle_physics.term import Place, term_library
from blind_rig.strength import LARGEST_COMPENSATION
from model_discrepancy.diagnose import diagnose
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.parallel import side_by_side
from model_discrepancy.recording.motion import Motion
from model_discrepancy.recording.recording import Recording
from model_discrepancy.tools.resimulation import simulated_torque
from simulation_study.human_trials import load_trial, trial_paths
from simulation_study.planted_effect import MeasuredTrial, Planted
from simulation_study.planted_trials import STRENGTHS, contraction, outcome, run_all

# Of the course of a contraction that is planted: any, and the same in each trial.
CONTRACTION_SEED = 0
# The weakest amplitude that is tried, of the strongest that the range of a term allows.
WEAKEST_AMPLITUDE = 1e-4
# The paper's reflex as a model holds it.
_REFLEX = "reflex"


class Magnitude(NamedTuple):
    """Describes the parameter that carries a term which is not proportional to it.

    Attributes
    ----------
    symbol
        Of the parameter.
    weak
        Its value where the term hardly shows, on the other side of the typical value than that
        where it shows most.
    keeps_reflex
        Whether the reflex gain makes up for what the term takes: a subject whose reflex has a
        threshold has a threshold and a gain, not a weaker reflex than others.
    """

    symbol: str
    weak: float
    keeps_reflex: bool = False


MAGNITUDES: dict[str, Magnitude] = {
    "activation_dynamics": Magnitude("falling", 0.011, keeps_reflex=True),
    "backlash": Magnitude("gap", 1e-4),
    "channel_skew": Magnitude("skew", 1e-4),
    "cyclic_angle_error": Magnitude("s", 1e-5),
    "fixation_compliance": Magnitude("k_s", 5e4),
    "fixation_stops": Magnitude("k_s", 5e4),
    "lost_motion": Magnitude("gap", 1e-4),
    "partial_sensor_mode": Magnitude("frequency", 150.0),
    "reflex_depression": Magnitude("size", 2.0, keeps_reflex=True),
    "reflex_exponent": Magnitude("p", 0.99, keeps_reflex=True),
    "reflex_saturation": Magnitude("vs", 10.0, keeps_reflex=True),
    "reflex_threshold": Magnitude("vt", 0.01, keeps_reflex=True),
    "stiffening_fixation": Magnitude("k_s", 5e4),
    "tendon": Magnitude("T", 0.002, keeps_reflex=True),
    "torque_sensor_lag": Magnitude("T", 3e-4),
    "torque_sensor_mode": Magnitude("frequency", 150.0),
}


@side_by_side()
def plant(recording: Recording, name: str) -> Planted:
    """Return the trial with the torque that a term adds on its movement.

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
    trial = MeasuredTrial(recording)
    motion = replace(
        trial.motion,
        activation=trial.held_torque,
        cocontraction=contraction(CONTRACTION_SEED, trial.motion.time),
    )
    paper = {
        term: trial.base.values[term]
        for term in PAPER_TERMS
        if term in trial.base.values and term != "voluntary_torque"
    }
    without = _torque(paper, motion)
    acts_about = Columns(motion, trial.base.rows).convention(name)

    def added(magnitude: float) -> np.ndarray:
        """Return the torque that the term adds to the fitted paper model."""
        values = {**paper, name: acts_about | term_values(name, magnitude)}
        if name in MAGNITUDES and MAGNITUDES[name].keeps_reflex:
            values[_REFLEX] = _as_large(values, paper, motion)
        return _torque(values, motion) - without

    return trial.planted(name, added, *magnitudes(name))


def magnitudes(name: str) -> tuple[float, float]:
    """Return the weakest and the strongest magnitude of a term: of the parameter that carries it,
    or the factor of its amplitudes.

    Parameters
    ----------
    name
        Of the term.
    """
    term = term_library()[name]
    if name in MAGNITUDES:
        symbol, weak, _ = MAGNITUDES[name]
        parameter = term.parameter(symbol)
        return weak, parameter.lower if parameter.default < weak else parameter.upper
    strongest = min(
        (upper if amplitude > 0.0 else lower) / amplitude
        for amplitude, lower, upper in (
            (_typical(name, p.symbol, p.default), p.lower, p.upper)
            for p in term.parameters
            if p.linear and p.fitted
        )
        if amplitude != 0.0
    )
    return WEAKEST_AMPLITUDE * strongest, strongest


def term_values(name: str, magnitude: float) -> dict[str, float]:
    """Return the values of a term of some magnitude; those that do not carry it are typical.

    Parameters
    ----------
    name
        Of the term.
    magnitude
        Between those of `magnitudes`.
    """
    if name in MAGNITUDES:
        return {MAGNITUDES[name].symbol: magnitude}
    return {
        p.symbol: magnitude * _typical(name, p.symbol, p.default)
        for p in term_library()[name].parameters
        if p.linear and p.fitted
    }


def _typical(name: str, symbol: str, default: float) -> float:
    """Return the value of a parameter that is a moderate effect at usual step sizes."""
    return STRENGTHS.get(name, {}).get(symbol, default)


def _torque(values: Mapping[str, Mapping[str, float]], motion: Motion) -> np.ndarray:
    """Return the torque of a model on a movement [N.m], at the motion's rate, shape (n,)."""
    return simulated_torque(Model.of({term: dict(v) for term, v in values.items()}), motion)


def _as_large(
    values: Mapping[str, Mapping[str, float]],
    paper: Mapping[str, Mapping[str, float]],
    motion: Motion,
) -> dict[str, float]:
    """Return the values of the reflex with which its torque has the same rms in a model as in the
    paper's, as far as the range of its gain allows.
    """

    def size(model: Mapping[str, Mapping[str, float]]) -> float:
        reflexless = {**model, _REFLEX: {**model[_REFLEX], "G": 0.0}}
        return float(np.std(_torque(model, motion) - _torque(reflexless, motion)))

    reflex, largest = paper[_REFLEX], term_library()[_REFLEX].parameter("G").upper
    factor = size(paper) / max(size(values), size(paper) / LARGEST_COMPENSATION)
    return {**reflex, "G": min(reflex["G"] * factor, largest)}


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
        if case["planted"] is not None:
            trial = plant(trial, case["planted"]).recording
        return {**case, **outcome(diagnose(trial))}

    print(
        summary(
            run_all(
                [{"seed": number, **case} for number, case in enumerate(todo)], run, options.out
            )
        )
    )


if __name__ == "__main__":
    main()
