"""Whether log lines that nobody takes hold a node up, and whether all of them come where somebody
does.
"""

import fcntl
import json
import os
import subprocess
import sys

import pytest

from ankle_node.unblocked_output import PIPE_SIZE

# A thread that holds the lock of Python until somebody reads does so as long as the test waits; a
# busy computer makes a pause of some seconds.
LINES, LONGEST_PAUSE = 400, 20.0  # s
SMALL_PIPE = 4096  # bytes
assert SMALL_PIPE < LINES * 80 < PIPE_SIZE
PROGRAM = f"""
import json, sys, threading, time
from ankle_node.node import AnkleNode, run

class Talkative(AnkleNode):
    def __init__(self):
        super().__init__("talkative", ())
        self.worst = 0.0
        threading.Thread(target=self.tick, daemon=True).start()
        self.create_timer(0.01, self.talk)

    def tick(self):
        last = time.monotonic()
        while True:
            time.sleep(0.004)
            now = time.monotonic()
            self.worst, last = max(self.worst, now - last), now

    def talk(self):
        for number in range({LINES}):
            self.get_logger().warning(f"line {{number}} " + "." * 80)
            if number % 50 == 0:
                time.sleep(0.001)
        print(json.dumps(self.worst), flush=True)
        self.context.try_shutdown()

sys.exit(run(Talkative))
"""


@pytest.mark.timeout(150)
def test_log_lines_that_nobody_reads_hold_no_thread_up():
    reader, writer = os.pipe()
    fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, SMALL_PIPE)
    with open(reader, "rb", buffering=0), open(writer, "wb", buffering=0) as unread:
        found = subprocess.run(
            [sys.executable, "-c", PROGRAM],
            stdout=subprocess.PIPE,
            stderr=unread,
            timeout=120,
            check=True,
        )
    assert json.loads(found.stdout) < LONGEST_PAUSE


@pytest.mark.timeout(150)
def test_every_log_line_comes_before_the_process_ends(tmp_path):
    with open(tmp_path / "log", "wb") as log:
        subprocess.run(
            [sys.executable, "-c", PROGRAM],
            stdout=subprocess.DEVNULL,
            stderr=log,
            timeout=120,
            check=True,
            env={**os.environ, "ROS_LOG_DIR": str(tmp_path / "files")},
        )
    lines = (tmp_path / "log").read_text().splitlines()
    assert [line.split()[-2] for line in lines if "line" in line] == [
        str(number) for number in range(LINES)
    ]
    assert not (tmp_path / "files").exists()  # a file of its own would wait for the disk
