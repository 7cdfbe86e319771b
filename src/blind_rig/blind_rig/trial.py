"""A trial runs subject, rig and perturbation once and passes the result through the sensors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from blind_rig.anatomy import Setup
from blind_rig.courses import Course, course
from blind_rig.mechanics import Motion, simulate
from blind_rig.protocols import Protocol, command
from blind_rig.sensors import Reading, read, sample

# Steps per sample: at 8 kHz the mode of the torque cell (700 Hz) is integrated well within its
# stability limit.
STEPS_PER_SAMPLE = {1000.0: 8, 2048.0: 4}
# Between motoneuron and begin of torque (Cavanagh & Komi 1979: electromechanical delay) [s].
ELECTROMECHANICAL_DELAY = 0.010
# Surface EMG at low contraction: background [V rms], and per drive of the motoneurons [V.s/rad].
EMG_BACKGROUND, EMG_GAIN = 20e-6, 60e-6
# EMG per muscle: background, share of the triceps' drive, share of the antagonist's.
MUSCLES = {
    "SOL": (1.0, 1.0, 0.0),
    "TA": (0.5, 0.0, 1.0),
    "GL": (0.7, 0.6, 0.0),
    "GM": (0.8, 0.7, 0.0),
}


class Trial(NamedTuple):
    """Describes what is run.

    Attributes
    ----------
    setup
        Subject and rig with whatever effects.
    protocol
        Perturbation.
    rate
        Sampling rate [Hz], a key of `STEPS_PER_SAMPLE`.
    operating_angle
        Mean plate angle [rad].
    seed
        Of perturbation, voluntary torque, noise; the same seed with another setup is the same trial
        but for the setup.
    """

    setup: Setup
    protocol: Protocol
    rate: float
    operating_angle: float
    seed: int


class Movement(NamedTuple):
    """Holds a commanded movement at the simulation's rate, instead of a protocol.

    Attributes
    ----------
    angle
        About the operating angle [rad], shape (n,).
    onsets
        Times at which the plate begins to move [s].
    task
        Torque that the subject holds beside its level [N.m], shape (n,).
    """

    angle: np.ndarray
    onsets: np.ndarray
    task: np.ndarray


class Run(NamedTuple):
    """Holds a trial as it went, at the simulation's rate [Hz]: drive's reference [rad], motion,
    courses, sensor signals without noise.
    """

    rate: float
    command: np.ndarray
    motion: Motion
    course: Course
    reading: Reading


class Recording(NamedTuple):
    """Holds samples as a laboratory stores them.

    Attributes
    ----------
    time
        [s] from the first sample, shape (n,).
    position, velocity, torque
        [rad], [rad/s], [N.m], shape (n,).
    reference
        Position, velocity, acceleration of the command, shape (n, 3).
    emg
        Of `MUSCLES` [V], shape (n, 4).
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    torque: np.ndarray
    reference: np.ndarray
    emg: np.ndarray


def simulation_rate(trial: Trial) -> float:
    """Return the steps per second of a trial's simulation [Hz]."""
    return trial.rate * STEPS_PER_SAMPLE[trial.rate]


def run(trial: Trial, seconds: float | None = None, movement: Movement | None = None) -> Run:
    """Simulate a trial, or its first `seconds` only.

    Parameters
    ----------
    trial
        Subject, rig and seeds.
    seconds
        Of the protocol; None for all of it.
    movement
        Instead of the protocol's.
    """
    rate = simulation_rate(trial)
    perturbation_seed, course_seed, mains_seed = (
        int(s) for s in np.random.SeedSequence(trial.seed).generate_state(3)
    )
    if movement is None:
        angle, onsets = command(trial.protocol, np.random.default_rng(perturbation_seed), rate)
        task: np.ndarray | float = 0.0
    else:
        angle, onsets, task = movement
    if seconds is not None:
        angle = angle[: round(seconds * rate)]
    momentary = course(
        trial.setup, onsets[onsets < len(angle) / rate], len(angle), rate, course_seed, task
    )
    motion = simulate(
        trial.setup,
        angle,
        momentary.voluntary,
        momentary.muscle_scale,
        momentary.reflex_scale,
        momentary.delay,
        trial.operating_angle,
        rate,
    )
    return Run(rate, angle, motion, momentary, read(motion, trial.setup, rate, mains_seed))


def _emg(motion: Motion, rate: float, every: int, generator: np.random.Generator) -> np.ndarray:
    """Return the EMG of four muscles [V], shape (n, 4): noise whose amplitude follows background
    and drive.
    """
    ahead = round(ELECTROMECHANICAL_DELAY * rate)
    drives = [
        np.concatenate([signal[ahead:], np.zeros(ahead)])[::every]
        for signal in (motion.drive, motion.other_drive)
    ]
    channels = []
    for background, triceps, antagonist in MUSCLES.values():
        amplitude = EMG_BACKGROUND * background + EMG_GAIN * (
            triceps * drives[0] + antagonist * drives[1]
        )
        channels.append(amplitude * generator.standard_normal(len(amplitude)))
    return np.column_stack(channels)


def record(trial: Trial, done: Run) -> Recording:
    """Sample a run: anti-alias filter, decimation, noise."""
    every = STEPS_PER_SAMPLE[trial.rate]
    sensor_seed, emg_seed = (
        int(s) for s in np.random.SeedSequence(trial.seed).generate_state(5)[3:]
    )
    reading = sample(done.reading, trial.setup.sensors, done.rate, every, sensor_seed)
    velocity = np.gradient(done.command, 1.0 / done.rate)
    reference = np.column_stack([done.command, velocity, np.gradient(velocity, 1.0 / done.rate)])[
        ::every
    ]
    emg = _emg(done.motion, done.rate, every, np.random.default_rng(emg_seed))
    time = np.arange(len(reading.position)) / trial.rate
    return Recording(
        time,
        reading.position + trial.operating_angle,
        reading.velocity,
        reading.torque,
        reference,
        emg,
    )
