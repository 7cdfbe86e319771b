"""Several recordings of one rig together, on recordings that scipy alone makes."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import bilinear, butter, lfilter

from ankle_physics.model import Model
from ankle_physics.term import Owner
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.recording.recording import Recording
from model_discrepancy.report.several_report import write_several
from model_discrepancy.tools import shared_effects
from model_discrepancy.tools.joint_judgement import judge_together
from model_discrepancy.tools.open_set import OpenSet
from model_discrepancy.tools.several_recordings import diagnose_together
from model_discrepancy.tools.shared_effects import LEAST_PROBABILITY_SAME, SharedEffect, Together

RATE = 1000.0
LIBRARY = ("torque_sensor_mode", "torque_sensor_lag", "maxwell_relaxation", "short_range_stiffness")


def lag(x: np.ndarray, time: float) -> np.ndarray:
    b, a = bilinear([1.0], [time, 1.0], fs=RATE)
    return lfilter(b, a, x)


def recording(
    number: int, stiffness: float, relaxing: float, mode: float = 28.0, seconds: float = 30.0
) -> Recording:
    """A subject with a Maxwell element of their own, read by a torque sensor that rings."""
    random = np.random.default_rng(number)
    steps = np.repeat(random.uniform(-0.02, 0.02, int(seconds / 0.25)), int(0.25 * RATE))
    position = lfilter(*butter(4, 15.0, fs=RATE), steps)
    velocity = np.gradient(position) * RATE
    torque = (
        0.014 * np.gradient(velocity) * RATE
        + 0.8 * velocity
        + stiffness * position
        + relaxing * (position - lag(position, 0.1))
    )
    w = 2 * np.pi * mode
    b, a = bilinear([w**2], [1.0, 2 * 0.1 * w, w**2], fs=RATE)
    torque = lfilter(b, a, torque)
    noise = random.standard_normal((2, len(position)))
    return Recording(
        RATE,
        position + 2e-5 * noise[0],
        torque + 0.03 * np.std(torque) * noise[1],
        name=f"visit {number}",
    )


def open_set(*names):
    """A set of which each name stands beside the paper's equations in a model."""
    paper = {"inertia": {}, "viscosity": {}, "stiffness": {}, "reflex": {}}
    models = {
        name: {e.term.name: dict(e.values) for e in Model.of({**paper, name: {}}).entries}
        for name in names
    }
    return OpenSet(names[0], models)


@pytest.mark.slow
def test_a_set_without_the_right_name_gives_way_to_what_all_recordings_say():
    """A sensor that rings was called a lag, or a stiffness of short range, in the first one."""
    recordings = [recording(1, 60.0, 0.0, seconds=20.0), recording(2, 90.0, 0.0, seconds=20.0)]
    wrong = open_set("torque_sensor_lag", "short_range_stiffness")
    right = open_set("torque_sensor_mode", "torque_sensor_lag")
    said = judge_together([wrong], recordings, LIBRARY).sentence
    assert wrong.left == wrong.together == ["torque_sensor_mode"]
    assert "torque sensor mode takes the place of torque sensor lag or short range" in said
    beside = open_set("torque_sensor_lag")
    for values in beside.models.values():
        values["torque_sensor_mode"] = {"frequency": 28.0, "damping": 0.1}
    said = judge_together([right, beside], recordings, LIBRARY).sentence
    assert beside.left == []
    assert right.left == ["torque_sensor_mode", "torque_sensor_lag"]
    assert right.together == []
    assert "torque sensor lag is withdrawn" in said
    assert "torque sensor mode" not in said


def test_a_second_search_begins_from_given_terms_and_keeps_those_that_are_needed():
    visits = [recording(1, 60.0, 40.0, seconds=20.0), recording(2, 90.0, 40.0, seconds=20.0)]
    begin = {
        "torque_sensor_lag": {"T": 0.005},
        "maxwell_relaxation": {"k": 30.0, "T": 0.1},
        "reflex_threshold": {"vt": 0.1},
    }
    # The library of the first search lacks what the second one begins from.
    found = diagnose_together(visits, ["torque_sensor_mode"], begin=begin)
    names = {effect.name for effect in found.effects}
    assert {"maxwell_relaxation", "torque_sensor_mode"} <= names
    assert "reflex_threshold" not in names
    from_base = diagnose_together(visits, ["torque_sensor_mode"])
    assert "maxwell_relaxation" not in {effect.name for effect in from_base.effects}


