"""A rig that its file describes, and its samples of a joint on a plate that moves at random."""

from datetime import datetime, timezone

import numpy as np
from random_motion import random_motion

from ankle_physics.model import Model
from ankle_physics.rig_file import Measured, RigFile
from ankle_physics.signals import Signals
from impedance_estimator.estimator import SampleLayout

RATE = 2048.0
LAYOUT = SampleLayout(RATE, True)


def motion(seconds=8.0):
    return random_motion(RATE, seconds)


def samples_of(model, x, v, a):
    signals = Signals(RATE, x, v, a)
    torque = model.start(RATE).torque(signals)
    return np.column_stack([np.arange(len(x)) / RATE, signals.measured_position, v, torque])


def rig(terms, delay=0.0):
    return RigFile(
        "test",
        datetime(2026, 1, 1, tzinfo=timezone.utc),
        torque_delay=Measured(delay),
        model=Model.of(terms),
    )
