"""Rigs with hidden imperfections, calibrated: ``python -m simulation_study.rig_calibration_study
--rigs 40 --seed 1 --out FOLDER``.

Every rig is one of the independent MuJoCo engine, whose torque cell, servo, bearing and sensors
share no code with the calibration. It is recorded twice, as a laboratory does it: with the plate
empty, and with a known spring on it. FOLDER receives ``rig_calibration.md``.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from blind_rig.anatomy import Setup
from blind_rig.empty_plate import record_empty_plate
from blind_rig.mechanics import cell_stiffness
from blind_rig.protocols import Protocol
from blind_rig.trial import STEPS_PER_SAMPLE, Trial
from calibration.errors import CalibrationError
from calibration.known_load import KnownLoad
from calibration.rig_calibration import rig_file, with_compliance
from calibration.rig_identification import IdentifiedRig, identify_rig
from calibration.rig_spectra import Signals
from perturbation_generator.rig_calibration import DURATION, RigCalibration
from perturbation_generator.settings import Settings

STREAM = 67
"""Labels the seeds of this study, so that they are not those of any other."""
SENSORS = ("mode", "lag", "plain")
"""What the torque sensor has, in turn: a resonance, a first-order lag, or neither."""
RANGES: dict[str, tuple[float, float]] = {
    "rig.plate_inertia": (0.003, 0.010),
    "rig.bearing_friction": (0.05, 0.4),
    "rig.servo_k": (1000.0, 3000.0),
    "rig.drive_hz": (30.0, 60.0),
    "rig.drive_zeta": (0.65, 0.85),
    "sensors.torque_delay": (0.0, 0.003),
}
"""The rigs of this size that the literature has: a footplate of 3 to 10 kg of a tenth of a metre, a
servo that holds 0.9 to 0.97 of the command against an ankle, a controller's loop of 1 to 3 ms."""
MODE, MODE_DAMPING, LAG = (25.0, 90.0), (0.02, 0.10), (0.001, 0.005)
"""[Hz], [1], [s] Of the torque sensor; drawn evenly on a logarithmic scale."""
SPRING = (60.0, 180.0)
"""[N.m/rad] Of the spring for the second recording: within what the calibration asks for."""
NOISE = (4.5e-5, 6.5e-3, 0.14)
"""[rad], [rad/s], [N.m] Standard deviations, about those of the paper's signal-to-noise ratios."""
NOISE_FACTOR = (0.5, 1.5)
RATES = (1000.0, 2048.0)
"""[Hz] Sampling rates of such rigs."""
ANGLE = (0.0, 0.2)
"""[rad] Of the plate."""
NOISELESS = 200.0
"""[dB] The engine's noise is a share of the signal, which on an empty plate is next to nothing; the
noise of this study has a size of its own."""
AMPLITUDE = 0.04
"""[rad] The command of `ankle calibrate rig` unless another one is given."""
WIDTH = 1.96
"""Standard errors of an interval of 95 %."""


@dataclass(frozen=True)
class HiddenRig:
    """Describes a rig of the study.

    Attributes
    ----------
    setup
        For the engine.
    sensor
        One of `SENSORS`.
    rate
        [Hz].
    angle
        Of the plate [rad].
    spring
        Of the second recording [N.m/rad].
    noise
        Factor on `NOISE`.
    seed
        Of movements and noise.
    """

    setup: Setup
    sensor: str
    rate: float
    angle: float
    spring: float
    noise: float
    seed: int

    @property
    def truth(self) -> dict[str, float]:
        """Return the delay [s], the plate's inertia [kg.m^2], the stiffness of servo and shaft
        against load [N.m/rad], and frequency [Hz] or time constant [s] of the torque sensor.

        The torque cell gives way with its own stiffness. The engine's lag holds its input for a
        step, and is half a step early for that.
        """
        rig, sensors = self.setup.rig, self.setup.sensors
        stiffness, _ = cell_stiffness(self.setup)
        early = 0.5 / (self.rate * STEPS_PER_SAMPLE[self.rate])
        found = {
            "delay": sensors.torque_delay - (early if self.sensor == "lag" else 0.0),
            "inertia": rig.plate_inertia,
            "sag": 1.0 / (1.0 / rig.servo_k + 1.0 / stiffness),
        }
        if self.sensor != "plain":
            found[self.sensor] = sensors.mode_hz if self.sensor == "mode" else sensors.torque_lag
        return found


