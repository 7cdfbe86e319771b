"""A node that is started with a bad value says so in one line and ends with code 1.

Each case is a process of its own. They are forked from one that has loaded the nodes already:
loading them takes longer than all that is tested here.
"""

import multiprocessing
import os

import pytest
from forked_node import run_node

from ankle_bringup.executables import NODE_MODULE, executables, packages_with_nodes

pytestmark = [pytest.mark.live, pytest.mark.untimed]

PATIENCE = 60.0
DRIVER = "ankle_actuator_driver.ankle_actuator_driver_node"
EMULATOR = "rig_emulator.rig_emulator_node"
FEEDBACK = "biofeedback.biofeedback_node"
GENERATOR = "perturbation_generator.perturbation_generator_node"
REPLAY = "session_recorder.replay_node"
SIMULATION = "ankle_sim.ankle_sim_node"
BRIDGE, PROCESSOR = "emg_driver.emg_bridge_node", "emg_driver.emg_processor_node"
CASES = [
    (
        DRIVER,
        ["velocity_limit:=6.0"],
        "'velocity_limit' = 6 rad/s passes the hard limit of 5 rad/s",
    ),
    (
        DRIVER,
        ["hard_angle_limit:=3.0"],
        "parameter 'hard_angle_limit' = 3.0 rad is refused; allowed: 0.001 to 0.35 rad",
    ),
    (DRIVER, ["use_sim_time:=true"], "a rig moves in real time"),
    (EMULATOR, ["prot:=3"], "parameter 'prot' is unknown; did you mean 'port'?"),
    (
        EMULATOR,
        ["clock_drift:=0.1"],
        "parameter 'clock_drift' = 0.1 is refused; allowed: -0.0005 to 0.0005",
    ),
    (SIMULATION, ["KK:=3.0"], "parameter 'KK' is unknown; did you mean 'K'?"),
    (EMULATOR, ["faults:=explode"], "fault switch 'explode' is unknown"),
    (FEEDBACK, ["port:=0", "host:=0.0.0.0"], "token of at least 16 characters"),
    (
        FEEDBACK,
        ["port:=0", "protocol:=nothing"],
        "no protocol 'nothing': known are demonstration, rig_calibration, ",
    ),
    (
        FEEDBACK,
        ["port:=0", "frame_rate:=500.0"],
        "'frame_rate' = 500.0 Hz is refused; allowed: 10 to 60 Hz",
    ),
    # An address that this computer does not have.
    (FEEDBACK, ["port:=0", "host:=203.0.113.7", "token:=0123456789abcdef"], "error: "),
    (
        GENERATOR,
        ["amplitude:=0.3"],
        "amplitude of 0.3 rad passes the limit of 0.14 rad ('amplitude_limit')",
    ),
    (
        GENERATOR,
        ["shape:=block"],
        "velocity of 81.92 rad/s passes the limit of 5 rad/s ('velocity_limit')",
    ),
    (GENERATOR, ["rate:=20000.0"], "'rate' = 20000.0 Hz is refused; allowed: 500 to 10000 Hz"),
    (REPLAY, ["bag:=nowhere"], "no bag at nowhere"),
    (REPLAY, [], "parameter 'bag' is missing"),
    (SIMULATION, ["model:=/nowhere/model.yaml"], "/nowhere/model.yaml"),
    (SIMULATION, ["scenario:=/nowhere/script.yaml"], "/nowhere/script.yaml"),
    (
        SIMULATION,
        ["K:=-4.0"],
        "parameter 'K' = -4.0 N.m/rad is refused; allowed: 0 to 1000 N.m/rad",
    ),
    (
        BRIDGE,
        ["channels:=SOL=0,TA=1"],
        "'channels' is refused: channels 'SOL=0,TA=1' does not say where GL, GM is",
    ),
    (BRIDGE, ["rate:=-1.0"], "'rate' = -1.0 Hz is refused; allowed: 0 to 20000 Hz"),
    (
        PROCESSOR,
        ["reflex_end:=0.03"],
        "'reflex_end' = 0.03 s is refused; allowed: after 'reflex_start' = 0.04 s",
    ),
]
NODES = {entry.module for name in packages_with_nodes() for entry in executables(name).values()}
CASES += [
    (module, ["nobody:=3.0"], "parameter 'nobody' is unknown; ")
    for module in sorted(NODES)
    if module.endswith(NODE_MODULE)
]


@pytest.fixture(scope="module")
def forked():
    """Starts processes from one in which the nodes are loaded."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(sorted({module for module, _, _ in CASES}))
    return context


@pytest.mark.parametrize(
    ("module", "parameters", "words"),
    [pytest.param(*case, id=" ".join([case[0].split(".")[0], *case[1][-1:]])) for case in CASES],
)
def test_a_bad_start_value_ends_with_one_line(forked, tmp_path, module, parameters, words):
    output = tmp_path / "output.txt"
    if module == FEEDBACK:
        parameters = [*parameters, f"state_file:={tmp_path / 'state.json'}"]
    process = forked.Process(target=run_node, args=(module, parameters, {**os.environ}, output))
    process.start()
    process.join(PATIENCE)
    ended = process.exitcode
    process.kill()
    process.join()
    said = output.read_text()
    assert ended == 1, said
    assert words in said
    assert "Traceback" not in said
