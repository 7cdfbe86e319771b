"""The example nodes in a running graph: one reads estimates, the other publishes a signal."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from ankle_bringup.graph import load_graph
from ankle_bringup.processes import Processes

pytestmark = pytest.mark.live

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.timeout(240)
def test_the_nodes_read_and_publish_in_a_running_graph(tmp_path):
    settings = [
        "perturbation_generator.duration=60.0",
        "impedance_estimator.settling_time=2.0",
        "impedance_estimator.wait_for_readers=0",
    ]
    graph = load_graph("simulated").without("biofeedback")
    settings += ["ankle_sim.wait_for_readers=1"]
    publisher = subprocess.Popen([sys.executable, EXAMPLES / "publish_mean_torque_node.py"])
    try:
        with Processes(graph.with_settings(settings), tmp_path):
            listen = [sys.executable, EXAMPLES / "listen_to_k_node.py"]
            shown = subprocess.run(
                [*listen, "--ros-args", "-p", "count:=3"],
                capture_output=True,
                text=True,
                timeout=120,
                check=True,
            ).stdout
            assert shown.count("N.m/rad") == 3
            ankle = [sys.executable, "-m", "ankle_bringup.command_line"]
            echoed = subprocess.run(
                [*ankle, "echo", "/ankle/mean_torque", "-n", "1"],
                capture_output=True,
                text=True,
                timeout=60,
                check=True,
            ).stdout
            assert "mean_torque[N.m]" in echoed
    finally:
        publisher.send_signal(signal.SIGINT)
        try:
            publisher.wait(15.0)
        except subprocess.TimeoutExpired:
            publisher.kill()
