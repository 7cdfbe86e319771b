"""Recordings of the calibrated study: a rig with its plate empty, and a subject on it.

The subject's recording is cut in two: a session is calibrated on the first part, and estimated
online in the second one, whose truth is kept.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

import numpy as np

from ankle_physics.rig_file import RigFile
from blind_rig.empty_plate import record_empty_plate
from blind_rig.impedance import true_impedance
from blind_rig.magnitudes import MAGNITUDES
from blind_rig.trial import STEPS_PER_SAMPLE, Trial, record, run
from calibration.known_load import KnownLoad
from calibration.rig_calibration import rig_file
from calibration.rig_identification import identify_rig
from calibration.rig_spectra import Signals
from model_discrepancy.recording.recording import Recording
from perturbation_generator.rig_calibration import DURATION, RigCalibration
from perturbation_generator.settings import Settings
from simulation_study.robustness.conditions import (
    NO_MISMATCH,
    SERVOS,
    USUAL_VARIATION,
    VOLUNTARY_TORQUES,
    Condition,
    blind_trial,
)
from simulation_study.robustness.recordings import MEMORIES

STREAM = 59
"""Labels the seeds of this study, so that they are not those of any other."""
CALIBRATION_DURATION = 60.0
"""[s] Of the session calibration, and of the online estimate behind it."""
JUDGED_AFTER = 30.0
"""[s] Estimates of the first seconds are ignored, as in the robustness study."""
SNAPSHOTS = (45.0, 60.0)
"""[s] Standard errors are judged at these times of the part behind the calibration."""
MEAN_LAG = 0.5 * MEMORIES[0]
"""[s] An estimate lies so far behind on average; the truth is that of the samples which it stands
for."""
CALIBRATION_AMPLITUDE = 0.04
"""[rad] The command of `ankle calibrate rig` unless another one is given."""
CALIBRATION_DATE = datetime(2026, 1, 1, tzinfo=timezone.utc)
"""Written into the rig files, so that the same seed gives the same files."""
NULL_SHARE = 5
"""Every fifth recording has no mismatch."""
EFFECTS = (
    "strap",
    "bearing_friction",
    "soft_shaft",
    "torque_sensor_mode",
    "torque_delay",
    "torque_lag",
    "maxwell",
    "short_range_stiffness",
    "tissue_friction",
    "position_stiffness",
    "hardening",
    "asymmetric_damping",
    "tendon",
    "reflex_depression",
    "reflex_position",
    "antagonist_reflex",
    "late_reflex",
    "length_reflex",
)
"""Effects of rig and joint that stay as they are from the calibration to the estimate."""


@dataclass(frozen=True)
class Session:
    """Describes one recording of the study.

    Attributes
    ----------
    empty
        The rig with its plate empty.
    subject
        The subject on the same rig, `CALIBRATION_DURATION` of calibration and as much behind it.
    truth
        K [N.m/rad] and G [N.m.s/rad] of the stretch that is judged.
    momentary
        The same over the estimator's memory before each of `SNAPSHOTS`, shape (snapshots, 2): K of
        a joint that hardens follows the mean angle of the memory.
    """

    empty: Signals
    subject: Recording
    truth: tuple[float, float]
    momentary: np.ndarray

    def part(self, second: bool) -> Recording:
        """Return the part for the calibration, or the one behind it."""
        middle = round(CALIBRATION_DURATION * self.subject.rate)
        span = slice(middle, None) if second else slice(0, middle)
        s = self.subject
        assert s.velocity is not None
        assert s.reference is not None
        return Recording(
            s.rate,
            s.position[span],
            s.torque[span],
            s.velocity[span],
            s.reference[span],
            name=s.name,
        )

    def rig(self) -> RigFile:
        """Return the rig file that the recording with the plate empty gives.

        Raises
        ------
        calibration.errors.CalibrationError
            The rig could not be identified.
        """
        found = identify_rig(self.empty)
        angle = float(np.mean(self.empty.position))
        rig, _ = rig_file(found, "blind rig", KnownLoad(), angle=angle, now=CALIBRATION_DATE)
        return rig


def sessions(count: int, seed: int, effects: Sequence[str] = EFFECTS) -> list[Condition]:
    """Return the conditions of a study: effects in turn at strengths that are drawn.

    Parameters
    ----------
    count
        Number of recordings; those of a smaller count are the first ones of a larger one.
    seed
        Draws effects, strengths, servos, voluntary torque and subjects.
    effects
        Names in `MAGNITUDES`.
    """
    random = np.random.default_rng([STREAM, seed])
    order = list(random.permutation(effects))
    found = []
    for k in range(count):
        null = k % NULL_SHARE == NULL_SHARE - 1
        effect = NO_MISMATCH if null else str(order[(k - k // NULL_SHARE) % len(order)])
        strength = "" if null else str(random.choice(["weak", "moderate", "strong"]))
        found.append(
            Condition(
                f"{k:03d}_{effect.replace(' ', '_')}_{strength}".rstrip("_"),
                effect,
                strength,
                str(random.choice(list(SERVOS))),
                str(random.choice(list(VOLUNTARY_TORQUES))),
                USUAL_VARIATION,
                (1.0, 1.0),
                int(random.integers(2**62)),
                2.0 * CALIBRATION_DURATION,
            )
        )
    assert all(effect in MAGNITUDES for effect in effects)
    return found


def session(condition: Condition, folder: Path) -> Session:
    """Return the recording of a condition, simulated where the folder does not hold it yet.

    Raises
    ------
    FloatingPointError
        The simulation diverged.
    """
    file = folder / f"{condition.name}.npz"
    if not file.exists():
        _write(file, _simulate(condition))
    with np.load(file) as kept:
        rate, K, G = json.loads(str(kept["numbers"]))
        empty, subject = kept["empty"].astype(float), kept["subject"].astype(float)
        momentary = kept["momentary"]
    return Session(
        Signals(rate, empty[0], empty[1], empty[2], empty[3]),
        Recording(rate, subject[0], subject[2], subject[1], subject[3], name=condition.name),
        (K, G),
        momentary,
    )


def _simulate(condition: Condition) -> Session:
    trial = blind_trial(condition)
    done = run(trial)
    samples = record(trial, done)
    first = CALIBRATION_DURATION + JUDGED_AFTER - MEAN_LAG
    truth = true_impedance(trial, done, first, condition.seconds - MEAN_LAG)
    ends = CALIBRATION_DURATION + np.array(SNAPSHOTS)
    momentary = [true_impedance(trial, done, end - MEMORIES[0], end) for end in ends]
    plate = record_empty_plate(trial, _calibration_command(trial))
    reference = plate.reference[:, 0]
    return Session(
        Signals(trial.rate, plate.position, plate.velocity, plate.torque, reference),
        Recording(
            trial.rate,
            samples.position,
            samples.torque,
            samples.velocity,
            samples.reference[:, 0],
            name=condition.name,
        ),
        (truth.K, truth.G),
        np.array([[one.K, one.G] for one in momentary]),
    )


def _calibration_command(trial: Trial) -> np.ndarray:
    """Return the reference of a rig calibration at the simulation's rate [rad]."""
    rate = trial.rate * STEPS_PER_SAMPLE[trial.rate]
    settings = Settings(
        rate=rate,
        amplitude=CALIBRATION_AMPLITUDE,
        seed=trial.seed % 2**31,
        direction="both",
    )
    return np.asarray(RigCalibration(settings).next(int(DURATION * rate))[:, 0])


def _write(file: Path, made: Session) -> None:
    """Write single precision: its rounding lies a thousand times below the sensors' noise."""
    file.parent.mkdir(parents=True, exist_ok=True)
    unfinished = file.with_suffix(f".{os.getpid()}.part")
    e, s = made.empty, made.subject
    with unfinished.open("wb") as stream:
        np.savez(
            stream,
            numbers=json.dumps([s.rate, *made.truth]),
            momentary=made.momentary,
            empty=np.array([e.position, e.velocity, e.torque, e.reference], dtype=np.float32),
            subject=np.array([s.position, s.velocity, s.torque, s.reference], dtype=np.float32),
        )
    os.replace(unfinished, file)
