"""Every command of README and documentation is run as it stands there, in the order of its page.

Each page has a folder of its own, a copy of this repository that is set up already. What a command
reads is there under the name that the page gives it.
"""

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager, suppress
from itertools import pairwise
from tempfile import TemporaryFile

import pytest
from documented_commands import ROOT, words_of
from documented_inputs import OUTPUTS, Inputs
from documented_runs import (
    EXACT_RUNS,
    LONG_PATIENCE,
    NOT_RUN,
    PATIENCE,
    START_TIME,
    Run,
    documented,
    to_run,
)

from impedance_estimator import compile_estimator
from impedance_estimator.algorithms import DEFAULT

PROGRAMS = {"python": "", "ankle": " -m ankle_bringup.command_line", "colcon": " -m colcon"}
LEFT_OUT = (".venv*", "build", "install", ".git", "__pycache__", ".*_cache")
INTERRUPTED = (0, 128 + signal.SIGINT, -signal.SIGINT)
"""What a command may return behind Ctrl-C."""
ENDING = 60.0
"""[s] For a graph that got Ctrl-C on a busy computer."""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    return Inputs(tmp_path_factory.mktemp("inputs"))


@pytest.fixture(scope="module")
def clones(tmp_path_factory):
    """Return the folder of a page: what a reader has behind `make setup`."""
    made = {}

    def clone(page, live=False):
        if (page, live) not in made:
            folder = tmp_path_factory.mktemp("page") / "clone"
            shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(*LEFT_OUT))
            (folder / ".venv" / "bin").mkdir(parents=True)
            for name, arguments in PROGRAMS.items():
                file = folder / ".venv" / "bin" / name
                file.write_text(f'#!/bin/sh\nexec {sys.executable}{arguments} "$@"\n')
                file.chmod(0o755)
            for stamp in ("packages", "set-up"):
                (folder / ".venv" / stamp).touch()
            made[page, live] = folder
        return made[page, live]

    return clone


@contextmanager
def started(line, folder, asks_shell=False):
    """Start a command through the shell, with a home of its own; nothing of it is left behind."""
    # Started in the background a test ignores Ctrl-C, and so would what it starts. A shell that is
    # replaced by the command cannot be asked for its name.
    program = f"{line}; exit $?" if asks_shell else f"exec env --default-signal=INT {line}"
    with TemporaryFile("a+", dir=folder.parent, errors="replace") as output:
        process = subprocess.Popen(
            ["bash", "-c", program],
            cwd=folder,
            env={**os.environ, "HOME": str(folder.parent), "XDG_CACHE_HOME": str(folder.parent)},
            stdout=output,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )

        def shown():
            output.seek(0)
            return output.read()

        try:
            yield process, shown
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def carry_out(line, run, folder):
    """Run a command to its end, or until Ctrl-C once it works; return what it says."""
    with started(line, folder, run.asks_shell) as (process, shown):
        if run.stopped:
            ended = None
            with suppress(subprocess.TimeoutExpired):
                ended = process.wait(run.stopped)
            # A command that was quick enough has done its work; a node or a graph has not.
            assert ended is None or (ended == 0 and not run.well), f"{line}\n{shown()}"
            if ended is None and run.well:
                os.killpg(process.pid, signal.SIGINT)
                assert process.wait(ENDING) in INTERRUPTED, f"{line}\n{shown()}"
                assert "Traceback" not in shown(), f"{line}\n{shown()}"
                assert "error:" not in shown(), f"{line}\n{shown()}"
        else:
            assert process.wait(run.patience) == run.code, f"{line}\n{shown()}"
        return shown()


def expect_outputs(line, run, folder):
    """Ask for the files and folders that a finished command was told to write."""
    words = words_of(line)
    for before, word in pairwise(words):
        if before in OUTPUTS and not (run.stopped and not run.well):
            assert (folder / word).exists(), f"{line}: {word} was not written"


def params(live, quick=False):
    return [
        pytest.param(page, line, run, id=f"{page}: {line}")
        for page, line, run in to_run(live)
        if run.quick == quick
    ]


def check(page, line, run, clones, inputs):
    folder = clones(page, run.live)
    inputs.provide(line, page, folder)
    said = carry_out(line, run, folder)
    assert " ".join(run.says.split()) in " ".join(said.split()), f"{line}\n{said}"
    expect_outputs(line, run, folder)


@pytest.mark.timeout(PATIENCE + 60)
@pytest.mark.parametrize(("page", "line", "run"), params(False, quick=True))
def test_a_short_command_runs_as_documented(page, line, run, clones, inputs):
    check(page, line, run, clones, inputs)


@pytest.mark.slow
@pytest.mark.timeout(LONG_PATIENCE + 900)
@pytest.mark.parametrize(("page", "line", "run"), params(False))
def test_a_long_command_runs_as_documented(page, line, run, clones, inputs):
    check(page, line, run, clones, inputs)


@pytest.fixture(scope="module")
def graphs(tmp_path_factory):
    """Keep a graph running as long as the commands in turn need the same one."""
    compile_estimator(DEFAULT)  # so that no graph has to wait for it
    kept = ExitStack()
    running = [""]

    def beside(wanted, folder):
        if running[0] != wanted:
            kept.close()
            running[0] = ""
            if wanted:
                process, shown = kept.enter_context(started(wanted, folder))
                time.sleep(START_TIME)
                assert process.poll() is None, shown()
            running[0] = wanted

    with kept:
        yield beside


@pytest.mark.live
@pytest.mark.slow
@pytest.mark.timeout(LONG_PATIENCE + 900)
@pytest.mark.parametrize(("page", "line", "run"), params(True))
def test_a_command_of_a_running_graph_runs_as_documented(page, line, run, clones, inputs, graphs):
    graphs(run.beside, clones("beside"))
    for before in run.before:
        carry_out(before, Run(), clones("beside"))
    check(page, line, run, clones, inputs)


def test_each_documented_command_is_run_or_has_a_reason_why_not():
    lines = [line for _, line in documented()]
    assert set(NOT_RUN) <= set(lines), "not documented"
    assert set(EXACT_RUNS) <= set(lines), "not documented"
    run = {line for live in (True, False) for _, line, _ in to_run(live)}
    ros2 = {line for line in lines if words_of(line)[0] == "ros2"}
    assert run | ros2 | set(NOT_RUN) == set(lines)
    assert run.isdisjoint(NOT_RUN)


def test_a_command_that_fails_is_noticed(tmp_path):
    folder = tmp_path / "clone"
    folder.mkdir()
    for line, run in [
        ("false", Run()),
        ("true", Run(stopped=5.0, well=True)),
        ("false", Run(stopped=5.0)),
        ("sh -c 'echo error: no rig; sleep 9'", Run(stopped=1.0, well=True)),
    ]:
        with pytest.raises(AssertionError):
            carry_out(line, run, folder)
    with pytest.raises(AssertionError, match="was not written"):
        expect_outputs("true --out report", Run(), folder)
