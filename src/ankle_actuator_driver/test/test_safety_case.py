"""The safety case names controls and tests that exist."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PLACES = {
    "driver/": "ankle_actuator_driver/ankle_actuator_driver/",
    "rig/": "rig_emulator/rig_emulator/",
    "tests/": "ankle_actuator_driver/test/",
}
LEAST_HAZARDS = 40


def placed(path):
    """The file that a path of the page means."""
    for short, full in PLACES.items():
        if path.startswith(short):
            path = full + path.removeprefix(short)
    return ROOT / "src" / path


def rows():
    text = (ROOT / "docs" / "safety_case.md").read_text()
    return [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if re.match(r"\| H\d+ ", line)
    ]


def test_every_hazard_has_a_control_and_a_test_that_exist():
    found = rows()
    assert len(found) >= LEAST_HAZARDS
    assert [row[0] for row in found] == [f"H{k + 1}" for k in range(len(found))]
    for identity, hazard, cause, control, test, _ in found:
        assert hazard, identity
        assert cause, identity
        assert placed(control.strip("`")).is_file(), f"{identity}: no {control}"
        file, _, name = test.strip("`").partition("::")
        assert placed(file).is_file(), f"{identity}: no {file}"
        tree = ast.parse(placed(file).read_text())
        tests = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
        assert name in tests, f"{identity}: no test {name} in {file}"


def test_every_module_of_the_safety_is_named_by_the_safety_case_or_used_by_one_that_is():
    """A control that nobody claims would be removed without anybody noticing."""
    text = (ROOT / "docs" / "safety_case.md").read_text()
    folder = placed("driver/safety")
    named = {path.stem for path in folder.glob("*.py") if f"safety/{path.name}" in text}
    helping = {"__init__", "rig", "watchdog", "command_record"}
    assert {path.stem for path in folder.glob("*.py")} - named <= helping
