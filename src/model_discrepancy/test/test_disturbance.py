"""What a servo that gives way lets into the movement is told from physics that the model lacks."""

from datetime import datetime, timezone

import numpy as np
import pytest

from ankle_physics.model import PAPER_TERMS, Model
from ankle_physics.rig_file import RigFile
from ankle_physics.virtual_rig import simulate
from model_discrepancy.problem import knows_movement_better, prepare
from model_discrepancy.recording.compliance import Compliance
from model_discrepancy.recording.recording import Recording
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE = 1024.0
PLATE, SERVO = 0.004, 2000.0
STRAPS = {"k_s": 1000.0, "b_s": 1.4}


@pytest.mark.slow
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
    reference = PulseStep(Settings(rate=RATE, seed=4)).next(int(28 * RATE))
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


@pytest.mark.slow
def test_physics_that_the_base_model_lacks_is_no_torque_that_moved_the_plate(monkeypatch):
    """Nobody pushes in this recording, so that the plate moved as it was measured."""
    model = Model.of(
        {
            **{name: {} for name in PAPER_TERMS},
            "fixation_compliance": STRAPS,
            "servo_compliance": {"k_a": SERVO},
        }
    )
    reference = PulseStep(Settings(rate=RATE, seed=6)).next(int(40 * RATE))
    made = simulate(reference, RATE, model, seed=6)
    recording = Recording(RATE, made.position, made.torque, name="straps")
    by_holds = prepare(recording)
    assert by_holds.compliance.precise
    # Where the holds do not tell the compliance well, the model that is found tells the movement.
    monkeypatch.setattr(Compliance, "precise", False)
    problem = prepare(recording)
    terms = [*problem.base.terms, "fixation_compliance"]
    start = {**problem.base.values, "fixation_compliance": {"k_s": 2000.0, "b_s": 2.0}}
    found = problem.fitter.fit(terms, start)
    assert knows_movement_better(problem, found)
    assert not knows_movement_better(problem, problem.base)
    clearer = prepare(recording, found=found)
    step = round(RATE / problem.fitter.motion.rate)

    def invented(position: np.ndarray) -> float:
        apart = position - made.clean[::step, 0]
        return float(np.std(apart))

    before = invented(problem.fitter.motion.position)
    assert invented(clearer.fitter.motion.position) < 0.4 * before
    assert invented(by_holds.fitter.motion.position) < 0.4 * before


@pytest.mark.parametrize(("stiffness", "moves"), [(2000.0, True), (50_000.0, False)])
def test_only_a_soft_servo_gives_way_so_far_that_it_matters(stiffness: float, moves: bool):
    """A stiff one gives way measurably, too, but not so far that it could be taken for physics."""
    model = Model.of(
        {
            **{name: {} for name in PAPER_TERMS},
            "servo_compliance": {"k_a": stiffness},
            "voluntary_torque": {},
        }
    )
    reference = PulseStep(Settings(rate=RATE, seed=5)).next(int(24 * RATE))
    made = simulate(reference, RATE, model, seed=5)
    problem = prepare(Recording(RATE, made.position, made.torque, name="servo"))
    assert problem.compliance is not None
    assert problem.compliance.significant
    assert 1.0 / problem.compliance.magnitude[0] == pytest.approx(stiffness, rel=0.2)
    assert problem.gives_way == moves
    # A rig's file tells the stiffness alone, and not how the servo answers at each frequency, which
    # a stiff one does not show.
    known = RigFile(
        "known",
        datetime(2026, 1, 1, tzinfo=timezone.utc),
        model=Model.of({"servo_compliance": {"k_a": 0.8 * stiffness}}),
    )
    beside = prepare(Recording(RATE, made.position, made.torque, name="servo"), rig=known)
    by_file = pytest.approx(1.0 / (0.8 * stiffness))
    by_holds = problem.compliance.magnitude[0]
    assert beside.compliance.magnitude[0] == (by_holds if moves else by_file)
    # The holds tell what torque did to the plate.
    assert not problem.in_a_loop
