"""Amplifiers in processes of their own, and listeners to their streams."""

import importlib.util
import os
import select
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pylsl
import pytest

from emg_driver.bridge import EmgBridge
from emg_driver.clock_mapping import ClockDifference
from emg_driver.errors import StreamRefused
from emg_driver.lsl_source import Chunk, Connected, Lost, LslSource, predicate
from emg_driver.settings import ElectrodeSettings

STREAMS = (
    "good", "drift", "flat", "saturated", "hum",
    "nan", "lost_chunk", "clock_jump", "own_clock", "silent",
    "millivolts_as_volts", "half_rate", "few_channels", "no_unit",
)  # fmt: skip
CHANNELS = "SOL=SOL,TA=TA,GL=GL,GM=GM"


@pytest.fixture(scope="session")
def lab():
    """The module `laboratory`."""
    spec = importlib.util.spec_from_file_location(
        "emg_driver_laboratory", Path(__file__).parent / "laboratory.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Listener:
    """What the bridge makes of one stream: blocks, and what was said when [s of the monotonic
    clock].
    """

    def __init__(self, name):
        self.source = LslSource(predicate(name, "EMG", ""), lambda: None)
        self.blocks, self.said, self.bridge, self.connections = [], [], None, 0
        self.last = float("-inf")
        self.clocks = ClockDifference(time.time, pylsl.local_clock)

    def listen(self):
        while not self.source.events.empty():
            event = self.source.events.get()
            try:
                if isinstance(event, Connected):
                    self.connections += 1
                    self.bridge = EmgBridge(
                        event.stream, CHANNELS, "", 0.0, ElectrodeSettings(), self.clocks, self.last
                    )
                elif isinstance(event, Lost):
                    self.said.append((time.monotonic(), f"lost: {event.reason}"))
                elif isinstance(event, Chunk) and self.bridge:
                    bridged = self.bridge.feed(event)
                    self.blocks += bridged.blocks
                    self.last = self.bridge.last
                    self.said += [(time.monotonic(), note) for note in bridged.notes]
            except StreamRefused as error:
                self.said.append((time.monotonic(), f"refused: {error}"))
                self.bridge = None
                self.source.drop()

    @property
    def data(self):
        return np.concatenate(self.blocks) if self.blocks else np.empty((0, 5))

    def first(self, words):
        """When something was said first."""
        return next((when for when, sentence in self.said if words in sentence), None)


class Amplifiers:
    """Amplifier processes, each with a hard end."""

    def __init__(self):
        self.started = []

    def start(self, prefix, seconds, *faults):
        command = [
            sys.executable,
            str(Path(__file__).parent / "amplifier.py"),
            prefix,
            str(seconds),
            *faults,
        ]
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self.started.append(process)
        assert process.stdout.readline() == "streaming\n"
        return process

    def stop(self):
        for process in self.started:
            process.kill()
            process.wait(timeout=10)


@pytest.fixture
def amplifiers():
    every = Amplifiers()
    yield every
    every.stop()


@pytest.fixture
def listen_to():
    """Makes a listener to a stream by its name."""
    listeners = []

    def make(name):
        listeners.append(Listener(name))
        return listeners[-1]

    yield make
    for listener in listeners:
        listener.source.stop()


@pytest.fixture(scope="session")
def heard():
    """What the bridge made of every faulty stream and two good ones, all at once, for fourteen
    seconds.
    """
    prefix, every = f"test-{os.getpid()}", Amplifiers()
    listeners = {}
    try:
        process = every.start(prefix, 14.0, *STREAMS)
        listeners = {name: Listener(f"{prefix} {name}") for name in STREAMS}
        deadline = time.monotonic() + 60
        finished = []
        while not finished and time.monotonic() < deadline:
            finished = select.select([process.stdout], [], [], 0.005)[0]
            for listener in listeners.values():
                listener.listen()
        assert finished, "the amplifier did not come to its end"
        fault_at = float(process.stdout.readline())
        time.sleep(0.5)
        for listener in listeners.values():
            listener.listen()
            listener.fault_at = fault_at
    finally:
        for listener in listeners.values():
            listener.source.stop()
        every.stop()
    return listeners
