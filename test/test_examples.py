"""Every example runs as its first lines say, and shows what it promises."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from session_recorder.importing import propose, read_table

EXAMPLES = Path(__file__).parents[1] / "examples"
K, G = 80.0, 12.0  # what the simulated joint has


def run(name, *arguments, timeout=240):
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp("examples") / "bag"
    gains = ("--stiffness", K, "--reflex-gain", G)
    table = path.with_name("table.csv")
    run("simulate_a_model.py", path, *gains, "--seconds", 20, "--table", table)
    return path


def test_the_table_of_a_simulated_model_is_imported_with_its_commanded_angle(bag):
    proposed = propose(read_table(bag.with_name("table.csv")))
    assert set(proposed.columns) == {
        "t[s]",
        "reference_position[deg]",
        "position[deg]",
        "torque[N.m]",
    }
    assert proposed.torque_sign == "rig"


@pytest.mark.parametrize(
    ("name", "words"),
    [("read_a_bag.py", "no bag at"), ("simulate_a_model.py", "is there already")],
)
def test_a_wrong_path_is_answered_in_one_line(name, words, bag, tmp_path):
    path = bag if name == "simulate_a_model.py" else tmp_path / "nosuch"
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, path], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 1
    assert words in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_read_a_bag(bag):
    shown = run("read_a_bag.py", bag)
    assert "at 2048 Hz" in shown
    assert "/ankle/samples" in shown


@pytest.mark.timeout(300)
def test_estimate_a_bag(bag):
    shown = run("estimate_a_bag.py", bag)
    for symbol, true in (("K", K), ("G", G)):
        (found,) = re.findall(rf"median {symbol}\[.*\] = (.*)", shown)
        assert float(found) == pytest.approx(true, rel=0.1)


def test_impedance_of_a_model():
    shown = dict(re.findall(r"(\w+) = ([\d.]+)", run("impedance_of_a_model.py")))
    # Relaxation adds to what steps meet, and is no elastic stiffness.
    assert float(shown["K_effective"]) > float(shown["K"]) + 1.0


def test_add_a_term():
    adds, expected = map(float, re.findall(r"([\d.]+) N\.m", run("add_a_term.py")))
    assert adds == pytest.approx(expected, rel=0.05)


def test_own_link():
    assert "wanted HOLD, the rig reports HOLD" in run("own_link.py")


def test_study_on_dask(tmp_path):
    shown = run("study_on_dask.py", tmp_path / "study", "--trials", 4)
    assert re.match(r"4 trials: K = (99|100)\.", shown.splitlines()[-1])


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_diagnose_a_bag(bag, tmp_path):
    assert "verdict: " in run("diagnose_a_bag.py", bag, tmp_path / "out", timeout=800)
    assert (tmp_path / "out" / "verdict.json").exists()


def test_every_example_is_short_and_has_a_test():
    here = Path(__file__).parent
    tests = "".join(path.read_text() for path in here.glob("test_example*.py"))
    for path in EXAMPLES.rglob("*.py"):
        assert len(path.read_text().splitlines()) <= 50, path.name
        assert path.name in tests or path.parent != EXAMPLES, path.name
