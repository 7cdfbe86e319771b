"""Plan and table of the calibrated study."""

import numpy as np

from simulation_study.calibrated_recordings import NULL_SHARE, sessions
from simulation_study.calibrated_study import UNCALIBRATED, WITH_BOTH, WITH_RIG, report
from simulation_study.robustness.conditions import NO_MISMATCH


def test_a_longer_study_goes_on_with_the_shorter_one():
    assert sessions(12, 5)[:7] == sessions(7, 5)
    assert sessions(7, 5) != sessions(7, 6)
    nulls = [c.effect == NO_MISMATCH for c in sessions(20, 5)]
    assert sum(nulls) == 20 // NULL_SHARE


def result(effect, error, covered, doubt):
    truth = [100.0, 10.0]
    value = [100.0 * (1.0 + error), 10.0 * (1.0 + error)]
    width = [1000.0, 1000.0] if covered else [1e-6, 1e-6]
    found = {"value": value, "snapshots": [[*value, *width, doubt]]}
    return {
        "effect": effect,
        "strength": "weak",
        "servo": "stiff",
        "truth": truth,
        "momentary": [truth],
        "failure": "",
        "terms": ["stiffness", "tendon"],
        "estimates": {name: found for name in (UNCALIBRATED, WITH_RIG, WITH_BOTH)},
    }


def test_the_table_counts_errors_coverage_and_flags():
    results = [
        result(NO_MISMATCH, 0.02, True, 0.0),
        result("tendon", 0.30, False, 0.9),
        result("maxwell", -0.40, False, 0.1),
    ]
    lines = report(results, "command").splitlines()
    row = next(line for line in lines if line.startswith(f"| {WITH_BOTH} | one effect (2)"))
    cells = [cell.strip() for cell in row.split("|")[3:-1]]
    assert cells == ["35.0 (39; 40)", "35.0 (39; 40)", "0, 0", "50", "50 % of 2"]
    assert any("| tendon weak | stiff | +30 / +30 / +30 |" in line for line in lines)


def test_a_snapshot_is_judged_by_what_was_true_over_its_memory():
    hardened = result("hardening", 0.30, False, 0.1)
    hardened["momentary"] = [[130.0, 13.0]]
    lines = report([hardened], "command").splitlines()
    row = next(line for line in lines if line.startswith(f"| {WITH_BOTH} | one effect (1)"))
    cells = [cell.strip() for cell in row.split("|")[3:-1]]
    assert cells == ["30.0 (30; 30)", "30.0 (30; 30)", "100, 100", "0", "-"]


def test_intervals_are_over_recordings():
    results = [result("tendon", 0.02, True, 0.0) for _ in range(9)]
    lines = report([*results, result("maxwell", -0.40, False, 0.1)], "command").splitlines()
    row = [line for line in lines if line.startswith(f"| {WITH_RIG} |")][-1]
    cells = [cell.strip() for cell in row.split("|")[2:-1]]
    # Clopper & Pearson: 9 of 10.
    assert cells == ["2.0 [2.0, 2.0]", "2.0 [2.0, 2.0]", *["90 [55, 100] of 10"] * 2]


def test_what_was_not_estimated_counts_as_an_error_of_all():
    missing = result("maxwell", 0.0, True, 0.0)
    missing["estimates"][WITH_BOTH] = {"value": [np.nan, np.nan], "snapshots": []}
    text = report([missing, result("tendon", 0.0, True, 0.0)], "command")
    assert "| rig and session | one effect (2) | 50.0 (90; 100)" in text
