"""Whether a process gets the right to a core, and says so where it does not."""

import json
import os
import subprocess
import sys

import pytest

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


def test_a_process_without_the_right_runs_on_and_says_what_would_allow_it():
    refusal, classes, locked = outcome(WITHOUT_RIGHTS)
    assert "no real-time priority" in refusal
    assert "rtprio" in refusal
    assert set(classes) == {os.SCHED_OTHER}
    assert locked == 0
