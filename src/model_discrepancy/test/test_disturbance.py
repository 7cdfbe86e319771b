"""What a servo that gives way lets into the movement is told from physics that the model lacks."""

from datetime import datetime, timezone

import pytest

from ankle_physics.model import PAPER_TERMS, Model
from ankle_physics.rig_file import RigFile
from ankle_physics.virtual_rig import simulate
from model_discrepancy.problem import prepare
from model_discrepancy.recording.recording import Recording
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE = 1024.0
PLATE, SERVO = 0.004, 2000.0
STRAPS = {"k_s": 1000.0, "b_s": 1.4}


def test_straps_on_a_servo_that_gives_way_are_found_as_they_are():
    """What they do to the torque, which moves the plate too, is no voluntary torque."""
    model = Model.of(
        {
            **{name: {} for name in PAPER_TERMS},
            "fixation_compliance": STRAPS,
            "footplate_inertia": {"Ip": PLATE},
            "servo_compliance": {"k_a": SERVO},
            "voluntary_torque": {},
        }
    )
    reference = PulseStep(Settings(rate=RATE, seed=4)).next(int(40 * RATE))
    made = simulate(reference, RATE, model, seed=4)
    recording = Recording(
        RATE, made.position, made.torque, made.velocity, reference[:, 0], name="straps"
    )
    rig = RigFile(
        "known",
        datetime(2026, 1, 1, tzinfo=timezone.utc),
        model=Model.of({"footplate_inertia": {"Ip": PLATE}}),
    )
    problem = prepare(recording, rig=rig)
    terms = [*problem.base.terms, "fixation_compliance"]
    start = {**problem.base.values, "fixation_compliance": {"k_s": 2000.0, "b_s": 2.0}}
    found = problem.fitter.fit(terms, start).values["fixation_compliance"]
    assert found["k_s"] == pytest.approx(STRAPS["k_s"], rel=0.03)
    assert found["b_s"] == pytest.approx(STRAPS["b_s"], rel=0.06)
