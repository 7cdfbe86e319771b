"""What estimates were made with: in force during the holds, kept where they are made anew, and
stated in report and table.
"""

import csv
import html
import io
from datetime import datetime, timezone
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from recorded_holds import PROVENANCE_TOPIC, TEXT, provenance, write_session, write_text
from rich.console import Console

from ankle_interfaces.block import Block
from ankle_interfaces.topics import IMPEDANCE_MODEL
from ankle_node.session_event import TOPIC as EVENT_TOPIC
from ankle_node.session_event import SessionEvent
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.rig_file import Measured, RigFile
from impedance_estimator.known_physics import KnownPhysics
from impedance_estimator.offline.recorded_estimates import estimate_bag
from impedance_estimator.provenance import provenance as provenance_of
from impedance_estimator.stream import EstimateStream
from session_analysis.console import report_validation
from session_analysis.errors import AnalysisError
from session_analysis.estimate_origin import Origin
from session_analysis.known_of_session import GivenPhysics, model_in_force, recorded_model
from session_analysis.recorded_session import LAG_KEY, read_session
from session_analysis.report import write_report
from session_analysis.validation import validate
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.rig_of_bag import RIG_KEY

BASELINE, CALIBRATED = provenance(), provenance("Monday", "plate")
MODEL = """model: Monday
terms:
  - {term: inertia, 'I[kg.m^2]': 0.0137}
  - {term: viscosity, 'B[N.m.s/rad]': 0.6}
  - {term: stiffness, 'K[N.m/rad]': 90.0}
"""


@pytest.fixture
def recorded(tmp_path):
    def write(name, *stated, **details):
        with BagWriter(tmp_path / name) as writer:
            write_session(writer, stated, **details)
        return tmp_path / name

    return write


def test_a_session_that_was_calibrated_while_the_estimator_ran_is_validated(recorded):
    bag = recorded("bag", (1.0, BASELINE), (90.0, CALIBRATED))
    (session,) = validate([bag]).sessions
    assert session.origin.model == {"title": "Monday", "sha256": "Monday00"}
    assert session.origin.shown("rig") == "'plate' (SHA-256 plate00)"


def test_what_was_stated_late_counts_from_the_beginning_and_what_comes_after_does_not(recorded):
    bag = recorded("bag", (110.0, CALIBRATED), (300.0, BASELINE))
    assert validate([bag]).sessions[0].origin.model["title"] == "Monday"


def test_a_recorded_replay_is_judged_by_the_times_of_its_session(recorded):
    bag = recorded("bag", (1.0, BASELINE), (90.0, CALIBRATED), lag=0.0042, delay=86400.0)
    (session,) = validate([bag]).sessions
    assert session.origin.model["title"] == "Monday"
    assert session.lag == pytest.approx(0.0042)


def test_a_change_of_the_model_within_a_hold_is_refused_and_so_is_one_between_holds(recorded):
    within = recorded("within", (1.0, BASELINE), (220.0, CALIBRATED))
    words = (
        r"within: model changes from none to 'Monday' \(SHA-256 Monday00\) within hold 2, at t = "
        r"220.0 s, 20.0 s after its start.*--recompute"
    )
    with pytest.raises(AnalysisError, match=words):
        validate([within])
    between = recorded("between", (1.0, BASELINE), (180.0, CALIBRATED))
    words = r"model is none in hold 1 and 'Monday' .* in hold 2, since t = 180.0 s"
    with pytest.raises(AnalysisError, match=words):
        validate([between])
    again = recorded("again", (1.0, CALIBRATED), (130.0, CALIBRATED))
    assert len(validate([again]).measures) == 2


