"""Human trials, calibrated on one half and estimated online on the other.

``python -m simulation_study.human_halves RECORDINGS --out FOLDER``

RECORDINGS holds the trials as for `simulation_study.human_trials`. Each half of a trial is
diagnosed once, and its model is kept in FOLDER. The other half is then estimated online with this
model. FOLDER receives ``human_halves.md``:

- VAF of the torque that was not used: of the parallel cascade and of the calibrated model, both
  fitted to the one half and judged on the other, and of the online estimator, whose K, B, I and G
  are at least a second older than the torque that they predict;
- K and G of both halves with their standard errors, and how many standard errors they are apart;
- G with the torque a millisecond earlier and later, the model calibrated as recorded.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ankle_physics.model import Model
from calibration.session_calibration import calibrate_session
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.known_physics import KnownPhysics
from impedance_estimator.offline.model_prediction import predict_with_model
from impedance_estimator.offline.parallel_cascade import parallel_cascade
from impedance_estimator.offline.recorded_estimates import OfflineResult, estimate_signal
from model_discrepancy.recording.recording import Recording
from simulation_study.human_trials import load_trial, trial_paths

HALVES = ("first", "second")
SUBJECT_FILE, TABLE = "subject.yaml", "human_halves.md"
SHIFT = 0.001
"""[s] The torque is shifted by so much: clocks of two acquisition cards differ by less."""
STATED_QUANTITIES = ("K[N.m/rad]", "G[N.m.s/rad]")


class Half(NamedTuple):
    """Holds one half of a trial with the model that was found in the other.

    Attributes
    ----------
    trial, name
        Of the trial, and one of `HALVES`.
    recording
        This half.
    other
        The half that the model comes from.
    known
        The model; None where nothing was calibrated.
    """

    trial: str
    name: str
    recording: Recording
    other: Recording
    known: KnownPhysics | None


def halves(trial: Recording) -> dict[str, Recording]:
    """Return the first and the second half of a trial."""
    middle = len(trial.position) // 2
    parts = (slice(0, middle), slice(middle, None))
    return {
        name: replace(
            trial,
            position=trial.position[part],
            torque=trial.torque[part],
            name=f"{trial.name}_{name}",
        )
        for name, part in zip(HALVES, parts, strict=True)
    }


def calibrated_model(half: Recording, folder: Path) -> Model:
    """Return the model that a diagnosis finds in a half; it is kept in the folder.

    Raises
    ------
    calibration.errors.CalibrationError
        The half is a bad recording.
    """
    file = folder / half.name / SUBJECT_FILE
    if not file.exists():
        print(f"  diagnosing {half.name}", flush=True)
        calibrate_session(half, file.parent).model.save(file)
    return Model.load(file)


def estimated(half: Recording, known: KnownPhysics | None) -> OfflineResult:
    """Return the online estimates of a half, times since its first sample."""
    return estimate_signal(half.time, half.position, half.velocity, half.torque, known=known)


def shifted(half: Recording, seconds: float) -> Recording:
    """Return a recording whose torque comes later by so much."""
    at = half.time - seconds
    return replace(half, torque=np.interp(at, half.time, half.torque))


def prepared(files: list[Path], folder: Path) -> Iterator[Half]:
    """Yield every half with the model of the other one."""
    for file in files:
        parts = halves(load_trial(file))
        for name, other in (HALVES, HALVES[::-1]):
            model = calibrated_model(parts[other], folder)
            known = KnownPhysics(subject=model)
            yield Half(file.stem, name, parts[name], parts[other], known)


def table(files: list[Path], folder: Path) -> str:
    """Return the three tables in Markdown."""
    found = list(prepared(files, folder))
    rows = [estimated(half.recording, half.known) for half in found]
    lines = [
        "Variance of the torque accounted for [%], 0.1 to 80 Hz; everything is predicted from "
        "other data than it is judged on.",
        "",
        "| trial, judged half | parallel cascade | calibrated model | the same, followed online | "
        "terms beside I, B, K and reflex |",
        "| --- | --- | --- | --- | --- |",
    ]
    for half, result in zip(found, rows, strict=True):
        lines.append(_predicted(half, result))
    lines += ["", "K and G at the end of each half, calibrated on the other one.", ""]
    lines += [
        "| trial | quantity | first half | second half | apart by [standard errors] | doubt |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for k in range(0, len(found), 2):
        lines += _agreement(found[k].trial, rows[k], rows[k + 1])
    lines += [
        "",
        f"G with the torque {1000 * SHIFT:g} ms earlier and later, calibrated as recorded.",
        "",
        "| trial, half | as recorded | earlier | later |",
        "| --- | --- | --- | --- |",
    ]
    for half, result in zip(found, rows, strict=True):
        lines.append(_shift_row(half, result))
    return "\n".join(lines) + "\n"


def _predicted(half: Half, result: OfflineResult) -> str:
    own, other = half.recording, half.other
    assert half.known is not None
    cascade = parallel_cascade(own.rate, other.position, other.torque)
    vaf = [
        cascade.predict(own.position, own.torque).vaf,
        predict_with_model(own.rate, half.known, own.position, own.torque).vaf,
        predict_with_model(own.rate, half.known, own.position, own.torque, result.rows).vaf,
    ]
    numbers = " | ".join(f"{value:.2f}" for value in vaf)
    return f"| {half.trial}, {half.name} | {numbers} | {half.known.describe()} |"


def _value(result: OfflineResult, quantity: str) -> tuple[float, float]:
    """Return the last valid estimate and its standard error."""
    last = result.valid[-1]
    return (
        float(last[ESTIMATE_COLUMNS.index(quantity)]),
        float(last[ESTIMATE_COLUMNS.index(f"se_{quantity}")]),
    )


def _agreement(trial: str, first: OfflineResult, second: OfflineResult) -> list[str]:
    lines = []
    doubts = [r.valid[-1, ESTIMATE_COLUMNS.index("doubt[1]")] for r in (first, second)]
    for quantity in STATED_QUANTITIES:
        (a, a_error), (b, b_error) = _value(first, quantity), _value(second, quantity)
        apart = abs(a - b) / np.hypot(a_error, b_error)
        lines.append(
            f"| {trial} | {quantity} | {a:.1f} ± {a_error:.1f} | {b:.1f} ± {b_error:.1f} | "
            f"{apart:.1f} | {doubts[0]:.2f}, {doubts[1]:.2f} |"
        )
    return lines


def _shift_row(half: Half, result: OfflineResult) -> str:
    value, error = _value(result, "G[N.m.s/rad]")
    moved = [
        _value(estimated(shifted(half.recording, by), half.known), "G[N.m.s/rad]")[0]
        for by in (-SHIFT, SHIFT)
    ]
    cells = " | ".join(f"{m:.1f}" for m in moved)
    return f"| {half.trial}, {half.name} | {value:.1f} ± {error:.1f} | {cells} |"


def main() -> None:
    """Write the tables for the trials of a folder."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("recordings", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    files = trial_paths(options.recordings)
    options.out.mkdir(parents=True, exist_ok=True)
    text = table(files, options.out)
    (options.out / TABLE).write_text(text)
    print(text)


if __name__ == "__main__":
    main()
