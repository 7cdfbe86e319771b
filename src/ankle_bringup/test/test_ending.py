"""`ankle up` that is ended, however that happens, brings the plate to rest first."""

import os
import signal
import subprocess
import sys
import time

import pytest
from std_srvs.srv import Trigger

from ankle_bringup.live_graph import observer
from ankle_bringup.up import ENDING_SIGNALS, ending_by_signal, ignore_ending_signals, stop_rig


@pytest.mark.parametrize("number", ENDING_SIGNALS)
def test_each_ending_signal_ends_once_and_does_not_disturb_the_ending(number):
    ended = False
    before = signal.getsignal(number)
    with ending_by_signal():
        try:
            os.kill(os.getpid(), number)
            time.sleep(5.0)
        except KeyboardInterrupt:
            for again in ENDING_SIGNALS:
                os.kill(os.getpid(), again)
            ended = True
    assert ended
    assert signal.getsignal(number) is before


@pytest.mark.parametrize("number", ENDING_SIGNALS)
def test_an_end_that_has_begun_by_itself_is_not_disturbed(number):
    before = signal.getsignal(number)
    with ending_by_signal():
        ignore_ending_signals()
        os.kill(os.getpid(), number)
    assert signal.getsignal(number) is before


DRIVER_OF_A_RIG = """
import rclpy, sys
from std_srvs.srv import Trigger
rclpy.init()
node = rclpy.create_node("rig_under_test")
def stop(request, answer):
    print("stopped", flush=True)
    answer.success = True
    return answer
node.create_service(Trigger, "/rig_under_test/stop", stop)
print("ready", flush=True)
rclpy.spin(node)
"""


@pytest.mark.live
def test_the_rig_is_stopped_before_anything_else_is_ended():
    driver = subprocess.Popen(
        [sys.executable, "-c", DRIVER_OF_A_RIG], stdout=subprocess.PIPE, text=True
    )
    try:
        assert driver.stdout.readline() == "ready\n"
        with observer(own_signals=True) as node:
            client = node.create_client(Trigger, "/rig_under_test/stop")
            assert client.wait_for_service(30.0)
            stop_rig(node, [client])
        assert driver.stdout.readline() == "stopped\n"
    finally:
        driver.kill()
        driver.wait(10.0)
