"""Recordings by their seed, and what is true of them."""

import json
from dataclasses import replace

import numpy as np
import pytest

import second_rig
from second_rig.draw import COUNTS, draw_cases
from second_rig.recording import PROTOCOL_THAT_SHOWS_MOST, record
from second_rig.references import REFERENCES
from second_rig.voluntary_torque import KINDS, bouts, voluntary_torque

SECONDS = 4.0
FEW = {"base": 2, "effect": 2, "pair": 1, "unlisted": 1}


@pytest.fixture(scope="module")
def plain():
    case = replace(draw_cases(4)[0], servo_stiffness=None, quantised=False)
    return record(case, SECONDS)


def test_a_draw_has_ten_twenty_six_and_four_recordings_of_every_condition():
    cases = draw_cases(4)
    assert {kind: sum(c.kind == kind for c in cases) for kind in COUNTS} == dict(COUNTS)
    assert len({c.seed for c in cases}) == len(cases)
    assert {c.protocol for c in cases} == set(REFERENCES)
    assert {c.rate for c in cases} == {1000, 1024, 2000, 2048}
    assert len({c.effects for c in cases if c.kind == "effect"}) == 20
    rigid = sum(c.servo_stiffness is None for c in cases)
    assert 5 <= rigid <= 15


def test_one_kind_does_not_change_another_and_a_seed_draws_the_same():
    few = draw_cases(4, FEW)
    assert few == draw_cases(4, FEW)
    assert few != draw_cases(5, FEW)
    assert draw_cases(4, {"pair": 1}) == [c for c in few if c.kind == "pair"]
    assert set(few) < set(draw_cases(4))
    with pytest.raises(ValueError, match="no kind triple"):
        draw_cases(4, {"triple": 1})


def test_a_recording_made_alone_is_that_of_the_whole_draw():
    chosen = draw_cases(4, FEW)[2]
    alone = record(chosen, SECONDS)
    _, of_the_draw = (record(case, SECONDS) for case in draw_cases(4, FEW)[1:3])
    assert np.array_equal(alone.torque, of_the_draw.torque)
    assert np.array_equal(alone.position, of_the_draw.position)
    assert json.dumps(alone.truth.content()) == json.dumps(of_the_draw.truth.content())
    other = record(replace(chosen, seed=chosen.seed + 1), SECONDS)
    assert not np.array_equal(alone.torque, other.torque)


def test_the_truth_of_a_plain_recording_is_its_subject(plain):
    truth, subject = plain.truth.impedance, plain.truth.subject
    assert truth.K == truth.K_in_the_middle == pytest.approx(subject["K"])
    assert truth.K_time_average == pytest.approx(subject["K"])
    # Factors of single stretches, a few in these seconds, have the mean one.
    assert abs(truth.G - subject["G"]) < 0.3 * subject["G"]
    assert truth.G_of_impulse == truth.G_secant == pytest.approx(truth.G, rel=0.3)
    assert truth.mean_torque == pytest.approx(plain.torque.mean(), abs=0.01)
    assert plain.truth.effects == ()
    assert truth.notes == ()


def test_an_effect_has_its_share_of_the_torque_and_is_in_the_truth():
    case = next(c for c in draw_cases(4) if c.effects == ("stiffness_rise",))
    made = record(replace(case, protocol=PROTOCOL_THAT_SHOWS_MOST), SECONDS)
    (hidden,) = made.truth.effects
    assert made.truth.shown
    assert 0.005 <= hidden.share_of_torque_variance <= 0.15
    assert hidden.parameters["engine"]["elastic.rise"] == hidden.strength
    x = made.truth.impedance.mean_position - made.truth.subject["mean_position"]
    risen = made.truth.subject["K"] * np.exp(hidden.strength * x)
    assert abs(made.truth.impedance.K - risen) < 0.02 * risen


def test_channels_are_those_of_the_case(plain):
    case = replace(draw_cases(4)[0], velocity=False, quantised=True)
    made = record(case, SECONDS)
    assert made.velocity is None
    step = made.truth.quantisation["torque"]
    assert np.allclose(made.torque / step, np.round(made.torque / step), atol=1e-6)
    assert plain.truth.quantisation is None
    assert len(plain.torque) == len(plain.reference) == SECONDS * plain.rate


@pytest.mark.parametrize("kind", REFERENCES)
def test_a_reference_moves_within_the_range_of_an_ankle(kind):
    time = np.arange(round(20.0 * 4000)) / 4000
    reference, about = REFERENCES[kind](time, np.random.default_rng(2))
    assert reference.shape == time.shape
    assert 0.02 < np.ptp(reference) < 0.12
    assert about


def test_will_makes_what_its_kind_says():
    time = np.arange(round(60.0 * 200)) / 200
    sizes = {k: np.std(voluntary_torque(k, time, np.random.default_rng(2))[0]) for k in KINDS}
    relaxed = sizes.pop("relaxed (small slow fluctuations only)")
    assert 0.0 < relaxed < min(sizes.values())
    activation = bouts(time, np.random.default_rng(2))
    assert activation.min() >= 0.0
    assert 0.5 < activation.max() <= 1.0


def test_the_package_exports_how_to_draw_and_to_record():
    assert second_rig.record is record
    assert second_rig.draw_cases is draw_cases
