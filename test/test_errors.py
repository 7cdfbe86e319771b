"""An error of a user is told from one of the program, wherever it is raised."""

import ast
from pathlib import Path

import pytest

from ankle_interfaces.error_report import PROGRAM_ERROR, USERS_ERROR, report_error
from ankle_interfaces.errors import QuantityError

SOURCES = sorted(
    path
    for path in (Path(__file__).resolve().parents[1] / "src").glob("*/*/**/*.py")
    if path.parts[path.parts.index("src") + 2] == path.parts[path.parts.index("src") + 1]
)
BASE = "UserError"
BUILT_IN = {"Exception", "KeyError", "LookupError", "RuntimeError", "TypeError", "ValueError"}
REASONS = {
    ("virtual_subject.py", "advance"): "the rig's own code commands a state first",
    ("rigs.py", "_differenced"): "the trials are a table of the package",
    ("linear_dynamics.py", "run"): "the caller states the longest delay itself",
    ("differences.py", "backward_difference"): "the order is a constant of an algorithm",
    ("correlation_estimator.py", "__init__"): "settings come from the algorithm's own type",
    ("correlation_estimator.py", "process"): "the stream arranges the columns",
    ("simultaneous_estimator.py", "__init__"): "settings come from the algorithm's own type",
    ("simultaneous_estimator.py", "process"): "the stream arranges the columns",
    ("recorded_estimates.py", "estimate_signal"): "the caller's arrays differ in length",
    ("torque_prediction.py", "checked_signals"): "the caller's arrays differ in length",
    ("messages.py", "_schema"): "the messages are classes of the package",
    ("course_record.py", "load_record"): "caught there and reported as CommandError",
    ("progress.py", "progress_from"): "caught there and reported as CommandError",
    ("session_program.py", "__init__"): "the node gives one of the two",
    ("correlation.py", "cross_correlation"): "the caller's arrays differ in length",
    ("draw.py", "draw_cases"): "the kinds are options of a command",
    ("generic_bank.py", "__init__"): "the caller asks for a bank that needs what is not known",
}
"""Built-in errors that no user causes, by file and function, and why."""


def exception_classes():
    """Every class of the packages with an exception among its bases: name, bases and file."""
    found = {}
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef):
                bases = [ast.unparse(base) for base in node.bases]
                if any(base.endswith(("Error", "Refused", "Exception")) for base in bases):
                    found[node.name] = (bases, path)
    return found


def raised_built_ins():
    """File and function of each ``raise`` of a built-in class."""
    found = set()
    for path in SOURCES:
        for function in ast.walk(ast.parse(path.read_text())):
            if not isinstance(function, (ast.FunctionDef, ast.AsyncFunctionDef)):
                continue
            for node in ast.walk(function):
                raised = node.exc if isinstance(node, ast.Raise) else None
                name = raised.func if isinstance(raised, ast.Call) else raised
                if isinstance(name, ast.Name) and name.id in BUILT_IN:
                    found.add((path.name, function.name))
    return found


def test_every_error_class_of_the_packages_is_a_users_error():
    classes = exception_classes()
    assert len(classes) > 20
    for name, (bases, path) in classes.items():
        inherited = set(bases)
        for base in bases:
            inherited |= set(classes.get(base, ([], path))[0])
        assert BASE in inherited or name == BASE, f"{path}: {name} does not inherit {BASE}"


def test_a_built_in_error_is_raised_only_where_no_user_causes_it():
    assert raised_built_ins() == set(REASONS)


def test_an_error_of_the_program_names_its_place_and_keeps_its_traceback(
    capsys, tmp_path, monkeypatch
):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(ValueError, match="min") as caught:
        min([])
    assert report_error(caught.value) == PROGRAM_ERROR
    said = capsys.readouterr().err
    assert said.startswith("error of the program")
    assert f"{Path(__file__).name}:" in said
    assert said.count("\n") == 1
    (kept,) = tmp_path.iterdir()
    assert str(kept) in said
    assert "min([])" in kept.read_text()


def test_where_no_file_can_be_kept_the_traceback_follows(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    with pytest.raises(ZeroDivisionError) as caught:
        _ = 1 / 0
    assert report_error(caught.value) == PROGRAM_ERROR
    assert "Traceback (most recent call last)" in capsys.readouterr().err


@pytest.mark.parametrize(
    "error", [QuantityError("rate = 0 Hz"), FileNotFoundError(2, "No such file", "bag")]
)
def test_an_error_of_the_user_is_one_line(capsys, error):
    assert report_error(error) == USERS_ERROR
    assert capsys.readouterr().err == f"error: {error}\n"
