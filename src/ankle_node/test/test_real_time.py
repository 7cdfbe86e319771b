"""Whether a process gets the right to a core, and says so where it does not."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ankle_node.real_time import time_taken_by_host

BESIDE_A_RIG = """
import json, os, sys
import rclpy
from std_msgs.msg import String
from ankle_node.node import AnkleNode, run
from ankle_node.qos import LATEST_QOS

class Probe(AnkleNode):
    def __init__(self):
        super().__init__("probe", ())
        self.priorities, self.sources = [], []
        self.take_priority_beside_a_rig(7)
        self.create_timer(1.5, self.look)

    def look(self):
        self.priorities.append(os.sched_getscheduler(0))
        if len(self.sources) == 2:
            if self.priorities[-1] == os.SCHED_OTHER and len(self.priorities) < 20:
                return  # a busy computer shows a publisher later
            print(json.dumps(self.priorities), flush=True)
            self.context.try_shutdown()
            return
        # First a simulation that answers like a driver, then a driver.
        name = "a_driver" if self.sources else "ankle_sim"
        node = rclpy.create_node(name, context=self.context, namespace=self.get_namespace(),
                                 use_global_arguments=False)
        self.sources.append((node, node.create_publisher(String, "rig/state", LATEST_QOS)))

sys.exit(run(Probe, ["probe", "--ros-args", "-r", f"__ns:=/probe_{os.getpid()}"]))
"""
PROGRAM = """
import json, os, resource, threading
from ankle_node.real_time import take_priority
{before}
ended, ready = threading.Event(), threading.Event()
def other():
    ready.set()
    ended.wait()
threads = [threading.Thread(target=other)]
threads[0].start()
ready.wait()
refusal = take_priority(7)
threads.append(threading.Thread(target=other))
threads[1].start()
classes = [os.sched_getscheduler(int(thread)) for thread in os.listdir("/proc/self/task")]
locked = [line for line in open("/proc/self/status") if line.startswith("VmLck")][0]
ended.set()
print(json.dumps([refusal, classes, int(locked.split()[1])]))
"""
STARTS_ANOTHER = """
import os, subprocess, sys
from ankle_node.real_time import leave_priority, take_priority
take_priority(7)
print_class = [sys.executable, "-c", "import os; print(os.sched_getscheduler(0))"]
for begin in (None, leave_priority):
    sys.stdout.write(subprocess.check_output(print_class, text=True, preexec_fn=begin))
"""
WITHOUT_RIGHTS = """
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
if os.geteuid() == 0:
    os.setgid(65534)
    os.setuid(65534)
"""


def outcome(before):
    found = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(before=before)],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    return json.loads(found.stdout)


def may_take_priority():
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    except OSError:
        return False
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return True


def test_every_thread_of_the_process_gets_the_priority_and_its_memory_stays():
    if not may_take_priority():
        pytest.skip("this user may not take real-time priority")
    refusal, classes, locked = outcome("")
    assert refusal == ""
    assert len(classes) >= 3
    assert set(classes) == {os.SCHED_RR}
    assert locked > 0


def test_a_program_that_a_node_starts_leaves_the_priority():
    if not may_take_priority():
        pytest.skip("this user may not take real-time priority")
    found = subprocess.check_output(
        [sys.executable, "-c", STARTS_ANOTHER], text=True, timeout=60
    ).split()
    assert [int(word) for word in found] == [os.SCHED_RR, os.SCHED_OTHER]


def test_a_process_without_the_right_runs_on_and_says_what_would_allow_it():
    refusal, classes, locked = outcome(WITHOUT_RIGHTS)
    assert "no real-time priority" in refusal
    assert "rtprio" in refusal
    assert set(classes) == {os.SCHED_OTHER}
    assert locked == 0


@pytest.mark.live
def test_a_node_takes_priority_once_a_rigs_driver_is_in_the_graph():
    if not may_take_priority():
        pytest.skip("this user may not take real-time priority")
    found = subprocess.run(
        [sys.executable, "-c", BESIDE_A_RIG], capture_output=True, text=True, timeout=60
    )
    assert found.returncode == 0, found.stderr
    *before, last = json.loads(found.stdout)
    assert len(before) >= 2
    assert set(before) == {os.SCHED_OTHER}
    assert last == os.SCHED_RR


def test_what_the_host_of_a_virtual_machine_took_is_read(monkeypatch):
    monkeypatch.setattr(Path, "read_text", lambda path: "cpu  9 8 7 6 5 4 3 250 0 0\ncpu0 1 2\n")
    assert time_taken_by_host() == pytest.approx(250 / os.sysconf("SC_CLK_TCK"))
    monkeypatch.setattr(Path, "read_text", lambda path: "nothing known")
    assert time_taken_by_host() == 0.0
