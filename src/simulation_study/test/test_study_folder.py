"""Parts of one study begin in one folder, at the same moment too."""

import json
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from simulation_study.study_folder import STUDY_FILE, StudyError, settle

STUDY = {"study": "of a test", "seed": 3}


def test_parts_that_begin_at_the_same_moment_share_the_folder(tmp_path):
    parts, together = 4, threading.Barrier(4, timeout=20.0)

    def begin(number):
        for k in range(100):
            together.wait()
            settle(tmp_path / str(k), STUDY)
            (tmp_path / str(k) / f"results-{number}.jsonl").write_text("")

    with ThreadPoolExecutor(parts) as pool:
        for done in [pool.submit(begin, number) for number in range(parts)]:
            done.result()
    for k in range(100):
        there = sorted(one.name for one in (tmp_path / str(k)).iterdir())
        assert there == [*(f"results-{number}.jsonl" for number in range(parts)), STUDY_FILE]
        assert json.loads((tmp_path / str(k) / STUDY_FILE).read_text()) == STUDY


def test_a_folder_of_something_else_is_left_alone(tmp_path):
    (tmp_path / "results-1.jsonl").write_text("")
    with pytest.raises(StudyError, match="is not a study"):
        settle(tmp_path, STUDY)
    assert [one.name for one in tmp_path.iterdir()] == ["results-1.jsonl"]


def test_another_study_does_not_go_on_in_the_folder(tmp_path):
    settle(tmp_path, STUDY)
    settle(tmp_path, STUDY)
    with pytest.raises(StudyError, match="seed 3 instead of 4"):
        settle(tmp_path, {**STUDY, "seed": 4})
