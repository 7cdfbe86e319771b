"""The study of files without a command counts what is doubted, and what should be."""

from simulation_study.file_without_command import CHANNELS, Estimated, estimated, report
from simulation_study.verdict_study import ordered


def test_recordings_are_counted_by_their_errors():
    words = "angle and torque"
    found = [
        Estimated("null-1", words, {"K": 1.0, "G": -3.0}, False),
        Estimated("null-2", words, {"K": 2.0, "G": 5.0}, True),
        Estimated("effect-1", words, {"K": -30.0, "G": 0.0}, True),
        Estimated("effect-2", words, {"K": 3.0, "G": 26.0}, False),
        Estimated("effect-3", words, {"K": 4.0, "G": 4.0}, False),
    ]
    row = next(line for line in report(found, "command").splitlines() if f"| {words} |" in line)
    assert "1.5 %, 4.0 % | 4.0 %, 4.0 %" in row
    counted = row.split("|")[4:7]
    assert [cell.split("(")[0].strip() for cell in counted] == ["1 of 2", "0 of 1", "1 of 2"]
    assert "| effect-1 | -30.0, +0.0 doubted |" in report(found, "command")


def test_a_recording_is_estimated_from_every_set_of_channels():
    plan = next(iter(ordered({"null": 1}, 3, [])))
    found = estimated(plan)
    assert [one.channels for one in found] == list(CHANNELS)
    assert len({one.errors["K"] for one in found}) == len(CHANNELS)
    assert all(abs(one.errors["K"]) < 10.0 for one in found)
