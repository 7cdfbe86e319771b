"""Real trials, split in halves: what each estimator learnt from one half predicts the torque of the
other.

    .venv/bin/python benchmarks/real_trials.py             # the recordings beside the repository
    .venv/bin/python benchmarks/real_trials.py FOLDER      # bags of `ankle fetch-trials`

The online estimators give K, B, I and the reflex response that they hold at the end of the half.
The parallel cascade is fitted to the whole half and knows no parametric form: the offline
reference. VAF in per cent, between 0.1 and 80 Hz, zero-phase.

A second table is about a joint with known parameters that is moved as the subjects' ankles were, so
that there is a truth.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from scipy import signal

from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.offline.parallel_cascade import parallel_cascade
from impedance_estimator.offline.recorded_estimates import estimate_signal
from impedance_estimator.offline.torque_prediction import Prediction, predict_torque
from impedance_estimator.settings import EstimatorSettings, Settings
from impedance_estimator.simultaneous.settings import SimultaneousSettings
from model_discrepancy.errors import DiagnosisError
from simulation_study.human_trials import load_trial, trial_paths

RECORDINGS = Path(__file__).resolve().parents[2] / "shared" / "recordings"
# A half lasts 30 s; estimates need to be valid before its end.
ONLINE: dict[str, tuple[str, EstimatorSettings]] = {
    "CE": ("CE", Settings(settling_time=20.0)),
    "CE, all high-passed": ("CE", Settings(settling_time=20.0, highpass="all")),
    "simultaneous": ("simultaneous", SimultaneousSettings()),
}
HEADER = (
    "trial",
    "halves",
    "method",
    "K [N.m/rad]",
    "B [N.m.s/rad]",
    "I [kg.m^2]",
    "G [N.m.s/rad]",
    "VAF fitted",
    "VAF other",
    "intrinsic alone, other",
)

K, B, I, G = 100.0, 0.63, 0.0137, 10.0
"""[N.m/rad, N.m.s/rad, kg.m^2, N.m.s/rad] of the known joint; its reflex has 21 rad/s, 0.8 and 40
ms (van 't Veld et al. 2018).
"""
TORQUE_NOISE = 0.05
"""[N.m] White, at every sample: a tenth of that of the paper's rig."""
VOLUNTARY_TORQUES = ((0.0, 1.0), (0.5, 0.3), (1.0, 1.0))
"""Root mean square [N.m] and cut-off [Hz]."""
COMPARED_ESTIMATORS = {
    "CE": ("CE", Settings()),
    "CE, all high-passed": ("CE", Settings(highpass="all")),
    "simultaneous": ("simultaneous", SimultaneousSettings()),
}


def known_joint(
    rate: float, position: np.ndarray, rms: float, cutoff: float
) -> tuple[np.ndarray, np.ndarray]:
    """Position below 60 Hz [rad] and the torque of the known joint under it [N.m]."""
    x = signal.sosfiltfilt(signal.butter(4, 60.0, fs=rate, output="sos"), position)
    v = np.gradient(x, 1.0 / rate)
    late = round(0.040 * rate)
    stretch = np.concatenate([np.zeros(late), np.maximum(v, 0.0)[:-late]])
    muscle = signal.lfilter(
        *signal.bilinear([21.0**2], [1.0, 2.0 * 0.8 * 21.0, 21.0**2], rate), stretch
    )
    random = np.random.default_rng(3)
    drift = signal.sosfilt(
        signal.butter(4, cutoff, fs=rate, output="sos"), random.normal(size=len(x))
    )
    torque = I * np.gradient(v, 1.0 / rate) + B * v + K * x + G * muscle + rms * drift / drift.std()
    return x, torque + TORQUE_NOISE * random.normal(size=len(x))


def print_known_joint(name: str, rate: float, time: np.ndarray, position: np.ndarray) -> None:
    """Print mean and standard deviation within the trial, by voluntary torque and estimator."""
    for rms, cutoff in VOLUNTARY_TORQUES:
        x, torque = known_joint(rate, position, rms, cutoff)
        for method, (algorithm, settings) in COMPARED_ESTIMATORS.items():
            rows = estimate_signal(time, x, None, torque, algorithm, settings).valid
            values = [
                f"{rows[:, column].mean():.2f} ± {rows[:, column].std():.2f}" for column in (1, 4)
            ]
            print(
                f"| {name} | {rms:g} below {cutoff:g} Hz | {method} | " + " | ".join(values) + " |",
                flush=True,
            )


def vaf_intrinsic(prediction: Prediction) -> float:
    """Variance of the measured torque that the intrinsic part alone accounts for [%]."""
    return 100.0 * (
        1.0
        - float(np.var(prediction.measured - prediction.intrinsic) / np.var(prediction.measured))
    )


def halves(
    rate: float, time: np.ndarray, position: np.ndarray, torque: np.ndarray
) -> list[tuple[str, str, np.ndarray, list[Prediction]]]:
    """For each direction and method: label, method, K, B, I and G, and the prediction of the fitted
    and of the other half.
    """
    middle = len(time) // 2
    parts = {"first": slice(0, middle), "second": slice(middle, None)}
    found = []
    for fitted, other in (("first", "second"), ("second", "first")):
        label = f"{fitted} to {other}"
        x, y = position[parts[fitted]], torque[parts[fitted]]
        for method, (algorithm, settings) in ONLINE.items():
            result = estimate_signal(time[parts[fitted]], x, None, y, algorithm, settings)
            row, response = result.valid[-1], result.responses[-1][1][:, :2]
            predictions = [
                predict_torque(rate, row[1:4], response, position[parts[part]], torque[parts[part]])
                for part in (fitted, other)
            ]
            found.append((label, method, row[1:5], predictions))
        model = parallel_cascade(rate, x, y)
        predictions = [
            model.predict(position[parts[part]], torque[parts[part]]) for part in (fitted, other)
        ]
        found.append(
            (
                label,
                "parallel cascade",
                np.array([model.stiffness, np.nan, np.nan, model.gain]),
                predictions,
            )
        )
    return found


def print_shifted(files: list[Path]) -> None:
    """K and G of every half with its torque a sample earlier, as recorded, and a sample later."""
    print("| trial | half | torque shifted by [samples] | K | G | doubt |\n|" + " --- |" * 6)
    for file in files:
        trial = load_trial(file)
        middle = len(trial.time) // 2
        for label, part in (("first", slice(0, middle)), ("second", slice(middle, None))):
            for shift in (-1, 0, 1):
                torque = np.roll(trial.torque, shift)[part]
                row = estimate_signal(
                    trial.time[part], trial.position[part], None, torque, "simultaneous"
                ).valid[-1]
                named = dict(zip(ESTIMATE_COLUMNS, row, strict=True))
                values = [
                    f"{named[name]:.1f} ± {named[f'se_{name}']:.1f}"
                    for name in ("K[N.m/rad]", "G[N.m.s/rad]")
                ]
                print(
                    f"| {file.stem} | {label} | {shift:+d} | {' | '.join(values)} "
                    f"| {named['doubt[1]']:.2f} |",
                    flush=True,
                )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=RECORDINGS)
    parser.add_argument(
        "--shift", action="store_true", help="each half with its torque a sample earlier and later"
    )
    arguments = parser.parse_args()
    folder = arguments.folder
    try:
        files = trial_paths(folder)
    except DiagnosisError as error:
        print(error, file=sys.stderr)
        return 1
    if arguments.shift:
        print_shifted(files)
        return 0
    print("| " + " | ".join(HEADER) + " |")
    print("|" + " --- |" * len(HEADER))
    for file in files:
        trial = load_trial(file)
        for label, method, found, (own, other) in halves(
            trial.rate, trial.time, trial.position, trial.torque
        ):
            values = [
                f"{value:.{digits}f}" for value, digits in zip(found, (1, 2, 4, 1), strict=True)
            ]
            print(
                f"| {file.stem} | {label} | {method} | {' | '.join(values)} "
                f"| {own.vaf:.1f} | {other.vaf:.1f} | {vaf_intrinsic(other):.1f} |".replace(
                    "nan", "-"
                ),
                flush=True,
            )
    print(
        f"\n| motion of | voluntary torque [N.m] | method | K, true {K:g} | G, true {G:g} |\n|"
        + " --- |" * 5
    )
    for file in files:
        trial = load_trial(file)
        print_known_joint(file.stem, trial.rate, trial.time, trial.position)
    return 0


if __name__ == "__main__":
    sys.exit(main())
