"""Scores of hand-made verdicts, worked out by hand."""

from typing import Any

import pytest

from simulation_study.blind.acceptance import ANSWERS
from simulation_study.blind.scoring import calibration, confusion, score_case, summarise

BASE = {
    "I[kg.m^2]": 0.0137,
    "B[N.m.s/rad]": 0.63,
    "K[N.m/rad]": 100.0,
    "G[N.m.s/rad]": 10.0,
    "delay[s]": 0.04,
}


def _truth(
    kind: str, *names: str, strength: str = "moderate", **parameters: float
) -> dict[str, Any]:
    about = [{"name": name, "strength": strength, "parameters": parameters} for name in names]
    return {"case": f"{kind} {names}", "kind": kind, "effects": about, "base": BASE}


def _explained(*names: str, probability: float = 0.9, **more: Any) -> dict[str, Any]:
    effects = [
        {"name": name, "probability": probability - 0.01 * i, "parameters": {}}
        for i, name in enumerate(names)
    ]
    return {"verdict": "explained", "effects": effects, **more}


@pytest.mark.parametrize(
    ("truth", "verdict", "outcome"),
    [
        (_truth("null"), {"verdict": "no_mismatch"}, "right"),
        (_truth("null"), _explained("maxwell_relaxation"), "explained"),
        (_truth("null"), {"verdict": "unexplained"}, "unexplained"),
        (_truth("unknown", "heel_lift"), {"verdict": "unexplained"}, "right"),
        (_truth("unknown", "heel_lift"), _explained("hardening_stiffness"), "explained"),
        (_truth("broken", "torque_dead"), {"verdict": "bad_recording"}, "right"),
        (_truth("broken", "torque_dead"), {"verdict": "no_mismatch"}, "no_mismatch"),
        (_truth("known", "maxwell"), _explained("maxwell_relaxation"), "right"),
        (_truth("known", "maxwell"), _explained("fractional_damping"), "right"),
        (_truth("known", "maxwell"), _explained("coulomb_friction"), "family"),
        (_truth("known", "maxwell"), _explained("backlash"), "wrong_name"),
        (
            _truth("known", "tremor"),
            {"verdict": "no_mismatch", "variability": {"tremor": {"rms[N.m]": [0.2, 0.02]}}},
            "right",
        ),
        (_truth("known", "tremor"), {"verdict": "no_mismatch", "variability": {}}, "no_mismatch"),
        (
            _truth("known", "tremor"),
            _explained("backlash", variability={"tremor": {}}),
            "wrong_name",
        ),
        (
            _truth("known", "maxwell"),
            _explained("maxwell_relaxation", "coulomb_friction"),
            "partial",
        ),
        (_truth("known", "maxwell"), {"verdict": "no_mismatch"}, "no_mismatch"),
        (_truth("known", "maxwell"), None, "no_verdict"),
        (_truth("known", "maxwell"), {"verdict": "perhaps"}, "no_verdict"),
        (
            _truth("pair", "maxwell", "late_reflex"),
            _explained("long_latency_reflex", "fractional_damping"),
            "right",
        ),
        (_truth("pair", "maxwell", "late_reflex"), _explained("fractional_damping"), "partial"),
        (_truth("pair", "maxwell", "late_reflex"), _explained("backlash"), "wrong_name"),
    ],
)
def test_outcome(truth: dict[str, Any], verdict: dict[str, Any] | None, outcome: str) -> None:
    assert score_case(truth, verdict).outcome == outcome


def test_a_set_counts_up_to_three_names() -> None:
    truth = _truth("known", "encoder_backlash")

    def outcome(*rivals: str) -> str:
        verdict = _explained("coulomb_friction")
        verdict["effects"][0]["set"] = ["coulomb_friction", *rivals]
        return score_case(truth, verdict).outcome

    assert outcome() == "wrong_name"
    assert outcome("backlash") == "set"
    assert outcome("dahl_hysteresis", "backlash") == "set"
    assert outcome("dahl_hysteresis", "tendon", "backlash") == "wrong_name"


def test_effects_without_the_verdict_explained_state_nothing() -> None:
    verdict = {**_explained("maxwell_relaxation"), "verdict": "unexplained"}
    score = score_case(_truth("known", "maxwell"), verdict)
    assert score.outcome == "unexplained"
    assert score.stated == ()
    assert score.probabilities == ()


def test_gap_parameters_and_base() -> None:
    truth = _truth("known", "maxwell", **{"muscle.maxwell_k": 30.0, "muscle.maxwell_tau": 0.1})
    verdict = _explained(
        "maxwell_relaxation",
        fit={"baseline_vaf_holdout": 70.0, "augmented_vaf_holdout": 94.0, "ceiling_vaf": 95.0},
    )
    verdict["effects"][0]["parameters"] = {"k[N.m/rad]": [33.0, 2.0], "T[s]": [0.09, 0.01]}
    model = {
        "terms": [
            {"term": "stiffness", "K[N.m/rad]": {"value": 110.0, "standard_error": 1.0}},
            {"term": "reflex", "G[N.m.s/rad]": 9.0},
        ]
    }
    score = score_case(truth, verdict, model)
    assert score.gap_closed == pytest.approx(0.96)
    assert score.parameter_errors == {
        "maxwell_relaxation.k[N.m/rad]": pytest.approx(0.1),
        "maxwell_relaxation.T[s]": pytest.approx(-0.1),
    }
    assert score.base_errors == {
        "K[N.m/rad]": pytest.approx(0.1),
        "G[N.m.s/rad]": pytest.approx(-0.1),
    }


