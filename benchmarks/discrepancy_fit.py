"""The fit of the discrepancy engine against `scipy.optimize.least_squares` on the same model
without variable projection.

Both fit the same terms to the same recording (simulated: a compliant fixation and a Maxwell element
beside the paper's model) from the same typical values, on the same whitened rows, with the same
bounds, the linear algebra of both on one thread. Printed: processor time and whitened sum of
squares. Then whole diagnoses are timed, each with as many fits side by side as there are cores.

    python benchmarks/discrepancy_fit.py
"""

from __future__ import annotations

import time

import numpy as np
from scipy.optimize import least_squares

from ankle_physics.model import PAPER_TERMS
from ankle_physics.term import term_library
from model_discrepancy.diagnose import diagnose
from model_discrepancy.fit.base_model import fit_base
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.parallel import cores, side_by_side
from model_discrepancy.fit.parameter_scale import from_unit, to_unit
from model_discrepancy.fit.rows import Rows
from model_discrepancy.recording.motion import motion_of
from simulation_study.planted_trials import simulate_trial

MODELS = {
    "paper": PAPER_TERMS,
    "paper, Maxwell": (*PAPER_TERMS, "maxwell_relaxation"),
    "paper, Maxwell, sensor mode": (*PAPER_TERMS, "maxwell_relaxation", "torque_sensor_mode"),
}
# About as many as the search adds at most (`hypotheses.MOST_TERMS`), at every place of the path.
NINE_TERMS = (
    "fixation_compliance",
    "maxwell_relaxation",
    "hardening_stiffness",
    "asymmetric_damping",
    "reflex_saturation",
    "antagonist_reflex",
    "long_latency_reflex",
    "channel_skew",
    "torque_sensor_lag",
)
# The peer takes a minute for thirty of its steps where projection needs a second.
EVALUATIONS = 30


def plain_least_squares(fitter: Fitter, names: tuple[str, ...]) -> tuple[float, float]:
    """All parameters searched alike, by `scipy.optimize.least_squares`: processor time [s]
    and whitened sum of squares.
    """
    values = fitter.start_values(names)
    free = [(name, p) for name in names for p in term_library()[name].parameters if p.fitted]
    used = fitter.rows.used

    def residual(units: np.ndarray) -> np.ndarray:
        for (name, parameter), unit in zip(free, units, strict=True):
            values[name][parameter.symbol] = from_unit(parameter, float(unit))
        return fitter.evaluate(values).residual[used]

    first = np.array(
        [min(max(to_unit(p, values[name][p.symbol]), 1e-3), 1.0 - 1e-3) for name, p in free]
    )
    begin = time.process_time()
    found = least_squares(
        residual, first, bounds=(0.0, 1.0), max_nfev=EVALUATIONS, ftol=1e-4, xtol=1e-3
    )
    return time.process_time() - begin, 2.0 * float(found.cost)


def main() -> None:
    """Print the table and the times."""
    with side_by_side():
        compare_fits()
    time_diagnoses()


def compare_fits() -> None:
    """Print how long fits take with and without projection."""
    recording = simulate_trial(
        {"torque_sensor_mode": {}, "maxwell_relaxation": {}}, seed=3, protocol="random"
    )
    motion = motion_of(recording)
    fitter = Fitter(Columns(motion, Rows(len(motion.position), motion.rate)))
    fit_base(fitter)
    print(
        f"{recording.duration:g} s at {recording.rate:g} Hz, {int(fitter.rows.used.sum())} rows, "
        "from typical values"
    )
    print(
        "| model | projection | sum of squares | without projection | sum of squares | ratio of "
        "times |"
    )
    print("| --- | --- | --- | --- | --- | --- |")
    for title, names in MODELS.items():
        begin = time.process_time()
        fit = fitter.fit(names, evaluations=EVALUATIONS)
        ours = time.process_time() - begin
        peer, error = plain_least_squares(fitter, names)
        print(
            f"| {title} | {ours:.2f} s | {fit.score:.0f} | {peer:.2f} s | {error:.0f} | "
            f"{peer / ours:.0f} |",
            flush=True,
        )


def time_diagnoses() -> None:
    """Print how long whole diagnoses take."""
    straps = ("fixation_compliance", "maxwell_relaxation")
    for seconds, hidden in ((60.0, straps), (120.0, straps), (120.0, NINE_TERMS)):
        trial = simulate_trial({name: {} for name in hidden}, seed=4, duration=seconds)
        begun, spent = time.perf_counter(), time.process_time()
        found = diagnose(trial).found
        assert found is not None
        names = [effect.trial.name for effect in (*found.effects, *found.refinements)]
        print(
            f"whole diagnosis of {seconds:g} s at {trial.rate:g} Hz with {len(hidden)} terms "
            f"on {cores()} cores: {time.perf_counter() - begun:.0f} s, of the processor "
            f"{time.process_time() - spent:.0f} s; found {len(names)}: {', '.join(names)}",
            flush=True,
        )


if __name__ == "__main__":
    main()
