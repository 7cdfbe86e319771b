"""What is counted of strong effects."""

from simulation_study.strong_effects import STRENGTH, report, strong_conditions


def test_each_effect_that_has_a_name_is_in_one_recording():
    found = strong_conditions(3)
    assert {c.strength for c in found} == {STRENGTH}
    names = [c.effect for c in found]
    assert len(names) == len(set(names)) > 20
    assert "strap" in names


def test_the_report_counts_names_and_errors():
    entry = {
        "case": "strap_strong",
        "effect": "strap",
        "servo": "stiff",
        "right": [["fixation_compliance"]],
        "verdict": "explained",
        "effects": [{"name": "fixation_compliance", "probability": 0.93}],
        "truth": [100.0, 5.0],
        "values": [[40.0, 98.0], [10.0, None]],
    }
    wrong = {
        **entry,
        "effects": [{"name": "partial_sensor_mode", "probability": 0.75}],
        "values": [[40.0, 94.0], [10.0, 5.0]],
    }
    text = report([entry, wrong], "command")
    assert "| named exactly | 1 of 2" in text
    assert "| names stated with 0.7 or more that are right | 1 of 2" in text
    assert "K[N.m/rad], base model: median error (90 % of the recordings within) | 60.0 %" in text
    assert (
        "K[N.m/rad], with what was found: median error (90 % of the recordings within) | 4.0 %"
        in text
    )
    assert "| 100, 40, 98 | 5, 10, - |" in text