def test_a_gap_without_room_is_no_number() -> None:
    verdict = _explained(
        "maxwell_relaxation",
        fit={"baseline_vaf_holdout": 95.0, "augmented_vaf_holdout": 95.0, "ceiling_vaf": 94.0},
    )
    assert score_case(_truth("known", "maxwell"), verdict).gap_closed is None


def test_calibration_by_hand() -> None:
    found = calibration([(0.9, True), (0.9, False), (1.0, True), (0.6, False)])
    assert found["brier"] == pytest.approx((0.01 + 0.81 + 0.0 + 0.36) / 4)
    assert [(b["count"], b["stated"], b["right"]) for b in found["bins"]] == [
        (1, 0.6, 0.0),
        (2, 0.9, 0.5),
        (1, 1.0, 1.0),
    ]
    assert calibration([]) == {"bins": [], "brier": None, "count": 0}


def test_probabilities_of_effects_stated_for_a_null_are_wrong() -> None:
    assert score_case(_truth("null"), _explained("maxwell_relaxation")).probabilities == (
        (0.9, False),
    )
    assert score_case(_truth("unknown", "heel_lift"), _explained("backlash")).probabilities == (
        (0.9, False),
    )


def test_summary_counts() -> None:
    scores = [
        score_case(_truth("null"), {"verdict": "no_mismatch"}),
        score_case(_truth("null"), _explained("backlash")),
        score_case(_truth("known", "maxwell"), _explained("maxwell_relaxation")),
        score_case(_truth("known", "maxwell", strength="weak"), {"verdict": "no_mismatch"}),
        score_case(_truth("known", "tremor"), {"verdict": "bad_recording"}),
        score_case(
            _truth("known", "reflex_saturation", strength="invisible"), {"verdict": "no_mismatch"}
        ),
        score_case(_truth("unknown", "heel_lift"), {"verdict": "unexplained"}),
        score_case(_truth("broken", "torque_dead"), None),
    ]
    summary = summarise(scores)
    assert summary["false_alarms"] == {"hits": 1, "of": 2, "rate": 0.5}
    assert summary["known"]["moderate"]["exact"] == {"hits": 1, "of": 2, "rate": 0.5}
    assert summary["known"]["weak"]["exact"]["rate"] == 0.0
    assert summary["known_invisible"] == 1
    assert summary["unexplained_recall"]["rate"] == 1.0
    assert summary["bad_recordings_caught"] == {"hits": 0, "of": 1, "rate": 0.0}
    assert summary["good_recordings_called_bad"] == {
        "hits": 1,
        "of": 7,
        "rate": pytest.approx(1 / 7),
    }
    assert confusion(scores)["maxwell"] == {"maxwell_relaxation": 1, "no_mismatch": 1}
    assert sum(count for row in summary["confusion"].values() for count in row.values()) == len(
        scores
    )


@pytest.mark.parametrize(("probability", "outcome"), [(0.8, "wrong_name"), (0.4, "right")])
def test_unexplained_earns_nothing_beside_a_confident_wrong_name(probability, outcome):
    truth = {"case": "c", "kind": "unknown", "effects": [{"name": "foot_sliding"}], "base": {}}
    effects = [{"name": "maxwell_relaxation", "probability": probability}]
    verdict = {"verdict": "unexplained", "effects": effects}
    assert score_case(truth, verdict).outcome == outcome


def test_a_confident_family_is_a_statement_too():
    truth = {"case": "c", "kind": "unknown", "effects": [{"name": "foot_sliding"}], "base": {}}
    effect = {"name": "thixotropy", "probability": 0.4, "family_probability": 0.8}
    verdict = {"verdict": "unexplained", "effects": [effect]}
    assert score_case(truth, verdict).outcome == "wrong_name"


def test_coverage_of_the_standard_errors_is_counted() -> None:
    def entry(value: float) -> dict[str, float]:
        return {"augmented": value, "standard_error": 2.0}

    near = {"verdict": "no_mismatch", "parameters": {"K[N.m/rad]": entry(103.0)}}
    far = {"verdict": "no_mismatch", "parameters": {"K[N.m/rad]": entry(110.0)}}
    scores = [score_case(_truth("null"), verdict) for verdict in (near, far)]
    assert scores[0].standard_scores == {"K[N.m/rad]": pytest.approx(1.5)}
    counted = summarise(scores)["within_two_standard_errors"]
    assert counted["K[N.m/rad]"] == {"hits": 1, "of": 2, "rate": 0.5}
    assert counted["G[N.m.s/rad]"]["of"] == 0


def test_a_lag_of_the_spindles_is_no_answer_to_a_spring():
    for hidden in ("strap", "maxwell", "tendon"):
        assert "tendon" not in ANSWERS[hidden].names
