"""Every command of README and documentation is one that exists, with options, parameters, files and
topics that exist. `test_documented_runs` runs them.
"""

import importlib.util
import re
import subprocess
import sys
from datetime import datetime, timezone
from itertools import pairwise

import pytest
from documented_commands import PAGES, ROOT, commands, words_of
from typer.testing import CliRunner

from ankle_bringup.command_line import app, load_verb, verb_names
from ankle_bringup.executables import declared_parameters, find_executable
from ankle_bringup.graph import load_graph
from ankle_interfaces.topics import TOPICS
from ankle_physics.rig_file import RigFile

ALL = [(page.relative_to(ROOT), line) for page in PAGES for line in commands(page)]
ANKLE = ".venv/bin/ankle"
OTHER_PROGRAMS = ("rqt_plot",)
"""Packages of a Jazzy desktop that are not ours."""
ROS2_WORDS = {
    "run": 3,
    "launch": 3,
    "topic": 2,
    "param": 2,
    "bag": 2,
    "lifecycle": 2,
    "security": 2,
}
"""Words of the ``ros2`` command that the documentation uses, and the words that each needs."""


def is_of(*programs):
    return [(page, line) for page, line in ALL if words_of(line)[0] in programs]


def options_of(words):
    return {word.partition("=")[0] for word in words if re.match(r"--?[a-z]", word)}


def test_nothing_but_these_programs_is_documented():
    programs = (ANKLE, ".venv/bin/python", "python3", "make", "ros2", "rosdep", "colcon", "sudo")
    assert is_of(*programs) == ALL


@pytest.mark.parametrize(("page", "line"), is_of(ANKLE))
def test_every_documented_verb_takes_the_documented_options(page, line, tmp_path):
    words = words_of(line)[1:]
    if words[0].startswith("--"):
        assert words[0] in CliRunner().invoke(app, ["--help"]).output
        return
    command = load_verb(words[0], verb_names()[words[0]])
    rest = words[1:]
    if words[0] == "run":
        check_node(rest)
        return
    if hasattr(command, "commands"):
        command = command.commands[rest[0]]
        rest = rest[1:]
    known = {option for parameter in command.params for option in parameter.opts} | {"--help"}
    assert options_of(rest) <= known, f"{page}: {line}"
    if words[0] == "up":
        check_graph(rest, tmp_path)
    if words[0] == "params" and len(rest) > 1:
        check_parameter(rest[0], rest[1])


def check_graph(words, folder):
    """A graph and what is set in it exist."""
    rig = folder / "rig.yaml"
    RigFile("documented", datetime(2026, 1, 1, tzinfo=timezone.utc)).save(rig)
    graph = load_graph("simulated" if not words or words[0].startswith("-") else words[0])
    settings = [value for option, value in pairwise(words) if option == "--set"]
    # The line to a rig that the reader has written in the step before is in the reader's tree only.
    settings = [setting.replace("link=ethercat", "link=udp") for setting in settings]
    # As is the rig file that is emulated.
    graph.with_settings([setting.replace("hidden.yaml", str(rig)) for setting in settings])


def check_node(words):
    """A package, its executable and the parameters behind it exist."""
    entry = find_executable(words[0], words[1])
    given = [word.partition(":=")[0] for word in words if ":=" in word and "__" not in word]
    known = declared_parameters(entry, {"subject": 0}) if given else {}
    assert set(given) <= set(known), words


def check_parameter(node, name):
    """A node, found by its name, has a parameter."""
    for path in ROOT.glob(f"src/*/*/{node}_node.py"):
        entry = find_executable(path.parent.name, node)
        assert name in declared_parameters(entry, {"subject": 0})
        return
    raise AssertionError(f"no node '{node}'")


@pytest.mark.parametrize(("page", "line"), is_of("ros2"))
def test_what_is_documented_for_ros2_exists(page, line):
    words = words_of(line)[1:]
    assert words[0] in ROS2_WORDS, f"{page}: {line}"
    if len(words) < ROS2_WORDS[words[0]] or words[1] in OTHER_PROGRAMS:
        pass
    elif words[0] == "run":
        check_node(words[1:])
    elif words[0] == "launch":
        file = ROOT / "src" / words[1] / "launch" / words[2]
        declared = set(re.findall(r'DeclareLaunchArgument\(\s*"(\w+)"', file.read_text()))
        assert {word.partition(":=")[0] for word in words[3:]} <= declared
    elif words[0] == "param" and len(words) > 3:
        check_parameter(words[2].lstrip("/"), words[3])
    elif words[0] == "topic" and len(words) > 2:
        assert words[2] in {topic.absolute for topic in TOPICS}
    for topic in re.findall(r"(/\w+/\w+)/data", line):
        assert topic in {one.absolute for one in TOPICS}, f"{page}: {line}"


@pytest.mark.parametrize(("page", "line"), is_of(".venv/bin/python", "python3"))
def test_every_documented_program_exists_with_its_options(page, line):
    words = words_of(line)[1:]
    if words[:2] == ["-m", "pip"]:
        assert all((ROOT / w).exists() for w in words if w.startswith("requirements/"))
        return
    if words[:2] == ["-m", "pytest"]:
        files = [word for word in words if word.endswith(".py")]
        assert files
        assert all((ROOT / file).exists() for file in files), f"{page}: {line}"
        if "-k" in words:
            wanted = words[words.index("-k") + 1]
            assert any(wanted in (ROOT / file).read_text() for file in files), f"{page}: {line}"
        return
    module = words[0] == "-m"
    file = importlib.util.find_spec(words[1]).origin if module else words[0]
    text = (ROOT / file).read_text()
    options = options_of(words[1:]) - {"-m"}
    if not all(f'"{option}"' in text for option in options):
        asked = ["-m", words[1]] if module else [ROOT / words[0]]
        text = subprocess.run(
            [sys.executable, *asked, "--help"],
            capture_output=True,
            text=True,
            timeout=100,
            check=True,
        ).stdout
        assert all(re.search(rf"{option}\b", text) for option in options), f"{page}: {line}"


@pytest.mark.parametrize(("page", "line"), is_of("make"))
def test_every_documented_target_exists(page, line):
    targets = [w for w in words_of(line)[1:] if "=" not in w and not w.startswith("-")]
    rules = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M)
    assert set(targets) <= set(rules), f"{page}: {line}"
