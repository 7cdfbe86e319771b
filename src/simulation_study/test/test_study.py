"""A study on worker processes: the same numbers as alone, never twice, and it goes on after an
interruption.
"""

import json

import pytest

from simulation_study.estimates import carry_out
from simulation_study.study import run_study
from simulation_study.study_folder import StudyError, settle
from simulation_study.trial import Trial

REQUEST = {"study": "test", "seed": 1}


def trials(rigs):
    return [
        Trial(f"t{number}", rig, ("CE",), number, seconds=32.0) for number, rig in enumerate(rigs)
    ]


@pytest.mark.slow
def test_an_interrupted_study_goes_on(tmp_path):
    out = tmp_path / "study"
    # The second trial fails; what was finished before it stays.
    with pytest.raises(KeyError):
        run_study(trials(["CE", "no such rig"]), REQUEST, out, carry_out, workers=1)
    kept = {path: path.stat().st_mtime_ns for path in (out / "trials").glob("*.json")}
    assert {path.stem for path in kept} == {"t0"}
    good = trials(["CE", "CE"])
    results = run_study(good, REQUEST, out, carry_out, workers=1)
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert results == {trial.name: json.loads(json.dumps(carry_out(trial))) for trial in good}


def test_a_finished_study_starts_no_worker(tmp_path):
    out = tmp_path / "study"
    settle(out, REQUEST)
    (out / "trials").mkdir()
    (out / "trials" / "t0.json").write_text('{"a": 1}')

    def never(trial):
        raise AssertionError(trial)

    assert run_study(
        trials(["CE"]), REQUEST, out, never, workers=1, scheduler="tcp://127.0.0.1:9"
    ) == {"t0": {"a": 1}}


def test_another_study_is_not_overwritten(tmp_path):
    settle(tmp_path / "study", REQUEST)
    settle(tmp_path / "study", REQUEST)
    with pytest.raises(StudyError, match="seed 1 instead of 2"):
        settle(tmp_path / "study", {**REQUEST, "seed": 2})
    (tmp_path / "file").write_text("mine")
    with pytest.raises(StudyError, match="not a study"):
        settle(tmp_path, REQUEST)
