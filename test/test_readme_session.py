"""The README's commands that need a running graph or minutes, word for word, in a folder that looks
like a clone.
"""

import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest
from documented_commands import ROOT

from impedance_estimator import compile_estimator
from impedance_estimator.algorithms import DEFAULT

pytestmark = [pytest.mark.live, pytest.mark.slow, pytest.mark.timeout(1800)]

NODE = ".venv/bin/ankle run ankle_sim ankle_sim --ros-args -p K:=80.0"
UP = ".venv/bin/ankle up simulated"
RIG = ".venv/bin/ankle up rig --emulator"
ARM = ".venv/bin/ankle rig arm"
ECHO = ".venv/bin/ankle echo /impedance/estimate"
PARAMETERS = ".venv/bin/ankle params ankle_sim"
AMPLITUDE = ".venv/bin/ankle params perturbation_generator amplitude 0.05"
RECORD = ".venv/bin/ankle record --out session"
REPLAY = ".venv/bin/ankle replay session"
CALIBRATE = ".venv/bin/ankle calibrate session --seconds 90 --out subject.yaml"
SESSION = (NODE, UP, RIG, ARM, ECHO, PARAMETERS, AMPLITUDE, RECORD, REPLAY, CALIBRATE)
ANALYSIS = (
    ".venv/bin/ankle diagnose session --out diagnosis",
    ".venv/bin/ankle resimulate session diagnosis",
    ".venv/bin/ankle design-experiment diagnosis",
    ".venv/bin/ankle compare simulated session",
    ".venv/bin/ankle study run my_study",
    ".venv/bin/ankle study report my_study",
    ".venv/bin/ankle course down_training --simulate",
    ".venv/bin/ankle robustness --quick",
)
PATIENCE = 300.0
INTERRUPTED = 128 + signal.SIGINT
"""A command without an end of its own may say so; a node ends with 0."""
RECORDED = 45.0
"""[s] Longer than the estimator settles."""


@pytest.fixture(scope="module")
def clone(tmp_path_factory):
    """A folder with the two programs that the commands begin with."""
    compile_estimator(DEFAULT)  # so that no command has to wait for it
    folder = tmp_path_factory.mktemp("clone")
    (folder / ".venv" / "bin").mkdir(parents=True)
    for name, program in (("python", ""), ("ankle", " -m ankle_bringup.command_line")):
        file = folder / ".venv" / "bin" / name
        file.write_text(f'#!/bin/sh\nexec {sys.executable}{program} "$@"\n')
        file.chmod(0o755)
    return folder


def run(line, folder, timeout=PATIENCE):
    done = subprocess.run(
        line, shell=True, cwd=folder, capture_output=True, text=True, timeout=timeout, check=False
    )
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@contextmanager
def running(line, folder):
    """Run a command beside what follows; it has to end well after Ctrl-C."""
    with open(folder / "output.txt", "w+") as output:
        process = subprocess.Popen(
            f"exec {line}", shell=True, cwd=folder, stdout=output, stderr=subprocess.STDOUT
        )
        try:
            yield process
            process.send_signal(signal.SIGINT)
            code = process.wait(PATIENCE)
            output.seek(0)
            shown = output.read()
            assert code in (0, INTERRUPTED), f"{line}\n{shown}"
            assert "Traceback" not in shown
        finally:
            if process.poll() is None:
                process.kill()


def run_when_ready(line, folder):
    """Repeat a command until the graph that it speaks to has started."""
    began = time.monotonic()
    while True:
        try:
            return run(line, folder)
        except AssertionError:
            if time.monotonic() - began > PATIENCE:
                raise
            time.sleep(2.0)


def test_one_node_runs_and_shows_its_parameters(clone):
    with running(NODE, clone):
        shown = run_when_ready(PARAMETERS, clone)
    assert "K" in shown
    assert "80" in shown


def test_a_session_is_recorded_changed_calibrated_and_replayed(clone):
    with running(UP, clone):
        run_when_ready(PARAMETERS, clone)
        assert "0.05" in run_when_ready(AMPLITUDE, clone)
        echoed = run_when_ready(f"{ECHO} -n 1", clone)
        assert "K[N.m/rad]" in echoed
        with running(ECHO, clone):
            time.sleep(5.0)
        with running(RECORD, clone):
            time.sleep(RECORDED)
        assert (clone / "session" / "metadata.yaml").exists()
        run(CALIBRATE, clone, 900.0)
        assert (clone / "subject.yaml").exists()
    assert run(REPLAY, clone, 900.0)


def test_a_rig_is_armed(clone):
    with running(RIG, clone):
        run_when_ready(ARM, clone)
        assert "armed" in run(".venv/bin/ankle rig state", clone)


@pytest.fixture(scope="module")
def recorded(clone):
    """The bags and the study of which the commands speak."""
    simulate = ROOT / "examples" / "simulate_a_model.py"
    run(f".venv/bin/python {simulate} simulated --seconds 60 --stiffness 90", clone)
    shutil.rmtree(clone / "session", ignore_errors=True)
    run(f".venv/bin/python {simulate} session --seconds 60 --stiffness 120", clone)
    run(".venv/bin/ankle study init my_study", clone)
    run(".venv/bin/ankle study add my_study session --subject S07 --visit 3", clone)
    return clone


@pytest.mark.parametrize("line", ANALYSIS)
def test_what_takes_minutes_does_what_it_says(line, recorded):
    before = {path for path in recorded.rglob("*") if ".venv" not in path.parts}
    assert run(line, recorded, 1500.0).strip()
    assert {path for path in recorded.rglob("*") if ".venv" not in path.parts} - before
