"""Effects of the independent rig, planted in recorded human trials.

The rig of `blind_rig` moves a drawn subject along the measured angle, once without and once with
the effect. The difference of the torque that its cell reads is scaled and added to the recorded
torque: the effect follows the movement of a real trial, and none of its equations is the library's.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import butter, resample_poly, sosfiltfilt

from blind_rig.magnitudes import brought_in
from blind_rig.protocols import Protocol, edge, onset_times
from blind_rig.subjects import OPERATING_ANGLE, draw_subject
from blind_rig.trial import Movement, Trial, record, run, simulation_rate
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.base_model import fit_base
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.recording.motion import motion_of
from model_discrepancy.recording.recording import Recording
from simulation_study.planted_in_human import Planted, held_torque, with_torque

# The rig samples at this rate [Hz], which is that of the recorded trials.
RIG_RATE = 1000.0
# Above it the measured angle holds noise rather than movement [Hz].
MOVEMENT_HZ = 80.0
# The drive follows the measured angle; its own lag is taken off the command.
DRIVE_HZ, DRIVE_ZETA = 150.0, 0.7
# The plate begins at rest, and reaches the measured movement within this time [s].
BEGIN_S = 0.5
# No torque and no noise of its own: the recorded trial has both already.
QUIET = {
    "sensors.torque_snr": 200.0,
    "courses.voluntary_rms": 0.0,
    "courses.tremor_rms": 0.0,
    "courses.stretch_variation": 0.0,
    "rig.drive_hz": DRIVE_HZ,
    "rig.drive_zeta": DRIVE_ZETA,
    "rig.servo_k": 0.0,
}


def plant_effect(recording: Recording, effect: str, seed: int) -> Planted:
    """Return the trial with the torque that an effect of the independent rig adds on its movement,
    scaled as `planted_in_human.plant` does.

    Parameters
    ----------
    recording
        A human trial at `RIG_RATE`.
    effect
        Name of an effect of `blind_rig`.
    seed
        Draws the subject.

    Raises
    ------
    DiagnosisError
        The trial has another rate, or the effect changes no torque on this movement.
    """
    return with_torque(recording, added_torque(recording, effect, seed), effect)


def added_torque(recording: Recording, effect: str, seed: int) -> np.ndarray:
    """Return the torque that a moderate effect adds on the trial's movement [N.m], shape (n,),
    without its mean.

    Parameters
    ----------
    recording, effect, seed
        As `plant_effect`.

    Raises
    ------
    DiagnosisError
        As `plant_effect`.
    """
    if recording.rate != RIG_RATE:
        raise DiagnosisError(f"a trial at {recording.rate:g} Hz; {RIG_RATE:g} Hz is needed")
    generator = np.random.default_rng(seed)
    motion = motion_of(recording)
    times = np.arange(len(recording.torque)) / RIG_RATE
    slow = np.interp(times, motion.time, held_torque(motion, fit_base(Fitter.of(motion))))
    level = float(np.mean(slow))
    setup = draw_subject(generator).replaced({**QUIET, "courses.torque_level": level})
    seconds = len(recording.torque) / RIG_RATE
    # The protocol is that of the trial that makes up for what a nonlinear reflex takes.
    trial = Trial(
        setup,
        Protocol("random_levels", float(np.ptp(recording.position)), 0.024, seconds),
        RIG_RATE,
        float(generator.uniform(*OPERATING_ANGLE)),
        int(generator.integers(2**62)),
    )
    movement = movement_of(recording, slow - level, simulation_rate(trial))
    without, with_effect = (
        record(one, run(one, movement=movement)).torque
        for one in (trial, brought_in(trial, effect, "moderate"))
    )
    begun = edge(np.arange(len(without)) / RIG_RATE / BEGIN_S)
    added = begun * (with_effect - without)
    if np.std(added) == 0.0:
        raise DiagnosisError(f"{effect} changes no torque on this movement")
    return added - np.mean(added)


def movement_of(recording: Recording, task: np.ndarray, rate: float) -> Movement:
    """Return the command that lets the plate follow the measured angle.

    Parameters
    ----------
    recording
        Whose angle is followed.
    task
        Torque that the subject holds beside its level [N.m], shape (n,).
    rate
        Steps per second of the simulation [Hz].
    """
    times = round(rate / recording.rate)
    angle = recording.position - np.mean(recording.position)
    x = resample_poly(angle, times, 1, padtype="line")
    x = sosfiltfilt(butter(4, MOVEMENT_HZ, fs=rate, output="sos"), x)
    x = x[0] + edge(np.arange(len(x)) / rate / BEGIN_S) * (x - x[0])
    v = np.gradient(x, 1.0 / rate)
    a = np.gradient(v, 1.0 / rate)
    omega = 2.0 * math.pi * DRIVE_HZ
    command = x + 2.0 * DRIVE_ZETA / omega * v + a / omega**2
    held = np.repeat(task, times)
    return Movement(command, onset_times(v, rate), held)
