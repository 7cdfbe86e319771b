"""A study refuses a recording that it holds already, by content and not by name."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from study_recordings import write_bag

from session_analysis.errors import AnalysisError
from session_analysis.study.held_recordings import require_new

ANKLE = Path(sys.executable).with_name("ankle")


def test_a_bag_is_known_again_under_another_name(study, tmp_path):
    write_bag(tmp_path / "bag")
    require_new(study, tmp_path / "bag")
    entry = study.next_entry("S07", 3)
    study.add(entry, {})
    shutil.copytree(tmp_path / "bag", entry.source)
    renamed = tmp_path / "bag" / "renamed.mcap"
    next((tmp_path / "bag").glob("*.mcap")).rename(renamed)
    words = r"is in the study already, as .*sub-S07_ses-03_run-01_bag: renamed.mcap and .* SHA-256"
    with pytest.raises(AnalysisError, match=words.replace(" SHA", r" \(SHA")):
        require_new(study, tmp_path / "bag")
    renamed.write_bytes(renamed.read_bytes()[:-1] + b"?")  # of the same size
    require_new(study, tmp_path / "bag")


def test_a_file_is_known_again_and_an_empty_one_is_no_recording(study, tmp_path):
    entry = study.next_entry("S07", 1)
    study.add(entry, {})
    held = entry.source.with_name(f"{entry.name}.csv")
    held.write_text("1,2\n")
    (tmp_path / "trial.csv").write_text("1,2\n")
    with pytest.raises(AnalysisError, match=r"trial\.csv is in the study already"):
        require_new(study, tmp_path / "trial.csv")
    for file in (held, tmp_path / "trial.csv"):
        file.write_text("")
    require_new(study, tmp_path / "trial.csv")


@pytest.mark.live
def test_the_command_adds_a_recording_once(study, tmp_path):
    (tmp_path / "trial.csv").write_text("1,2\n")

    def add(subject):
        command = [ANKLE, "study", "add", study.folder, tmp_path / "trial.csv"]
        command += ["--subject", subject, "--visit", "1"]
        return subprocess.run(command, capture_output=True, text=True)

    assert add("S07").returncode == 0
    again = add("S08")
    assert again.returncode
    assert "nothing is copied" in " ".join((again.stdout + again.stderr).split())
    assert [entry.name for entry in study.entries()] == ["sub-S07_ses-01_run-01"]
