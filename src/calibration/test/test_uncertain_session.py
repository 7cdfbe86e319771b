"""A subject's model that knows less than no model is refused."""

from datetime import datetime, timezone

import pytest

from ankle_physics.model import Model, StatedValue
from ankle_physics.rig_file import Measured, RigFile
from ankle_physics.virtual_rig import simulate
from calibration import session_calibration
from calibration.errors import CalibrationError
from calibration.session_calibration import (
    CalibratedSession,
    calibrate_session,
    require_gain,
    rig_contradictions,
)
from model_discrepancy.recording.recording import Recording
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE = 2048.0
CORE = {
    "inertia": {"I": 0.0137},
    "viscosity": {"B": 0.63},
    "stiffness": {"K": 100.0},
    "reflex": {"G": 10.0},
}


def recorded(extra):
    reference = PulseStep(Settings(rate=RATE)).next(round(20.0 * RATE))
    made = simulate(reference, RATE, Model.of({**CORE, **extra, "voluntary_torque": {}}), seed=1)
    return Recording(
        RATE, made.position, made.torque, made.velocity, reference[:, 0], name="visit 2"
    )


@pytest.fixture(scope="module")
def plain():
    return recorded({})


def test_a_calibrated_session_says_where_its_values_hold(plain, tmp_path, monkeypatch):
    # Nothing is missing, so that few terms say as much as all.
    few = ["channel_skew", "maxwell_relaxation"]
    monkeypatch.setattr(session_calibration, "session_library", lambda _: few)
    model = calibrate_session(plain, tmp_path).model
    model.save(tmp_path / "subject.yaml")
    again = Model.load(tmp_path / "subject.yaml")
    assert set(again.stated) == {"K", "G"}
    at = again.stated_at
    assert at.position == pytest.approx(plain.position.mean(), abs=1e-3)
    assert at.torque == pytest.approx(plain.torque.mean(), abs=0.1)
    assert at.time == pytest.approx(10.0, abs=0.1)


def stated(K_error, G_error, verdict="explained", error_cut=0.2):
    model = Model.of(CORE)
    model.stated = {"K": StatedValue(100.0, K_error), "G": StatedValue(10.0, G_error)}
    return CalibratedSession(model, {"verdict": verdict}, error_cut)


def test_a_model_with_which_k_is_open_is_refused_where_the_estimator_knows_it(plain):
    with pytest.raises(
        CalibrationError,
        match=r"visit 2 cannot calibrate.*error is 60 % of K and 5 % of G, without",
    ):
        require_gain(stated(60.0, 0.5), plain)
    with pytest.raises(CalibrationError, match="2 % of K and 50 % of G"):
        require_gain(stated(2.0, 5.0), plain)


def test_a_model_that_explains_most_of_the_error_is_kept(plain):
    require_gain(stated(60.0, 5.0, error_cut=0.8), plain)
    for less in (stated(60.0, 5.0, error_cut=0.4), stated(60.0, 5.0, "unexplained", 0.8)):
        with pytest.raises(CalibrationError):
            require_gain(less, plain)


def test_a_model_that_leaves_most_unexplained_is_refused_however_small_its_errors(plain):
    with pytest.raises(CalibrationError, match=r"'unexplained'.*take off 20\.0 % .*less than 50 %"):
        require_gain(stated(2.0, 0.2, "unexplained", 0.2), plain)
    require_gain(stated(2.0, 0.2, "unexplained", 0.8), plain)


def test_a_model_whose_estimates_are_not_doubted_is_kept(plain):
    require_gain(stated(12.0, 1.0), plain)
    require_gain(CalibratedSession(Model.of(CORE), {"verdict": "no_mismatch"}), plain)


def test_an_uncertain_model_is_kept_where_the_estimator_without_it_knows_less():
    relaxing = recorded({"maxwell_relaxation": {"k": 40.0}})
    require_gain(stated(15.0, 1.0), relaxing)
    with pytest.raises(CalibrationError):
        require_gain(stated(60.0, 1.0), relaxing)


def test_a_stiffness_that_friction_raises_does_not_make_its_error_a_smaller_one():
    """The estimate without the model is 40 % too high, and its error a smaller share of it."""
    rubbing = recorded({"dahl_hysteresis": {"F": 2.0, "slide": 0.004}})
    require_gain(stated(28.0, 1.0), rubbing)
    with pytest.raises(CalibrationError):
        require_gain(stated(60.0, 1.0), rubbing)


def test_a_rig_file_is_held_against_the_recording_of_a_session(plain):
    date = datetime(2020, 1, 1, tzinfo=timezone.utc)
    assert rig_contradictions(plain, RigFile("this one, of long ago", date)) == []
    other = RigFile("another one", date, velocity_delay=Measured(0.0003))
    (sentence,) = rig_contradictions(plain, other)
    assert "calibrated were 0.30 ms" in sentence