@pytest.mark.slow
def test_what_is_the_rigs_is_shared_and_what_is_the_subjects_is_free(tmp_path):
    found = diagnose_together(
        [recording(1, 60.0, 20.0), recording(2, 90.0, 45.0), recording(3, 120.0, 70.0)], LIBRARY
    )
    effects = {e.name: e for e in found.effects}
    assert set(effects) == {"torque_sensor_mode", "maxwell_relaxation"}
    mode, maxwell = effects["torque_sensor_mode"], effects["maxwell_relaxation"]
    assert mode.belongs_to is Owner.RIG
    assert mode.shared
    assert maxwell.belongs_to is Owner.SUBJECT
    assert not maxwell.shared
    assert maxwell.probability_same < LEAST_PROBABILITY_SAME
    found.save(tmp_path)
    write_several(found, tmp_path / "report.html")
    models = [Model.load(tmp_path / f"visit {n}.yaml") for n in (1, 2, 3)]
    frequencies = {m.entry("torque_sensor_mode").values["frequency"] for m in models}
    assert len(frequencies) == 1
    assert frequencies.pop() == pytest.approx(28.0, rel=0.02)
    for model, k in zip(models, (20.0, 45.0, 70.0), strict=True):
        assert model.entry("maxwell_relaxation").values["k"] == pytest.approx(k, rel=0.15)
    content = json.loads((tmp_path / "verdict.json").read_text())
    assert content["verdict"] == "explained"
    assert "of the rig: torque sensor mode" in (tmp_path / "report.html").read_text()


@pytest.mark.slow
@pytest.mark.parametrize("least_probability", [shared_effects.LEAST_PROBABILITY_SAME, -1.0])
def test_a_rig_that_was_changed_between_the_recordings_is_not_shared(
    monkeypatch, least_probability
):
    """Neither where the errors are so large that they cannot tell: one value fits one of them."""
    monkeypatch.setattr(shared_effects, "LEAST_PROBABILITY_SAME", least_probability)
    found = diagnose_together(
        [recording(1, 60.0, 0.0, mode=22.0), recording(2, 90.0, 0.0, mode=34.0)], LIBRARY
    )
    (effect,) = found.effects
    assert effect.name == "torque_sensor_mode"
    assert not effect.shared
    assert "the rig was changed" in effect.sentence
    assert ("more error in one of them" in effect.sentence) == (least_probability < 0.0)


def test_what_takes_off_next_to_nothing_is_not_named(tmp_path):
    def effect(name, share):
        return SharedEffect(name, Owner.RIG, 0.5, {"k": [(1.0, 0.1), (1.1, 0.1)]}, share, 1.0)

    visits = [SimpleNamespace(name=n, base=None, final=None, after=None) for n in ("first", "next")]
    effects = [effect("fixation_compliance", 0.96), effect("channel_skew", 0.04)]
    found = Together(visits, effects)
    assert [e.name for e in found.named] == ["fixation_compliance"]
    assert [e["refines"] for e in found.content()["effects"]] == [False, True]
    write_several(found, tmp_path / "report.html")
    headline, rest = (tmp_path / "report.html").read_text().split("</h1>", 1)
    assert "of the rig: fixation compliance." in headline
    assert "hold channel skew too: less than 5 %" in rest
    write_several(Together(visits, effects[:1]), tmp_path / "report.html")
    assert "less than 5 %" not in (tmp_path / "report.html").read_text()


def test_one_recording_or_a_name_twice_or_a_dead_channel_is_refused():
    first = recording(1, 60.0, 0.0)
    with pytest.raises(DiagnosisError, match="two at least"):
        diagnose_together([first])
    with pytest.raises(DiagnosisError, match="two recordings have one name"):
        diagnose_together([first, first])
    dead = Recording(RATE, first.position, np.zeros(len(first.torque)), name="dead")
    with pytest.raises(DiagnosisError, match="dead cannot be used: torque is dead"):
        diagnose_together([first, dead])
