"""The model of a calibration is handed to the estimator, and the session waits until it is used."""

from threading import current_thread
from unittest.mock import Mock

import pytest
from calibrated_session import NAME, CalibratedSession
from laboratory import until

from ankle_physics import term
from ankle_physics.model import Model
from biofeedback.errors import CommandError
from biofeedback.session.check_list import DONE, FAILED, RUNNING
from biofeedback.session.estimator_model import ModelOfEstimator, stated_model
from biofeedback.session.session_calibration_step import TAKEOVER_PATIENCE


def test_the_baseline_waits_until_the_estimator_uses_the_model(visit):
    visit.diagnose()
    visit.pass_time(TAKEOVER_PATIENCE / 2)
    assert visit.session.step.kind == "calibration"
    state, shown = visit.check
    assert state == RUNNING
    assert "waiting for the estimator to go on with the model, 60 s so far" in shown["progress"]
    with pytest.raises(CommandError, match="once the estimator uses the new model; 'Skip'"):
        visit.command("next")
    visit.estimator.confirmed = True
    visit.pass_time(0.1)
    assert visit.check[0] == DONE
    assert visit.session.step.kind == "baseline"


def test_an_estimator_that_does_not_take_the_model_is_named_and_can_be_left_without(visit):
    reason = {"estimate": "not valid: no excitation in the memory"}
    visit.signals.feed_status("impedance_estimator", 0, "running", reason, visit.now)
    visit.diagnose()
    visit.pass_time(TAKEOVER_PATIENCE + 1.0)
    assert visit.session.step.kind == "calibration"
    state, shown = visit.check
    assert state == FAILED
    assert "does not go on with the model after 120 s" in shown["problem"]
    assert "are not valid: no excitation in the memory" in shown["problem"]
    assert "skip to go on without" in shown["problem"]
    assert [event.event for event in visit.events].count("check failed") == 1
    visit.command("check", check=NAME, act="skip")
    visit.pass_time(0.1)
    assert visit.session.step.kind == "baseline"
    assert visit.estimator.handed[-1] is None  # it must not take over in the middle of a hold


def test_a_model_that_is_used_late_counts(visit):
    visit.diagnose()
    visit.pass_time(TAKEOVER_PATIENCE + 1.0)
    assert visit.check[0] == FAILED
    visit.estimator.confirmed = True
    visit.pass_time(0.1)
    assert visit.check[0] == DONE
    assert visit.session.step.kind == "baseline"


def test_time_without_perturbation_is_no_time_for_the_estimator(visit):
    visit.diagnose()
    visit.pass_time(TAKEOVER_PATIENCE - 10.0)
    visit.command("stop")
    visit.pass_time(300.0)
    assert visit.check[0] == RUNNING
    visit.command("arm")
    visit.command("start")
    visit.pass_time(5.0)
    assert visit.check[0] == RUNNING
    assert visit.calibration.begun == [90.0]  # what is diagnosed is not recorded again
    visit.pass_time(10.0)
    assert visit.check[0] == FAILED
    visit.command("stop")
    visit.pass_time(0.1)
    visit.command("arm")
    visit.command("start")
    visit.pass_time(1.0)
    assert visit.check[0] == RUNNING
    assert visit.estimator.handed == 2 * [visit.calibration.model]


@pytest.mark.parametrize("field", ["problem", "refusal"])
def test_an_estimator_that_refuses_says_why(visit, field):
    setattr(visit.estimator, field, "no node 'impedance_estimator' answers")
    visit.diagnose()
    assert visit.check[0] == FAILED
    assert "no node 'impedance_estimator' answers" in visit.check[1]["problem"]
    assert visit.session.step.kind == "calibration"


def test_a_model_from_a_file_counts_once_the_estimator_uses_it(tmp_path):
    visit = CalibratedSession(tmp_path, {NAME: lambda: {"terms": "stiffness"}})
    assert visit.check == (DONE, {"terms": "stiffness"})
    visit.estimator.at_once = False
    visit.start()
    assert visit.session.step.kind == "calibration"
    assert visit.check[0] == RUNNING
    assert visit.calibration.begun == []
    visit.estimator.confirmed = True
    visit.pass_time(0.1)
    assert visit.check == (DONE, {"terms": "stiffness", "estimator": "goes on with this model"})
    assert visit.session.step.kind == "baseline"


def test_the_estimators_own_words_say_which_model_it_uses(tmp_path):
    from impedance_estimator.known_physics import KnownPhysics
    from impedance_estimator.provenance import provenance
    from impedance_estimator.stream import EstimateStream

    path = tmp_path / "S07.yaml"
    Model.of(title="S07").save(path)
    known = KnownPhysics(None, Model.load(path))
    assert stated_model(provenance(EstimateStream(known=known))) == Model.load(path).sha256
    assert stated_model(provenance(EstimateStream())) == ""
    assert stated_model("algorithm: simultaneous") is None
    assert stated_model("[") is None


def test_terms_are_loaded_beside_the_session_while_it_is_calibrated(monkeypatch):
    loaded = []
    monkeypatch.setattr(term, "term_library", lambda: loaded.append(current_thread()))
    ModelOfEstimator(Mock()).prepare()
    until(lambda: loaded, "loaded")
    assert loaded != [current_thread()]


@pytest.mark.live
def test_a_node_that_has_the_models_path_already_receives_its_new_content(tmp_path):
    import rclpy
    from rcl_interfaces.msg import SetParametersResult
    from rclpy.executors import SingleThreadedExecutor
    from std_msgs.msg import String

    from ankle_interfaces.topics import IMPEDANCE_PROVENANCE
    from ankle_node.qos import publisher_qos

    context = rclpy.Context()
    context.init()
    estimator = rclpy.create_node("impedance_estimator", context=context)
    pages = rclpy.create_node("pages", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(estimator)
    executor.add_node(pages)
    given = []
    estimator.add_on_set_parameters_callback(
        lambda changes: (
            given.extend(change.value for change in changes),
            SetParametersResult(successful=True),
        )[1]
    )
    estimator.declare_parameter("model", "")
    given.clear()
    stated = estimator.create_publisher(
        String, IMPEDANCE_PROVENANCE.name, publisher_qos(IMPEDANCE_PROVENANCE)
    )
    model = ModelOfEstimator(pages)

    def spin(condition):
        until(lambda: (executor.spin_once(timeout_sec=0.05), condition())[1], "received", 20.0)

    try:
        path = tmp_path / "S07.yaml"
        for stiffness in (80.0, 120.0):
            Model.of({"stiffness": {"K": stiffness}}).save(path)
            spin(lambda: model._client.service_is_ready())
            model.hand_over(path)
            assert not model.confirmed
            spin(lambda: len(given) == 2)
            assert given == ["", str(path)]
            given.clear()
            stated.publish(String(data=f"model: {{sha256: {Model.load(path).sha256}}}"))
            spin(lambda: model.confirmed)
        assert model.refusal == ""
        with pytest.raises(CommandError, match=r"nothing\.yaml"):
            model.hand_over(tmp_path / "nothing.yaml")
        assert not model.confirmed
        estimator.add_on_set_parameters_callback(
            lambda changes: SetParametersResult(successful=False, reason="no such term")
        )
        model.hand_over(None)
        spin(lambda: model.refusal == "no such term")
    finally:
        executor.shutdown()
        pages.destroy_node()
        estimator.destroy_node()
        context.try_shutdown()
