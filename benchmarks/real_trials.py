"""Real trials, split in halves: what each estimator learnt from one half predicts the torque of the other.

    .venv/bin/python benchmarks/real_trials.py                       # the recordings beside the repository
    .venv/bin/python benchmarks/real_trials.py FOLDER                # NPZ files with time, position, torque

The online estimators give K, B, I and the reflex response that they hold at the end of the half. The parallel cascade is fitted to
the whole half and knows no parametric form: the offline reference. VAF in per cent, between 0.1 and 80 Hz, zero-phase.
The recordings' torque is the subject's; it is turned round.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from impedance_estimator.joint_settings import JointSettings
from impedance_estimator.offline import estimate_signal
from impedance_estimator.parallel_cascade import parallel_cascade
from impedance_estimator.settings import EstimatorSettings, Settings
from impedance_estimator.torque_prediction import Prediction, predict_torque
from sample_blocks.continuity import sampling_rate

RECORDINGS = Path(__file__).resolve().parents[2] / "shared" / "recordings"
# A half lasts 30 s; estimates need to be valid before its end.
ONLINE: dict[str, tuple[str, EstimatorSettings]] = {
    "CE": ("CE", Settings(settling_time=20.0)),
    "CE, all high-passed": ("CE", Settings(settling_time=20.0, highpass="all")),
    "joint": ("joint", JointSettings()),
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


def vaf_intrinsic(prediction: Prediction) -> float:
    """Variance of the measured torque that the intrinsic part alone accounts for [%]."""
    return 100.0 * (1.0 - float(np.var(prediction.measured - prediction.intrinsic) / np.var(prediction.measured)))


def halves(rate: float, time: np.ndarray, position: np.ndarray, torque: np.ndarray) -> list[tuple[str, str, np.ndarray, list[Prediction]]]:
    """For each direction and method: label, method, K, B, I and G, and the prediction of the fitted and of the other half."""
    middle = len(time) // 2
    parts = {"first": slice(0, middle), "second": slice(middle, None)}
    found = []
    for fitted, other in (("first", "second"), ("second", "first")):
        label = f"{fitted} to {other}"
        x, y = position[parts[fitted]], torque[parts[fitted]]
        for method, (algorithm, settings) in ONLINE.items():
            result = estimate_signal(time[parts[fitted]], x, None, y, algorithm, settings)
            row, response = result.valid[-1], result.responses[-1][1]
            predictions = [predict_torque(rate, row[1:4], response, position[parts[part]], torque[parts[part]]) for part in (fitted, other)]
            found.append((label, method, row[1:5], predictions))
        model = parallel_cascade(rate, x, y)
        predictions = [model.predict(position[parts[part]], torque[parts[part]]) for part in (fitted, other)]
        found.append((label, "parallel cascade", np.array([model.stiffness, np.nan, np.nan, model.gain]), predictions))
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=RECORDINGS)
    folder = parser.parse_args().folder
    files = sorted(folder.glob("*.npz"))
    if not files:
        print(f"no NPZ files in {folder}", file=sys.stderr)
        return 1
    print("| " + " | ".join(HEADER) + " |")
    print("|" + " --- |" * len(HEADER))
    for file in files:
        data = np.load(file)
        rate = sampling_rate(data["time"])
        for label, method, (K, B, I, G), (own, other) in halves(rate, data["time"], data["position"], -data["torque"]):
            print(
                f"| {file.stem} | {label} | {method} | {K:.1f} | {B:.2f} | {I:.4f} | {G:.1f} "
                f"| {own.vaf:.1f} | {other.vaf:.1f} | {vaf_intrinsic(other):.1f} |".replace("nan", "-"),
                flush=True,
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
