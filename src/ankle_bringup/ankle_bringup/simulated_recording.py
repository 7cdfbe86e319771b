"""Bags of the simulated rig, made faster than real time by the simulation that `ankle_sim` runs."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import numpy as np

from ankle_interfaces.block import Block
from ankle_interfaces.topics import ANKLE_SAMPLES, PERTURBATION_REFERENCE, Topic
from ankle_physics.actuator import Servo
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import SignalToNoise
from ankle_sim.live_rig import LiveRig, Setup
from perturbation_generator.signal import Signal
from session_recorder.bag_writer import BagWriter

SAMPLES_A_MESSAGE = 1024
"""Half a second at 2048 Hz: nobody waits for these blocks, and few of them are read fast."""


def record_simulated_rig(
    bag: Path,
    rig: RigFile,
    subject: Model,
    signal: Signal,
    started: datetime,
    progress: Callable[[float], None] = lambda _: None,
) -> None:
    """Record what a simulated rig makes of a whole signal.

    Parameters
    ----------
    bag
        The new bag.
    rig
        The rig with its plate, servo, delays and noise.
    subject
        What is on the plate; a model without terms leaves it empty.
    signal
        The perturbation; it has a duration.
    started
        Time of the first sample.
    progress
        Called with the done share, 0 to 1.

    Raises
    ------
    session_recorder.errors.BagError
        The bag cannot be written.
    """
    settings = signal.settings
    assert settings.samples is not None
    model, noise_amplitude = rig.twin(subject), settings.amplitude
    setup = Setup(
        model, Servo(), SignalToNoise(), Scenario([]), noise_amplitude, settings.seed, rig
    )
    simulation = LiveRig(setup, lambda _: None)
    with BagWriter(bag) as writer:
        for topic in (PERTURBATION_REFERENCE, ANKLE_SAMPLES):
            writer.add_topic(topic.absolute, topic.message)
        for first in range(0, settings.samples, SAMPLES_A_MESSAGE):
            count = min(SAMPLES_A_MESSAGE, settings.samples - first)
            time = started.timestamp() + np.arange(first, first + count) / settings.rate
            reference = signal.next(count)
            _write(writer, time, reference, PERTURBATION_REFERENCE)
            for stretch in simulation.take(time, reference):
                _write(writer, stretch.time, stretch.samples, ANKLE_SAMPLES)
            progress((first + count) / settings.samples)


def _write(writer: BagWriter, time: np.ndarray, values: np.ndarray, topic: Topic) -> None:
    rows = np.column_stack([time, values])
    writer.write_block(topic.absolute, Block(topic.columns_of(rows.shape[1]), rows))