def test_estimators_must_agree_between_sessions_and_calibrations_need_not(recorded):
    one = recorded("one", (1.0, CALIBRATED))
    other = recorded("other", (1.0, provenance("Tuesday", "plate")))
    found = validate([one, other], ["S1", "S2"])
    assert found.origin_notes == []
    # Each visit of a subject is calibrated anew; the report says so.
    (note,) = validate([one, other], ["S1", "S1"]).origin_notes
    assert note.startswith("S1: the model differs between the recordings: 'Monday' (SHA-256")
    assert f"in {one}; 'Tuesday' (SHA-256 Tuesday00) in {other}" in note
    memory = recorded("memory", (1.0, provenance(memory=10.0)))
    with pytest.raises(AnalysisError, match=r"settings is \{memory: 20.0\} in .*one and .*memory"):
        validate([one, memory], ["S1", "S2"])
    algorithm = recorded("CE", (1.0, provenance("Monday", "plate", "CE")))
    with pytest.raises(AnalysisError, match=r"algorithm is simultaneous in .*one and CE in .*CE"):
        validate([one, algorithm])
    # A session without a usable hold is no part of the comparison.
    unused = recorded("unused", (1.0, provenance(memory=10.0)), length=40.0)
    assert len(validate([one, unused], ["S1", "S2"]).measures) == 2


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("[1]", "is no table"),
        ("{algorithm: CE, model: null}", "does not state settings, rig"),
        ("{algorithm: CE, settings: {}, model: Monday, rig: null}", "model = 'Monday'; allowed"),
        ("{", "the origin of its estimates is"),
    ],
)
def test_an_origin_that_cannot_be_read_is_refused(line, words):
    with pytest.raises(AnalysisError, match=words):
        Origin.from_text(line, 0.0, Path("bag"))


