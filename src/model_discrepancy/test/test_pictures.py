"""A recording is drawn after its movements; in time where the plate never rests."""

import re

import numpy as np
import pytest

from model_discrepancy.diagnose import diagnose
from model_discrepancy.fit.movements import Onsets, Peak, peak_after
from model_discrepancy.report.pictures import AFTER_S, BEFORE_S, after_movements, worst_stretch
from model_discrepancy.report.pictures import Figure as DrawnFigure
from simulation_study.verdict_cases import Plan, made

RATE = 200.0  # rows a second
NO_MOVEMENTS = Onsets(np.zeros(0), np.zeros(0), np.zeros(0))


def test_only_directions_with_movements_are_drawn():
    onsets = Onsets(np.array([1.0, 2.0, 9.99]), np.array([1.0, 1.0, 1.0]), np.ones(3))
    shown = after_movements(onsets, RATE, 2000)
    assert list(shown) == ["dorsiflexion"]
    assert shown["dorsiflexion"].shape == (2, round((BEFORE_S + AFTER_S) * RATE))
    assert shown["dorsiflexion"][:, round(BEFORE_S * RATE)].tolist() == [200, 400]
    assert after_movements(NO_MOVEMENTS, RATE, 2000) == {}


def test_the_stretch_in_which_most_is_left_is_found():
    left = np.zeros(4000)
    left[3000:3100] = 0.5
    stretch = worst_stretch(left, RATE)
    assert stretch[0] <= 3000
    assert stretch[-1] >= 3098
    assert len(worst_stretch(left[:100], RATE)) < 100


def test_the_largest_torque_has_a_time_only_after_a_movement():
    torque = np.zeros(2000)
    torque[420:425] = -2.0
    onset = Onsets(np.array([2.0]), np.array([-1.0]), np.ones(1))
    after = peak_after(RATE, torque, onset)
    assert after == Peak(-2.0, 0.1, "plantarflexion")
    assert after.sentence == "takes away up to 2.00 N.m, 100 ms after a plantarflexion movement"
    anywhere = peak_after(RATE, torque, NO_MOVEMENTS)
    assert anywhere.torque == pytest.approx(-2.0, abs=0.01)
    assert anywhere.sentence == "takes away up to 2.00 N.m"


@pytest.mark.slow
def test_the_report_of_a_continuous_movement_has_no_empty_picture(tmp_path, monkeypatch):
    drawn = []
    save = DrawnFigure.savefig
    monkeypatch.setattr(
        DrawnFigure,
        "savefig",
        lambda figure, *a, **k: drawn.append(figure) or save(figure, *a, **k),
    )
    conditions = dict(velocity=True, reference=True, noise="quiet", variability="small")
    plan = Plan("effect", 0, 5, ("strap",), "stiff", "multisine", 1000.0, **conditions)
    diagnose(made(plan).recording, tmp_path / "out")
    assert len(drawn) >= 4
    for figure in drawn:
        assert all(axes.has_data() or axes.texts for axes in figure.axes)
    report = (tmp_path / "out" / "report.html").read_text()
    assert not re.search(r"up to 0\.00 N", report)
    assert "null" not in re.sub(r"<[^>]*>|base64,[^\"]*", "", report)