def draw(number: int, seed: int) -> HiddenRig:
    """Return one rig of a study.

    Parameters
    ----------
    number
        From 0.
    seed
        Of the study.
    """
    random = np.random.default_rng([STREAM, seed, number])
    sensor = SENSORS[number % len(SENSORS)]
    changes = {path: float(random.uniform(*limits)) for path, limits in RANGES.items()}

    def on_a_scale(limits: tuple[float, float]) -> float:
        return math.exp(random.uniform(*np.log(limits)))

    if sensor == "mode":
        changes["sensors.mode_hz"] = on_a_scale(MODE)
        changes["sensors.mode_zeta"] = on_a_scale(MODE_DAMPING)
    elif sensor == "lag":
        changes["sensors.torque_lag"] = on_a_scale(LAG)
    changes |= {f"sensors.{name}_snr": NOISELESS for name in ("position", "velocity", "torque")}
    return HiddenRig(
        Setup().replaced(changes),
        sensor,
        float(random.choice(RATES)),
        float(random.uniform(*ANGLE)),
        float(random.uniform(*SPRING)),
        float(random.uniform(*NOISE_FACTOR)),
        int(random.integers(2**31)),
    )


def recorded(rig: HiddenRig, spring: float) -> Signals:
    """Return a recording of a rig with a spring [N.m/rad] on its plate; 0 is an empty plate."""
    rate = rig.rate * STEPS_PER_SAMPLE[rig.rate]
    settings = Settings(rate=rate, amplitude=AMPLITUDE, seed=rig.seed, direction="both")
    command = RigCalibration(settings).next(int(DURATION * rate))[:, 0]
    protocol = Protocol("pulse_step", AMPLITUDE, 0.024, DURATION)
    trial = Trial(rig.setup, protocol, rig.rate, rig.angle, rig.seed)
    made = record_empty_plate(trial, command, spring)
    random = np.random.default_rng([STREAM, rig.seed, round(spring)])
    noise = rig.noise * np.array(NOISE)[:, None] * random.standard_normal((3, len(made.position)))
    return Signals(
        rig.rate,
        made.position + noise[0],
        made.velocity + noise[1],
        made.torque + noise[2],
        made.reference[:, 0],
    )


def calibrated(rig: HiddenRig) -> dict[str, Any]:
    """Calibrate a rig as a laboratory does.

    Returns
    -------
    dict
        ``truth``; ``found``: value and standard error by the names of the truth; ``sensor``: which
        was hidden and which was found; ``failure``: what was refused, or empty.
    """
    result: dict[str, Any] = {"truth": rig.truth, "found": {}, "failure": ""}
    result["sensor"] = (rig.sensor, "")
    try:
        empty = recorded(rig, 0.0)
        identified = identify_rig(empty)
        result["sensor"] = (rig.sensor, _sensor_of(identified))
        result["found"] = _values(identified)
        file, _ = rig_file(identified, "hidden", KnownLoad(), angle=float(empty.position.mean()))
        loaded = recorded(rig, rig.spring)
        load = KnownLoad(spring=rig.spring)
        found = with_compliance(file, identify_rig(loaded), load, loaded)
        sag = found.model.entry("servo_compliance")
        result["found"]["sag"] = (sag.values["k_a"], sag.standard_errors["k_a"])
    except CalibrationError as error:
        result["failure"] = str(error)
    return result


def _sensor_of(found: IdentifiedRig) -> str:
    return "mode" if found.mode is not None else "lag" if found.lag is not None else "plain"


