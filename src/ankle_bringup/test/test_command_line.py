"""The `ankle` command: every verb through its app, the options that all share, mistakes by name."""

import io
import json
import subprocess
import sys

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from ankle_bringup import processes, verbs
from ankle_bringup.command_line import app, load_verb, main, verb_names
from ankle_bringup.errors import GraphError, RunError
from ankle_bringup.executables import declared_parameters, executables, packages_with_nodes
from ankle_bringup.graph import load_graph
from ankle_bringup.terminal import LOG_PERIOD, LogLines, as_json, clear_folder, new_table
from ankle_bringup.verbs.diagnose import base_values
from ankle_interfaces.error_report import PROGRAM_ERROR

RATE = 1000


def ankle(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture
def extra_verb(tmp_path, monkeypatch):
    """A folder of verbs beside those of the package."""
    monkeypatch.setattr(verbs, "__path__", [*verbs.__path__, str(tmp_path)])

    def add(name, text):
        (tmp_path / f"{name}.py").write_text(text)

    yield add
    for file in tmp_path.glob("*.py"):
        sys.modules.pop(f"{verbs.__name__}.{file.stem}", None)


@pytest.fixture
def table(tmp_path):
    """A short recording as CSV: an ankle of 100 N.m/rad and 1 N.m.s/rad under a multisine."""
    t = np.arange(4 * RATE) / RATE
    frequencies = np.array([0.7, 1.9, 4.3])[:, None]
    phase = 2 * np.pi * frequencies * t
    position = 0.02 * np.sin(phase).sum(axis=0)
    velocity = 0.02 * (2 * np.pi * frequencies * np.cos(phase)).sum(axis=0)
    rows = np.column_stack([t, position, 100 * position + velocity])
    path = tmp_path / "trial.csv"
    np.savetxt(path, rows, delimiter=",", header="time,angle,moment", comments="")
    return path


COLUMNS = ("-c", "t[s]=time", "-c", "position[rad]=angle", "-c", "torque[N.m]=moment")


@pytest.mark.parametrize(("name", "module"), verb_names().items())
def test_every_verb_has_help_with_an_example_and_the_shared_options(name, module):
    result = ankle(name, "--help")
    assert result.exit_code == 0, result.output
    command = load_verb(name, module)
    if hasattr(command, "commands"):
        for word, part in command.commands.items():
            assert f"Example: ankle {name} {word}" in " ".join(part.help.split())
    elif name != "run":
        assert f"Example: ankle {name}" in " ".join(result.output.split())
        assert "--quiet" in result.output


def test_options_have_the_same_name_in_every_verb():
    for name, module in verb_names().items():
        for parameter in getattr(load_verb(name, module), "params", []):
            if parameter.name == "out":
                assert "--out" in parameter.opts, name
                assert "-o" in parameter.opts, name
            assert parameter.name not in ("force_overwrite", "replace", "output"), name


@pytest.mark.parametrize(
    "name", ["estimate", "emg", "import", "export", "diagnose", "compare", "resimulate", "validate"]
)
def test_what_writes_a_result_knows_overwrite(name):
    options = {o for p in load_verb(name, verb_names()[name]).params for o in p.opts}
    assert "--overwrite" in options


STUDIES = ("table2", "virtual-study", "robustness", "blind")
ANALYSES = ("estimate", "emg", "import", "export", "diagnose", "compare", "resimulate", "validate")


@pytest.mark.parametrize("name", [*ANALYSES, "design-experiment", *STUDIES])
def test_what_computes_a_result_gives_it_as_json(name):
    options = {o for p in load_verb(name, verb_names()[name]).params for o in p.opts}
    assert "--json" in options


def test_units_in_brackets_stay_in_the_help():
    assert "[Hz]" in ankle("import", "--help").output
    assert "'t[s]=time'" in ankle("import", "--help").output
    assert "position[rad]" in ankle("import", "--help").output


def test_the_version_is_that_of_the_package():
    assert ankle("--version").output.split()[0] == "ankle"


def test_a_verb_is_one_file(extra_verb):
    extra_verb(
        "double_it",
        'def verb(number: float) -> dict[str, float]:\n    """Double.\n\n'
        '    Example: ankle double-it 2\n    """\n    return {"twice[1]": 2 * number}\n',
    )
    assert "double-it" in ankle("--help").output
    result = ankle("double-it", 2.5, "--json")
    assert json.loads(result.output) == {"twice[1]": 5.0}


@pytest.mark.parametrize("terminal", [False, True])
def test_a_log_gets_a_line_of_progress_now_and_then_and_a_terminal_none(terminal):
    text, now = io.StringIO(), [0.0]
    lines = LogLines(Console(file=text, force_terminal=terminal), lambda: now[0])
    for second in range(35):
        now[0] = float(second)
        lines(f"recording {second}")
    written = [f"recording {k * LOG_PERIOD:.0f}" for k in (1, 2, 3)]
    assert text.getvalue().splitlines() == ([] if terminal else written)


def test_quiet_keeps_results_off_the_terminal(extra_verb):
    extra_verb(
        "speak",
        "from ankle_bringup.terminal import console\n"
        'def verb() -> None:\n    """Speak."""\n    console.print("position[rad]")\n',
    )
    assert ankle("speak").output.strip() == "position[rad]"
    assert ankle("speak", "--quiet").output == ""
    assert ankle("speak").output.strip() == "position[rad]"


@pytest.mark.parametrize("group", [(), ("calibrate",), ("study",)])
def test_the_list_of_commands_cuts_no_sentence(group):
    listed = ankle(*group, "--help").output.partition("Commands:")[2]
    assert listed
    assert "..." not in listed


@pytest.mark.parametrize(
    ("arguments", "suggestion"),
    [
        (("estimat",), "estimate"),
        (("estimate", "bag", "--overwritten"), "--overwrite"),
        (("estimate", "bag", "--ot", "x"), "--out"),
        (("rig", "stopp"), "stop"),
    ],
)
def test_a_mistyped_verb_or_option_is_refused_with_a_suggestion(arguments, suggestion):
    result = ankle(*arguments)
    assert result.exit_code == 2
    assert suggestion in result.output


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("ankle_simm.K=80.0", "did you mean 'ankle_sim'"),
        ("impedance_estimator.algoritm=CE", "did you mean 'algorithm'"),
        ("perturbation_generator.amplitud=1.0", "did you mean 'amplitude'"),
    ],
)
def test_a_mistyped_setting_is_refused_with_a_suggestion(setting, words):
    with pytest.raises(GraphError, match=words):
        load_graph("simulated").with_settings([setting])