def test_report_and_table_say_what_made_the_numbers_and_how_much_is_doubtful(recorded, tmp_path):
    calibrated = recorded("calibrated", (1.0, CALIBRATED), doubt=0.5, lag=0.0042)
    silent = recorded("silent", doubt=0.49)
    found = validate([calibrated, silent], ["S1", "S2"])
    assert [one.doubtful for one in found.measures] == [0.25, 0.25, 0.0, 0.0]
    text = write_report(found, tmp_path, "Test").read_text()
    assert (
        "with a doubt of 0.5 and more: in 2 of 4 holds; on average 12 % of a hold's estimates"
        in (html.unescape(text))
    )
    made = "simultaneous</td><td>&#x27;Monday&#x27; (SHA-256 Monday00)</td>"
    assert made in text
    assert "<td>4.2</td>" in text
    assert "<td>not stated</td>" in text
    with (tmp_path / "holds.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    stated = {key: rows[0][key] for key in ("algorithm", "model", "model_sha256", "rig")}
    assert stated == {
        "algorithm": "simultaneous", "model": "Monday", "model_sha256": "Monday00", "rig": "plate"
    }  # fmt: skip
    assert (rows[0]["doubtful[1]"], rows[0]["plate_lag[s]"]) == ("0.25", "0.0042")
    assert (rows[2]["algorithm"], rows[2]["plate_lag[s]"]) == ("not stated", "")
    none = recorded("baseline", (1.0, BASELINE))
    write_report(validate([none]), tmp_path, "Test")
    with (tmp_path / "holds.csv").open() as stream:
        assert next(csv.DictReader(stream))["rig"] == "none"


def test_the_lag_is_looked_for_under_the_key_that_the_node_states():
    assert LAG_KEY in Path(find_spec("emg_driver.emg_processor_node").origin).read_text()


@pytest.fixture
def samples(tmp_path):
    """Writes a bag of 12 s with what was in force, the rig that it carries, and EMG."""

    def write(rig, stated, folder="visit"):
        bag = tmp_path / folder / "bag"
        bag.parent.mkdir()
        time = np.arange(1.0, 13.0, 1 / 1024)
        motion = np.column_stack([time, *(np.sin(k * time) for k in (3.0, 5.0, 7.0))])
        noise = np.random.default_rng(1).normal(0.0, 1e-5, (len(time), 4))
        emg = np.column_stack([time, noise])
        names = ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")
        muscles = ("t[s]", "SOL[V]", "TA[V]", "GL[V]", "GM[V]")
        with BagWriter(bag) as writer:
            writer.custom_data = {} if rig is None else {RIG_KEY: rig.text()}
            for topic in ("/ankle/samples", "/emg/samples"):
                writer.add_topic(topic)
            for topic in (EVENT_TOPIC, PROVENANCE_TOPIC):
                writer.add_topic(topic, TEXT)
            write_text(writer, PROVENANCE_TOPIC, 1.0, stated)
            details = {"hold": 1, "torque_target[N.m]": 0.0}
            write_text(writer, EVENT_TOPIC, 2.0, SessionEvent("hold started", 2.0, details).line())
            for first in range(0, len(time), 32):
                rows = slice(first, first + 32)
                writer.write_block("/ankle/samples", Block(names, motion[rows]))
                writer.write_block("/emg/samples", Block(muscles, emg[rows]))
        return bag

    return write


@pytest.fixture
def calibration(tmp_path):
    """Model and rig of a session, and what an estimator with both states."""
    file = tmp_path / "calibrated.yaml"
    file.write_text(MODEL)
    model = Model.load(file)
    rig = RigFile("plate", datetime(2026, 1, 5, tzinfo=timezone.utc),
                  torque_delay=Measured(4e-4, 1e-5))  # fmt: skip
    return file, model, rig, provenance_of(EstimateStream("CE", None, KnownPhysics(rig, model)))


def test_estimates_that_are_made_anew_keep_model_and_rig_of_the_recording(samples, calibration):
    file, model, rig, stated = calibration
    bag = samples(rig, stated)
    file.rename(bag.parent / "sub-S1_ses-01_subject.yaml")
    session = read_session(bag, recompute=True, algorithm="CE")
    assert session.origins[0].model == {"title": "Monday", "sha256": model.sha256}
    assert session.origins[0].rig["title"] == "plate"
    assert session.made_anew
    assert session.origin_notes == ()
    (note,) = read_session(
        bag, recompute=True, algorithm="CE", given=GivenPhysics(without_rig=True)
    ).origin_notes
    assert "without the rig 'plate'" in note


def test_a_bag_of_estimates_carries_the_model_that_made_them(samples, calibration, tmp_path):
    file, model, rig, stated = calibration
    bag, out = samples(rig, stated), tmp_path / "estimates"
    missing, about = model_in_force(BagReader(bag))
    assert missing is None
    assert "neither in the bag nor beside it" in about
    estimate_bag(bag, out, "CE", known=KnownPhysics(rig, model))
    file.unlink()
    found, about = model_in_force(BagReader(out))
    assert found.text() == model.text()
    assert "'Monday'" in about
    with pytest.raises(ModelError, match="the model that the bag carries: unknown term 'my_term'"):
        recorded_model(BagReader(with_model(tmp_path / "own", "terms: [{term: my_term}]")), "12")


def with_model(path, text):
    """Write a bag that carries this text of a model file."""
    with BagWriter(path) as writer:
        writer.add_topic(IMPEDANCE_MODEL.absolute)
        write_text(writer, IMPEDANCE_MODEL.absolute, 1.0, text)
    return path


def test_what_cannot_be_had_of_the_calibration_is_said(samples, calibration, tmp_path):
    _, model, rig, stated = calibration
    bag = samples(None, stated)
    first, second = read_session(bag, recompute=True, algorithm="CE").origin_notes
    short = f"'Monday' (SHA-256 {model.sha256[:12]}…)"
    assert first.startswith(f"bag: estimates are made anew without the model {short} that was in")
    assert "give it with --model" in first
    assert "without the rig 'plate'" in second
    assert "the bag carries no rig file; give it with --rig" in second
    given = read_session(bag, recompute=True, algorithm="CE", given=GivenPhysics(model, rig))
    assert given.origin_notes == ()
    assert given.origins[0].rig["title"] == "plate"
    other = samples(rig, provenance(algorithm="C"), "other")
    notes = read_session(other, recompute=True, algorithm="CE").origin_notes
    assert "by the estimator CE; C made the recorded ones" in notes[0]
    assert "with the rig 'plate'" in notes[1]
    assert notes[1].endswith("which the bag carries; in force was none")


def test_options_that_would_change_nothing_or_do_not_fit_are_refused(recorded, tmp_path):
    bag = str(recorded("bag", (1.0, BASELINE)))
    (tmp_path / "model.yaml").write_text(MODEL)
    model = tmp_path / "model.yaml"

    def validated(bags, recompute, models):
        shown = Console(file=io.StringIO(), width=200, record=True)
        report_validation(bags, tmp_path / "out", recompute, None, shown, models=models)

    with pytest.raises(AnalysisError, match=r"used as recorded.*--recompute makes them anew"):
        validated([bag], False, [model])
    with pytest.raises(AnalysisError, match=r"1 time\(s\) for 2 recording\(s\); allowed: none, or"):
        validated([bag, bag], True, [model])


def test_the_terminal_says_what_differs_and_how_much_is_doubtful(recorded, tmp_path):
    one = recorded("one", (1.0, CALIBRATED), doubt=1.0)
    other = recorded("other", (1.0, BASELINE))
    shown = Console(file=io.StringIO(), width=200, record=True)
    report_validation([f"S1={one}", f"S1={other}"], tmp_path / "out", False, None, shown)
    text = shown.export_text()
    assert "note: S1: the model differs between the recordings" in text
    assert "note: S1: the rig differs between the recordings" in text
    assert "in 2 of 4 holds" in text
    assert "the model differs between" in (tmp_path / "out" / "report.html").read_text()
