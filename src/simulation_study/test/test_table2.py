"""Table II from results with known numbers."""

import csv

import numpy as np
import pytest

from simulation_study.figures import IntrinsicAccuracy
from simulation_study.protocol import COMBINATIONS, QUICK_SIZE, Size, table2_trials
from simulation_study.table2 import published_numbers, significant_deviation, table2
from simulation_study.table2_report import markdown, write_csv

SIZE = Size(runs=6, seeds=4, seconds=60.0)


def made_up(trial):
    """Estimates with known errors: K 2 low and 1 of spread, G 10 % high, O without inertia; rise
    times by seed.
    """
    ankle = trial.ankle
    found = {}
    for number, algorithm in enumerate(trial.estimators):
        mean = [ankle.K - 2.0, 0.66, 0.0001 if algorithm == "O" else 0.0135, 1.1 * ankle.G]
        found[algorithm] = {
            "mean": mean,
            "sd": [1.0, 0.02, 2e-4, 0.3],
            "rise_time": [16.0 + number, float("nan")],
        }
    return {"trial": trial.as_content(), "estimates": found}


@pytest.fixture(scope="module")
def rows():
    results = {trial.name: made_up(trial) for trial in table2_trials(SIZE, seed=4)}
    return {row.symbol: row for row in table2(results)}


def test_protocol_is_the_papers():
    trials = table2_trials(QUICK_SIZE, seed=1)
    assert len(trials) == 3 * (3 * QUICK_SIZE.runs + 2 * QUICK_SIZE.seeds)
    assert {trial.seconds for trial in trials} == {240.0}
    by_name = {trial.name: trial for trial in trials}
    assert len(by_name) == len(trials)
    # The same ankle, perturbation and noise for all rigs; K random and G not, and so on.
    for name in ("random_K_003", "random_G_003", "random_K_and_G_003", "fixed_003", "jump_003"):
        same = {
            (by_name[f"{name}_{rig}"].ankle, by_name[f"{name}_{rig}"].seed)
            for rig in ("O", "C", "CE")
        }
        assert len(same) == 1
    assert by_name["random_K_003_CE"].ankle.G == 10.0
    assert by_name["random_G_003_CE"].ankle.K == 100.0
    K = [
        trial.ankle.K
        for trial in table2_trials(Size(), seed=1)
        if trial.name.startswith("random_K_") and trial.rig == "CE"
    ]
    assert len(K) == 200
    assert 0.0 <= min(K) < 10.0
    assert 190.0 < max(K) <= 200.0
    assert table2_trials(QUICK_SIZE, seed=1) == trials != table2_trials(QUICK_SIZE, seed=2)


def test_published_table_is_complete():
    numbers = published_numbers()
    assert numbers["I_hat_mean"]["CO"] == "0.0072"
    for line in numbers.values():
        assert all(np.isfinite(float(line[combination])) for combination in COMBINATIONS)


def test_accuracy_counts_spread_and_not_a_constant_bias(rows):
    K = [
        trial.ankle.K
        for trial in table2_trials(SIZE, seed=4)
        if trial.name.startswith("random_K_0") and trial.rig == "CE"
    ]
    assert rows["VAF K"].reproduced["CECE"].value == pytest.approx(100.0 * (1.0 - 1.0 / np.var(K)))
    # G is 10 % high: its error grows with G.
    G = [
        trial.ankle.G
        for trial in table2_trials(SIZE, seed=4)
        if trial.name.startswith("random_G_0") and trial.rig == "CE"
    ]
    assert rows["VAF G"].reproduced["CECE"].value == pytest.approx(
        100.0 * (1.0 - 0.01 - 0.09 / np.var(G))
    )


def test_means_variability_and_rise_times(rows):
    K = rows["K"].reproduced["OO"]
    assert (K.value, K.low, K.high) == pytest.approx((98.0, 97.0, 99.0))
    assert rows["var K"].reproduced["OO"].value == pytest.approx(200.0 / 98.0)
    assert rows["τ K"].reproduced["CECE"].value == pytest.approx(17.0)
    never = rows["τ G"].reproduced["CEO"]
    assert np.isnan(never.value)
    assert str(never) == "never"


def test_a_difference_is_marked_only_beyond_both_ranges(rows):
    # Paper: I = 0.0136 ± 0.0003 (OO), 0.0001 ± 9e-6 (CEO), 0.0135 ± 0.0004 (CECE).
    assert rows["I"].differs("OO")
    assert not rows["I"].differs("CEO")
    assert not rows["I"].differs("CECE")
    assert rows["τ G"].differs("CECE")


def test_means_are_compared_by_their_standard_errors(rows):
    # Our K is 98 in every run; the paper's is 96, printed without decimals, ± 4 over 100 runs.
    error = np.hypot(4.0 / 10.0, 0.5 / np.sqrt(3.0))
    assert rows["K"].deviation("OO") == pytest.approx(2.0 / error)
    assert np.isnan(rows["VAF K"].deviation("OO"))
    # 24 means: 5 % of all tables have one beyond this.
    assert significant_deviation(list(rows.values())) == pytest.approx(3.08, abs=0.01)
    line = next(s for s in markdown(list(rows.values()), [], "").splitlines() if "± 0.49" in s)
    assert line.startswith("| K [N.m/rad] | **+2.00 ± 0.49 (+4.1)** | +1.00 ± 0.49 (+2.0) |")


def test_the_standard_error_of_a_mean_is_that_of_independent_runs():
    results = {trial.name: made_up(trial) for trial in table2_trials(SIZE, seed=4)}
    chosen = [
        result["estimates"]["CE"]
        for name, result in results.items()
        if name.startswith("random_G_0") and result["trial"]["rig"] == "CE"
    ]
    for number, estimates in enumerate(chosen):
        estimates["mean"][0] = 90.0 + number
    K = {row.symbol: row for row in table2(results)}["K"].reproduced["CECE"]
    assert len(chosen) == SIZE.runs
    assert K.value == pytest.approx(90.0 + 0.5 * (SIZE.runs - 1))
    assert K.standard_error == pytest.approx(np.sqrt(3.5 / SIZE.runs))


def test_report_and_csv(rows, tmp_path):
    accuracies = [
        IntrinsicAccuracy(
            "O", np.array([80.0, 81.0]), np.array([-60.0, -61.0]), np.ones(2), np.ones(2)
        )
    ]
    text = markdown(list(rows.values()), accuracies, "made up")
    line = next(line for line in text.splitlines() if line.startswith("| I "))
    cells = [cell.strip() for cell in line.split("|")[2:-1]]
    assert cells[0].startswith("**0.0136 / 0.0001")
    assert not cells[5].startswith("**")
    assert "| O | validation | -33.3 | 81.0 ± 1.0 | -61.0 ± 1.0 |" in text
    write_csv(list(rows.values()), tmp_path / "t.csv")
    with (tmp_path / "t.csv").open() as stream:
        lines = list(csv.DictReader(stream))
    assert len(lines) == 10 * len(COMBINATIONS)
    assert float(lines[6]["deviation"]) == pytest.approx(rows["G"].deviation("OO"), rel=1e-2)
    assert {
        line["differs"] for line in lines if line["quantity"] == "I" and line["combination"] == "OO"
    } == {"1"}