def test_bad_input_is_one_line_on_stderr(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["ankle", "estimate", str(tmp_path / "nothing")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    lines = capsys.readouterr().err.strip().splitlines()
    assert [line for line in lines if line.startswith("error: ")] == lines[-1:]


def test_an_error_of_the_program_does_not_look_like_the_users(extra_verb, capfd, monkeypatch):
    extra_verb(
        "fail_inside",
        'def verb() -> None:\n    """Fail.\n\n    Example: ankle fail-inside\n    """\n'
        "    min([])\n",
    )
    monkeypatch.setattr(sys, "argv", ["ankle", "fail-inside"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == PROGRAM_ERROR
    said = capfd.readouterr().err
    assert said.startswith("error of the program")
    assert "fail_inside.py:6" in said


def test_a_file_that_is_no_recording_is_refused_with_the_verb_that_makes_one(tmp_path):
    file = tmp_path / "trial.csv"
    file.write_text("Time (s),Angle (deg)\n")
    for verb in ("estimate", "open"):
        refused = ankle(verb, file, "--out", tmp_path / "result")
        assert refused.exit_code == 1
        assert f"ankle import {file}" in str(refused.exception)
    refused = ankle("design-experiment", tmp_path)
    assert "the folder that 'ankle diagnose' has written" in str(refused.exception)
    refused = ankle("design-experiment", tmp_path / "nothing")
    assert "there is no" in str(refused.exception)
    assert "the folder that 'ankle diagnose' has written" in str(refused.exception)


@pytest.mark.parametrize("verb", [("table2",), ("robustness",), ("blind",), ("study", "run", ".")])
def test_a_study_without_a_process_to_compute_it_is_refused(verb):
    refused = ankle(*verb, "--workers", 0)
    assert refused.exit_code == 2
    assert "--workers" in refused.output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("up", "--seconds", -3), "'seconds' = -3.0 s is refused; allowed: 0 to 1e+06 s"),
        (("calibrate", "session", "--seconds", -3), "= -3.0 s is refused; allowed: 30 to 600 s"),
        (("robustness", "--seconds", 3), "'seconds' = 3.0 s is refused; allowed: 50 to 3600 s"),
        (("robustness", "--recordings", 0), "'recordings' = 0 is refused"),
        (("robustness", "--repeats", 0), "'repeats' = 0 is refused"),
        (("investigate", "bag", "--rounds", 11), "'rounds' = 11 is refused; allowed: whole number"),
        (("course", "demonstration", "--change", 60), "60.0 % is refused; allowed: -50 to 50 %"),
        *(((verb, "--seed", -1), "'seed' = -1 is refused") for verb in STUDIES),
        (("demo", "--seconds", -5), "'seconds' = -5.0 s is refused; allowed: 10 to 3600 s"),
        (("demo", "--trials", "nosuchdir"), "nosuchdir"),
        (("open", "bag", "--diagnosis", "nosuch"), "nosuch"),
    ],
)
def test_a_wrong_option_is_refused_with_value_unit_and_range_before_anything_starts(
    arguments, words, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    refused = ankle(*arguments)
    assert refused.exit_code == 2
    assert words in " ".join(refused.output.replace("│", " ").split())
    assert [*tmp_path.iterdir()] == []


def test_a_visit_needs_its_subject_and_a_study(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "needs --subject and --visit" in str(ankle("up", "simulated", "--visit", 3).exception)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("diagnose", "bag", "--model", "nosuch.yaml"), "no model file at nosuch.yaml"),
        (("calibrate", "session", "bag", "--rig", "nosuch.yaml"), "no rig file at nosuch.yaml"),
        (
            ("run", "ankle_sim", "ankle_sim", "--ros-args", "--params-file", "none.yaml"),
            "no parameter file at none.yaml",
        ),
    ],
)
def test_a_missing_file_is_named_with_what_it_should_be(arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused = ankle(*arguments)
    assert refused.exit_code == 1
    assert str(refused.exception) == words


def test_help_behind_a_node_describes_it_and_starts_nothing():
    result = ankle("run", "impedance_estimator", "impedance_estimator", "--help")
    assert result.exit_code == 0, result.output
    assert "/impedance/estimate" in result.output
    assert "algorithm" in result.output
    listed = ankle("run", "--help").output
    assert "perturbation_generator" in listed


def test_every_parameter_of_every_node_says_what_it_is():
    for package in packages_with_nodes():
        for entry in executables(package).values():
            for name, parameter in (declared_parameters(entry, {"subject": 0}) or {}).items():
                assert parameter.explanation, f"{entry.name}: {name}"


def test_a_narrow_terminal_cuts_no_name():
    text = io.StringIO()
    table = new_table(("parameter", "what it is"))
    table.add_row("voluntary_torque.cutoff", "see hard_acceleration_limit_of_the_driver")
    Console(file=text, width=48).print(table)
    assert "voluntary_torque.cutoff" in text.getvalue()
    assert "…" not in text.getvalue()


def test_a_first_column_of_several_words_leaves_room_for_the_others():
    text = io.StringIO()
    table = new_table(("perturbation", "hardest pair", "minutes"))
    words = "random steps of 0.04 rad, each held for 0.2 to 0.6 s, about a lean of 5 N.m and 10 N.m"
    table.add_row(words, "tendon / backlash", "under 1")
    Console(file=text, width=80).print(table)
    assert "tendon / backlash" in text.getvalue()
    assert "under 1" in text.getvalue()
    assert max(map(len, text.getvalue().splitlines())) <= 80


def test_a_recording_goes_in_and_out_and_is_not_replaced_unasked(table, tmp_path):
    bag = tmp_path / "bag"
    into = ("import", table, "--out", bag, *COLUMNS, "--torque-sign", "rig", "--json")
    assert json.loads(ankle(*into).output)["out"] == str(bag)
    again = ankle(*into)
    assert again.exit_code == 1
    assert f"{bag} is there already; give another --out, or add --overwrite" == str(again.exception)
    assert ankle(*into, "--overwrite").exit_code == 0
    written = ankle("export", bag, "--out", tmp_path / "csv", "--json")
    files = json.loads(written.output)["written"]
    assert any("ankle" in file for file in files)
    assert "is a bag" in str(ankle("export", bag, "--out", bag, "--overwrite").exception)
    assert "--overwrite" in str(ankle("export", bag, "--out", tmp_path / "csv").exception)
    page = bag.with_name("bag.html")
    page.write_text("mine")
    assert "--overwrite" in str(ankle("open", bag, "--no-browser").exception)
    assert page.read_text() == "mine"


def test_only_an_earlier_result_is_replaced(tmp_path):
    folder = tmp_path / "result"
    clear_folder(folder, False, "verdict.json")
    folder.mkdir()
    (folder / "thesis.txt").write_text("years of work")
    with pytest.raises(RunError, match="--overwrite"):
        clear_folder(folder, False, "verdict.json")
    with pytest.raises(RunError, match="no earlier result"):
        clear_folder(folder, True, "verdict.json")
    (folder / "verdict.json").write_text("{}")
    clear_folder(folder, True, "verdict.json")
    assert not folder.exists()


def test_json_has_no_numbers_that_json_lacks():
    text = as_json({"K[N.m/rad]": np.float64("nan"), "a": np.arange(2), "t": (1, 2.5)})
    assert json.loads(text) == {"K[N.m/rad]": None, "a": [0, 1], "t": [1, 2.5]}


def test_the_help_loads_no_numerics():
    program = (
        "import sys; from ankle_bringup.command_line import app; "
        "app(['--help'], standalone_mode=False); "
        "print({'numpy', 'scipy', 'numba', 'rclpy', 'matplotlib'} & set(sys.modules))"
    )
    shown = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    assert shown.stdout.strip().endswith("set()")


def test_import_without_columns_proposes_the_line_and_yes_follows_it(tmp_path):
    t = np.arange(10 * RATE) / RATE
    steps = np.repeat(np.random.default_rng(1).uniform(-0.02, 0.02, 50), 200)
    position = np.convolve(steps, np.hanning(20) / np.hanning(20).sum(), "same")
    velocity = np.gradient(position, t)
    torque = 0.0137 * np.gradient(velocity, t) + 0.6 * velocity + 90 * position
    source = tmp_path / "trial.csv"
    header = "Time (s),Ankle Angle (deg),Torque (Nm)"
    rows = np.column_stack([t, np.degrees(position), -torque])
    np.savetxt(source, rows, delimiter=",", header=header, comments="")
    shown = ankle("import", source, "--out", tmp_path / "bag")
    assert isinstance(shown.exception, RunError)
    assert "--column 't[s]=Time (s)'" in shown.output
    assert "--torque-sign subject" in shown.output
    assert not (tmp_path / "bag").exists()
    done = ankle("import", source, "--out", tmp_path / "bag", "--yes")
    assert done.exit_code == 0, done.output
    assert "units and sign fit: inertia 0.0137" in done.output
    assert "next: ankle estimate" in done.output


def test_estimate_without_a_valid_estimate_fails_and_says_why(table, tmp_path):
    ankle("import", table, "--out", tmp_path / "bag", *COLUMNS, "--torque-sign", "rig")
    result = ankle("estimate", tmp_path / "bag", "--out", tmp_path / "e", "--algorithm", "CE")
    assert result.exit_code != 0
    assert "none of" in str(result.exception)
    assert "lasts 4.0 s" in str(result.exception)
    assert (tmp_path / "e" / "report.html").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((), "no bag at"),
        (("--algorithm", "XY"), "algorithm 'XY' is not known; allowed: C"),
        (("--algorithm", "CE", "--highpass", "none"), "'highpass' = 'none' is refused"),
        (("--algorithm", "simultaneous", "--highpass", "all"), "has no --highpass; C, CE and O"),
        (("--rig", "nowhere.yaml"), "nowhere.yaml"),
    ],
)
def test_estimate_refuses_bad_input_and_keeps_the_earlier_result(options, words, tmp_path):
    earlier = tmp_path / "earlier"
    earlier.mkdir()
    (earlier / "metadata.yaml").write_text("earlier")
    result = ankle("estimate", tmp_path / "none", "--out", earlier, "--overwrite", *options)
    assert result.exit_code != 0
    assert words in str(result.exception)
    assert (earlier / "metadata.yaml").read_text() == "earlier"


def test_a_verdicts_base_values_say_what_an_estimate_compares_with():
    found = {"base": 59.87, "augmented": 28.17, "standard_error": 2.519}
    same = {"base": 33.6, "augmented": 33.6, "standard_error": None}
    first, second, remark = base_values({"K[N.m/rad]": found, "G[N.m.s/rad]": same})
    assert first == "K [N·m/rad]: 28.2 ± 2.5 with all that was found; 59.9 where that is left out"
    assert second == "G [N·m·s/rad]: 33.6"
    assert "compares with the values where the rest is left out" in remark
    assert base_values({"G[N.m.s/rad]": same}) == ["G [N·m·s/rad]: 33.6"]
    assert base_values({}) == []


def test_a_recorder_gets_the_rig_file_that_its_bag_carries(tmp_path, monkeypatch):
    commands = []
    monkeypatch.setattr(processes, "become", commands.append)
    rig = tmp_path / "rig.yaml"
    rig.touch()
    assert ankle("record", "monday", "--rig", rig).exit_code == 0
    assert f"rig:={rig}" in commands[0]
    assert "out:=monday" in commands[0]
    assert ankle("record", "monday", "--rig", tmp_path / "missing.yaml").exit_code == 2
    assert len(commands) == 1
