"""README, documentation and docstrings: what they say can be run, and is what the code has."""

import ast
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ankle_bringup.command_line import load_verb, verb_names

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [page for page in PAGES if "reference" not in page.parts]
ANKLE = ".venv/bin/ankle "


def commands(page):
    """The command lines of a page, from its code blocks and its tables, in their order."""
    text = page.read_text()
    found = re.findall(r"^ {4,}((?:\.venv/bin/|make |python|ros2 |colcon ).*)$", text, re.M)
    return [line.partition("  #")[0].strip() for line in found] + [
        line for line in re.findall(r"`(\.venv/bin/ankle [^`]*)`", text) if "..." not in line
    ]


ALL = [(page.relative_to(ROOT), line) for page in PAGES for line in commands(page)]


@pytest.mark.parametrize(("page", "line"), [(p, x) for p, x in ALL if x.startswith(ANKLE)])
def test_every_documented_verb_takes_the_documented_options(page, line):
    words = shlex.split(line.replace("[", "_").replace("]", "_"))[1:]
    if words[0].startswith("--"):
        return
    command = load_verb(words[0], verb_names()[words[0]])
    if words[0] == "run":
        return
    rest = words[1:]
    if hasattr(command, "commands"):
        command = command.commands[rest[0]]
        rest = rest[1:]
    known = {option for parameter in command.params for option in parameter.opts} | {"--help"}
    options = {word.partition("=")[0] for word in rest if re.match(r"--?[a-z]", word)}
    assert options <= known, f"{page}: {line}"
    assert not any("_NODE" in word for word in words)


@pytest.mark.parametrize(("page", "line"), [(p, x) for p, x in ALL if "-m pytest" in x])
def test_every_documented_test_exists(page, line):
    words = shlex.split(line)
    files = [word for word in words if word.endswith(".py")]
    assert files
    assert all((ROOT / file).exists() for file in files), f"{page}: {line}"
    if "-k" in words:
        wanted = words[words.index("-k") + 1]
        assert any(wanted in (ROOT / file).read_text() for file in files), f"{page}: {line}"


@pytest.mark.parametrize(("page", "line"), [(p, x) for p, x in ALL if x.startswith("make ")])
def test_every_documented_target_exists(page, line):
    targets = [w for w in shlex.split(line)[1:] if "=" not in w and not w.startswith("-")]
    rules = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M)
    assert set(targets) <= set(rules), f"{page}: {line}"


def run(line, folder, timeout):
    done = subprocess.run(
        line.replace(".venv/bin/python", sys.executable).replace(
            ".venv/bin/ankle", f"{sys.executable} -m ankle_bringup.command_line"
        ),
        shell=True,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )
    assert done.returncode == 0, f"{line}\n{done.stderr}"
    return done.stdout


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_tutorial_from_a_csv_runs_literally(tmp_path):
    page = ROOT / "docs" / "tutorials" / "csv_to_report.md"
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    # The public trials need the internet; `test_human_trials` fetches them from a local server.
    lines = [line for line in commands(page) if "trials" not in line and "trial_" not in line]
    assert len(lines) == 5
    for line in lines:
        run(line, tmp_path, 900)
    assert (tmp_path / "diagnosis" / "report.html").exists()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_site_is_built_without_a_warning(tmp_path):
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "-q", "-b", "html"]
    done = subprocess.run(
        [*command, ROOT / "docs", tmp_path],
        capture_output=True,
        text=True,
        timeout=800,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "reference" / "verbs.html").exists()


def documented(path):
    """Public functions of a file with the names of their arguments and of those documented."""
    for node in ast.walk(ast.parse(path.read_text())):
        if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
            continue
        text = ast.get_docstring(node) or ""
        section = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[^\n]*\n-+\n|\Z)", text, re.M | re.S)
        if section is None:
            continue
        names = re.findall(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*)(?: :.*)?$", section[1], re.M)
        stated = {name.strip().lstrip("*") for line in names for name in line.split(",")}
        signature = node.args
        have = {a.arg for a in (*signature.posonlyargs, *signature.args, *signature.kwonlyargs)}
        have |= {a.arg for a in (signature.vararg, signature.kwarg) if a is not None}
        yield node.name, stated, have


@pytest.mark.parametrize(
    "package", sorted(path.parent.name for path in ROOT.glob("src/*/setup.py"))
)
def test_what_a_docstring_calls_a_parameter_is_one(package):
    wrong = [
        f"{path.relative_to(ROOT)}: {name}: {sorted(stated - have)}"
        for path in sorted((ROOT / "src" / package / package).rglob("*.py"))
        for name, stated, have in documented(path)
        if stated - have
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_links_between_pages_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
        assert (page.parent / target).exists(), f"{page.name}: {target}"