def _values(found: IdentifiedRig) -> dict[str, tuple[float, float]]:
    values = {"delay": found.torque_delay, "inertia": found.inertia}
    if found.mode is not None:
        values["mode"] = found.mode[0]
    if found.lag is not None:
        values["lag"] = found.lag
    return {name: (each.value, each.error) for name, each in values.items()}


@dataclass(frozen=True)
class Goal:
    """Describes how exactly a value is to be found.

    Attributes
    ----------
    name
        In words.
    limit
        Largest error, in `unit`.
    unit
        ``ms``, or ``%`` of the truth.
    """

    name: str
    limit: float
    unit: str


GOALS = {
    "delay": Goal("torque behind position", 0.1, "ms"),
    "inertia": Goal("inertia of the plate", 2.0, "%"),
    "mode": Goal("frequency of the sensor's mode", 2.0, "%"),
    "lag": Goal("lag of the sensor", 10.0, "%"),
    "sag": Goal("stiffness of the servo against load", 5.0, "%"),
}


def report(results: list[dict[str, Any]], command: str) -> str:
    """Return the tables in Markdown."""
    right = sum(hidden == found for hidden, found in (r["sensor"] for r in results))
    lines = [
        "# Rigs with hidden imperfections, calibrated",
        "",
        f"Written by `{command}`: {len(results)} rigs of the independent engine, recorded with "
        "the plate empty and with a known spring. A value that was not found counts as an error "
        f"beyond the limit. The torque sensor was described rightly (a mode, a lag or neither) in "
        f"{_share(right, len(results))}.",
        "",
        "| value | rigs | error, median (largest) | within | share, 95 % interval | truth within "
        "1.96 standard errors |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for key, goal in GOALS.items():
        asked = [r for r in results if key in r["truth"]]
        errors = np.array([_error(r, key, goal) for r in asked])
        covered = [
            abs(r["found"][key][0] - r["truth"][key]) <= WIDTH * r["found"][key][1]
            for r in asked
            if key in r["found"]
        ]
        known = errors[np.isfinite(errors)]
        sizes = f"{np.median(known):.2g} ({known.max():.2g}) {goal.unit}" if len(known) else "-"
        held = int(np.sum(errors <= goal.limit))
        lines.append(
            f"| {goal.name} | {len(asked)} | {sizes} | {goal.limit:g} {goal.unit} | "
            f"{_share(held, len(asked))} | {_share(sum(covered), len(covered))} |"
        )
    lines += ["", "Every rig:", "", "| sensor: hidden, found | errors | refused |"]
    lines += ["| --- | --- | --- |"]
    for result in results:
        cells = [
            f"{goal.name} {_error(result, key, goal):.2g} {goal.unit}"
            for key, goal in GOALS.items()
            if key in result["truth"] and key in result["found"]
        ]
        hidden, found = result["sensor"]
        lines.append(
            f"| {hidden}, {found or 'none'} | {'; '.join(cells)} | {result['failure'] or '-'} |"
        )
    return "\n".join(lines) + "\n"


def _error(result: dict[str, Any], key: str, goal: Goal) -> float:
    if key not in result["found"]:
        return math.inf
    truth = result["truth"][key]
    off = abs(result["found"][key][0] - truth)
    return float(1e3 * off if goal.unit == "ms" else 100.0 * off / truth)


def _share(count: int, total: int) -> str:
    if not total:
        return "-"
    interval = stats.binomtest(count, total).proportion_ci(method="exact")
    return (
        f"{count} of {total} = {100.0 * count / total:.0f} % [{100.0 * interval.low:.0f}, "
        f"{100.0 * interval.high:.0f}]"
    )


def main() -> None:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rigs", type=int, default=40)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    results = []
    for number in range(options.rigs):
        rig = draw(number, options.seed)
        results.append(calibrated(rig))
        print(f"{number + 1} of {options.rigs}: {rig.sensor}", file=sys.stderr, flush=True)
    command = ".venv/bin/python -m simulation_study.rig_calibration_study "
    text = report(results, f"{command}--rigs {options.rigs} --seed {options.seed} --out FOLDER")
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "rig_calibration.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
