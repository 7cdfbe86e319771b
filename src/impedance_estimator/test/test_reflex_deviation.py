"""What a free reflex response adds to that of a muscle is stated beside G."""

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.virtual_rig import simulate
from impedance_estimator.stream import EstimateStream
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE, SECONDS = 2048.0, 30.0
CORE = {
    "inertia": {"I": 0.0137},
    "viscosity": {"B": 0.63},
    "stiffness": {"K": 100.0},
    "reflex": {"G": 10.0},
    "voluntary_torque": {},
}


def estimated(extra, algorithm="simultaneous"):
    reference = PulseStep(Settings(rate=RATE)).next(round(SECONDS * RATE))
    recording = simulate(reference, RATE, Model.of({**CORE, **extra}), seed=1)
    stream = EstimateStream(algorithm)
    samples = np.column_stack([recording.time, recording.measured])
    due = stream.feed_samples(samples, True, reference[:, 0])
    return stream, due


def test_a_muscles_reflex_leaves_no_deviation_and_ce_states_none():
    stream, due = estimated({})
    area, error = stream.estimator.reflex_deviation
    assert abs(area) < 3.0 * error < 1.0
    lag, _, deviation = due.responses[-1][1].T
    assert np.sum(deviation) * (lag[1] - lag[0]) == pytest.approx(area, abs=1e-9)
    assert f"{area:+.2f} ± {error:.2f} N.m.s/rad beside G" in stream.reflex_deviation
    stream, due = estimated({}, "CE")
    assert stream.reflex_deviation == ""
    assert np.isnan(due.responses[-1][1][:, 2]).all()


def test_a_late_reflex_stands_in_g_and_unmodelled_stiffness_in_the_deviation():
    stream, due = estimated({"long_latency_reflex": {"Gl": 3.0}})
    area, error = stream.estimator.reflex_deviation
    # Both reflexes together have 13 N.m.s/rad.
    assert due.rows[-1, 4] == pytest.approx(13.0, rel=0.04)
    assert abs(area) < 3.0 * error < 1.0
    # A free response would take up torque of a stiffness that grows with the angle.
    stream, due = estimated({"hardening_stiffness": {}})
    area, error = stream.estimator.reflex_deviation
    assert area > 4.0 * error
    assert due.rows[-1, 4] == pytest.approx(10.0, rel=0.08)
