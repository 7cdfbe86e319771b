"""Effects of the independent rig, planted in recorded human trials.

The rig of `blind_rig` moves a subject along the measured angle, once without and once with the
effect. The difference of the torque that its cell reads is added to the recorded torque: the effect
follows the movement of a real trial, and none of its equations is the library's. The subject has
stiffness, viscosity and reflex of the trial, so that an effect of the reflex changes this one.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import butter, resample_poly, sosfiltfilt

from blind_rig.effects import EFFECTS_BY_NAME, draw_shape
from blind_rig.protocols import Protocol, edge, onset_times
from blind_rig.strength import compensating_gain
from blind_rig.subjects import OPERATING_ANGLE, draw_subject
from blind_rig.trial import Movement, Trial, record, run, simulation_rate
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.parallel import side_by_side
from model_discrepancy.recording.recording import Recording
from simulation_study.planted_effect import MeasuredTrial, Planted

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


@side_by_side()
def plant_effect(recording: Recording, effect: str, seed: int) -> Planted:
    """Return the trial with the torque that an effect of the independent rig adds on its movement,
    brought to the strength that `planted_in_human.plant` gives a term.

    Parameters
    ----------
    recording
        A human trial at `RIG_RATE`.
    effect
        Name of an effect of `blind_rig`.
    seed
        Draws the rig, and what belongs to the effect.

    Raises
    ------
    DiagnosisError
        The trial has another rate, or the effect changes no torque on this movement.
    """
    if recording.rate != RIG_RATE:
        raise DiagnosisError(f"a trial at {recording.rate:g} Hz; {RIG_RATE:g} Hz is needed")
    known = EFFECTS_BY_NAME[effect]
    generator = np.random.default_rng(seed)
    measured = MeasuredTrial(recording)
    times = np.arange(len(recording.torque)) / RIG_RATE
    slow = np.interp(times, measured.motion.time, measured.held_torque)
    trial = _trial(measured, float(np.mean(slow)), generator)
    shape, (weak, strong) = draw_shape(known, generator)
    movement = movement_of(recording, slow - np.mean(slow), simulation_rate(trial))
    plain = run(trial, movement=movement)
    without = record(trial, plain).torque
    begun = edge(times / BEGIN_S)

    def added(magnitude: float) -> np.ndarray:
        """Return the torque that the effect adds [N.m], at the motion's rate, shape (n,)."""
        changes = {**shape, known.magnitude: magnitude}
        if known.keeps_reflex:
            changes["reflex.G"] = compensating_gain(trial, changes, plain)
        changed = trial._replace(setup=trial.setup.replaced(changes))
        torque = record(changed, run(changed, movement=movement)).torque
        return np.interp(measured.motion.time, times, begun * (torque - without))

    return measured.planted(effect, added, weak, strong)


def _trial(measured: MeasuredTrial, level: float, generator: np.random.Generator) -> Trial:
    """Return a trial of a drawn rig whose subject has stiffness, viscosity and reflex of a measured
    trial and holds its mean torque [N.m].
    """
    fitted = measured.base.values
    setup = draw_subject(generator).replaced(
        {
            **QUIET,
            "courses.torque_level": level,
            "muscle.K": fitted["stiffness"]["K"],
            "muscle.B": fitted["viscosity"]["B"],
            "reflex.G": fitted["reflex"]["G"],
            "reflex.delay": fitted["reflex"]["delay"],
            "reflex.omega": fitted["reflex"]["omega"],
            "reflex.zeta": fitted["reflex"]["z"],
        }
    )
    recording = measured.recording
    seconds = len(recording.torque) / RIG_RATE
    return Trial(
        setup,
        # The movement is the measured one; a protocol belongs to each trial.
        Protocol("random_levels", float(np.ptp(recording.position)), 0.024, seconds),
        RIG_RATE,
        float(generator.uniform(*OPERATING_ANGLE)),
        int(generator.integers(2**62)),
    )


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
