"""Who keeps the rig fed: only a driver that lives, and without the help of its own process."""

import os
import signal
import socket
import time
from itertools import pairwise

import pytest

from ankle_actuator_driver.link.protocol.heartbeat_process import HeartbeatProcess
from ankle_actuator_driver.link.protocol.heartbeats import Heartbeats
from ankle_actuator_driver.link.protocol.packet import Heartbeat, newer, parse, unsealed
from ankle_actuator_driver.link.protocol.port_holder import holder_of
from ankle_actuator_driver.link.protocol.transport import UdpTransport
from ankle_actuator_driver.safety.rig import Wanted

KEY = b"0123456789abcdef"


def packet(sequence=64, wanted=Wanted.FOLLOW):
    return unsealed(Heartbeat(5, sequence, 0, wanted, 0, 3, 77))


def test_heartbeats_fill_the_time_between_orders_with_rising_numbers():
    heartbeats = Heartbeats(KEY)
    heartbeats.alive(10.0)
    sent = heartbeats.forward(packet(), 10.0, 111)
    for step in range(1, 100):
        sent += heartbeats.due(10.0 + 0.001 * step, step)
    read = [parse(data, KEY) for data in sent]
    assert len(read) == 1 + 4
    assert all(newer(b.sequence, a.sequence) for a, b in pairwise(read))
    assert {entry.wanted for entry in read} == {Wanted.FOLLOW}
    assert read[0].sent == 111


def test_a_driver_that_is_not_alive_is_not_spoken_for():
    heartbeats = Heartbeats(KEY)
    heartbeats.alive(10.0)
    heartbeats.forward(packet(), 10.0, 0)
    assert heartbeats.due(10.09, 0)
    assert not heartbeats.due(10.2, 0)
    assert not heartbeats.forward(packet(128), 10.2, 0)
    assert heartbeats.withheld == 1
    assert heartbeats.forward(packet(192, Wanted.OFF), 10.2, 0)
    assert not heartbeats.due(10.3, 0)


@pytest.fixture
def line():
    """A rig's socket, the driver's socket, and the process that sends."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as rig:
        rig.bind(("127.0.0.1", 0))
        rig.settimeout(5.0)
        own = UdpTransport(("127.0.0.1", 0), rig.getsockname())
        process = HeartbeatProcess(own.socket, rig.getsockname(), KEY)
        yield rig, process
        process.close()
        own.close()


def count_for(rig, seconds):
    rig.settimeout(0.02)
    end, count = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        try:
            rig.recv(2048)
            count += 1
        except TimeoutError:
            continue
    return count


@pytest.mark.live
def test_the_process_goes_on_while_the_driver_is_busy_and_stops_when_it_hangs(line):
    rig, process = line
    process.alive()
    process.send(packet())
    assert parse(rig.recv(2048), KEY).wanted is Wanted.FOLLOW
    for _ in range(10):
        process.alive()
        time.sleep(0.03)
    assert count_for(rig, 0.05) > 3  # of its own
    count_for(rig, 0.3)
    assert count_for(rig, 0.4) == 0  # nobody said for 100 ms that the driver lives


@pytest.mark.live
def test_the_process_ends_with_the_driver_and_is_noticed(line):
    _, process = line
    assert not process.ended()
    os.kill(process.pid, signal.SIGKILL)
    end = time.monotonic() + 5.0
    while not process.ended():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_whoever_holds_a_port_is_named():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as held:
        held.bind(("127.0.0.1", 0))
        port = held.getsockname()[1]
        assert f"port {port} is held by process {os.getpid()} (" in holder_of("udp", port)
        with pytest.raises(OSError, match=f"is held by process {os.getpid()}"):
            UdpTransport(("127.0.0.1", port), None)
    assert holder_of("udp", port) == ""
