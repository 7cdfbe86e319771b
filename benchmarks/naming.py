"""Naming by sparse regression on the residual (`pysindy`) on the cases of a blind study whose seal
is open: both scores.

The peer gets the same checks, the same base fit and the same whitened residual, and one regressor
for each term of the library that has one with fixed constants. Sequentially thresholded least
squares chooses among them, the threshold by the error on the other half of the recording;
regressors that take less than 3 % off unseen data name nothing, so that it may say "no mismatch" as
well.

    pip install -r requirements/bench.txt
    ankle blind --cases 100 --seed 7 --out study
    python benchmarks/naming.py study
"""

from __future__ import annotations

import argparse
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pysindy
from rich.progress import track
from scipy.signal import lfilter

from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.rows import LOW_PASS_HZ
from model_discrepancy.problem import prepare
from model_discrepancy.recording.motion import Motion
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.recording_checks import faults
from simulation_study.blind.scoring import CaseScore, score_case, summarise

THRESHOLDS = np.geomspace(0.003, 0.3, 7)
# Share of the whitened residual on unseen rows that regressors must take off to be named.
LEAST_GAIN = 0.03
REFLEX_DELAY_S, LATE_DELAY_S, RELAXATION_S, MUSCLE_S = 0.04, 0.09, 0.1, 0.05


def regressors(motion: Motion, model: np.ndarray, slow: np.ndarray) -> dict[str, np.ndarray]:
    """One regressor for each term, by the term's name, each of shape (n,), at the motion's rate.

    Parameters
    ----------
    motion
        Of the recording.
    model
        Torque of the base model [N.m], shape (n,).
    slow
        Slow part of the torque [N.m], shape (n,).
    """
    x, v, a, rate = (
        motion.position - np.mean(motion.position),
        motion.velocity,
        motion.acceleration,
        motion.rate,
    )

    def later(signal: np.ndarray, delay: float) -> np.ndarray:
        shift = int(delay * rate)
        return np.concatenate([np.zeros(shift), signal[:-shift]])

    def relaxed(signal: np.ndarray, time: float) -> np.ndarray:
        share = np.exp(-1.0 / (rate * time))
        return lfilter([1.0 - share], [1.0, -share], signal)

    def reflex(signal: np.ndarray, delay: float = REFLEX_DELAY_S) -> np.ndarray:
        return later(relaxed(relaxed(signal, MUSCLE_S), MUSCLE_S), delay)

    stretch, time = np.maximum(v, 0.0), motion.time / motion.time[-1]
    return {
        "torque_sensor_lag": np.gradient(model, 1.0 / rate),
        "fixation_compliance": np.gradient(np.gradient(model, 1.0 / rate), 1.0 / rate),
        "torque_sensor_mode": np.gradient(a, 1.0 / rate),
        "coulomb_friction": np.tanh(v / 0.01),
        "asymmetric_damping": np.abs(v),
        "saturating_damping": v * np.abs(v),
        "position_dependent_stiffness": x**2,
        "hardening_stiffness": x**3,
        "maxwell_relaxation": x - relaxed(x, RELAXATION_S),
        "stiffness_drift": time * x,
        "activation_stiffness": slow * x,
        "antagonist_reflex": reflex(np.maximum(-v, 0.0)),
        "reflex_exponent": reflex(stretch**2),
        "long_latency_reflex": reflex(stretch, LATE_DELAY_S),
        "position_reflex": reflex(x),
        "position_reflex_gain": reflex(x * stretch),
        "activation_reflex_gain": reflex(slow * stretch),
        "reflex_drift": reflex(time * stretch),
    }


def sparse_verdict(bag: Path) -> dict[str, Any]:
    """Verdict of the peer: the regressors that sparse regression keeps, the largest first."""
    try:
        recording = Recording.from_bag(bag)
    except DiagnosisError:
        return {"verdict": "bad_recording"}
    if faults(recording):
        return {"verdict": "bad_recording"}
    problem = prepare(recording)
    rows, motion, base = problem.fitter.rows, problem.fitter.motion, problem.base
    model = motion.torque - rows.slow(base.left, LOW_PASS_HZ)
    columns = regressors(motion, model, motion.activation - np.mean(motion.activation))
    matrix = np.column_stack([rows.whitened(rows.spectrum(c)) for c in columns.values()])
    matrix /= np.std(matrix[rows.used], axis=0)
    target = base.residual / np.std(base.residual[rows.used])
    train, test = problem.parts
    best, kept = LEAST_GAIN, np.zeros(matrix.shape[1])
    for threshold in THRESHOLDS:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            chosen = (
                pysindy.STLSQ(threshold=threshold, alpha=1e-3)
                .fit(matrix[train], target[train])
                .coef_[0]
            )
        gain = 1.0 - np.sum((target[test] - matrix[test] @ chosen) ** 2) / np.sum(target[test] ** 2)
        if gain > best and chosen.any():
            best, kept = gain, chosen
    names = [
        name
        for name, size in sorted(zip(columns, np.abs(kept), strict=True), key=lambda pair: -pair[1])
        if size > 0
    ]
    effects = [{"name": name, "probability": 1.0} for name in names]
    return {"verdict": "explained" if effects else "no_mismatch", "effects": effects}


def best_name(score: CaseScore, verdict: dict[str, Any], truth: dict[str, Any]) -> str:
    """Outcome when only the largest regressor counts: a peer that adds small ones is not punished
    for them.
    """
    return (
        score_case(truth, {**verdict, "effects": verdict.get("effects", [])[:1]}).outcome
        if verdict.get("effects")
        else score.outcome
    )


def main() -> None:
    """Score both on every case of a study."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("study", type=Path, help="folder of a finished `ankle blind`")
    folder = parser.parse_args().study
    cases = json.loads((folder / "result.json").read_text())["cases"]
    engine, peer, first = [], [], []
    for case in track(cases, "sparse regression"):
        truth, verdict = case["truth"], sparse_verdict(folder / "bags" / case["case"])
        engine.append(
            score_case(
                truth,
                json.loads(
                    (folder / "verdicts" / case["case"] / "diagnosis" / "verdict.json").read_text()
                ),
            )
        )
        peer.append(score_case(truth, verdict))
        first.append(peer[-1]._replace(outcome=best_name(peer[-1], verdict, truth)))
    print("| | diagnosis | sparse regression | its largest regressor alone |\n|---|---|---|---|")
    rows = {
        "false alarms": lambda s: s["false_alarms"],
        "strong effects, name or set": lambda s: s["known"]["strong"]["exact_or_set"],
        "moderate effects, name or set": lambda s: s["known"]["moderate"]["exact_or_set"],
        "weak effects, name or set": lambda s: s["known"]["weak"]["exact_or_set"],
        "moderate effects, family": lambda s: s["known"]["moderate"]["family"],
        "unexplained recall": lambda s: s["unexplained_recall"],
        "bad recordings": lambda s: s["bad_recordings_caught"],
    }
    summaries = [summarise(scores) for scores in (engine, peer, first)]
    for label, rate in rows.items():
        print(
            f"| {label} | "
            + " | ".join(f"{rate(s)['hits']} of {rate(s)['of']}" for s in summaries)
            + " |"
        )


if __name__ == "__main__":
    main()
