"""The command of a study works through what its options ask for and writes one table."""

import sys

import pytest

from simulation_study.counted_table import write_table


def test_options_say_how_many_recordings_of_each_kind_are_worked_through(
    tmp_path, monkeypatch, capsys
):
    arguments = ["--seed", "3", "--nulls", "2", "--pairs", "1", "--out", str(tmp_path / "new")]
    monkeypatch.setattr(sys, "argv", ["a study", *arguments])
    write_table(
        "a_study",
        "Counts.",
        {"null": 40, "pair": 40},
        lambda plan: [plan.kind],
        lambda found, command: f"{sorted(found)} by {command}",
    )
    words = (
        "['null', 'null', 'pair'] by .venv/bin/python -m simulation_study.a_study --seed 3 "
        "--nulls 2 --pairs 1 --out FOLDER"
    )
    assert (tmp_path / "new" / "a_study.md").read_text() == words
    told = capsys.readouterr()
    assert words in told.out
    assert "3 of 3" in told.err


def test_a_study_without_a_seed_is_refused(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["a study", "--out", "anywhere"])
    with pytest.raises(SystemExit):
        write_table("a_study", "Counts.", {"null": 1}, lambda _: [], lambda *_: "")
