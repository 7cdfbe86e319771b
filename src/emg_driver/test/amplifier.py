"""A program that streams like EMG amplifiers do, with the faults that they have. One stream for
each fault named on the command line.

    python amplifier.py PREFIX SECONDS FAULT...

Every stream carries noise of 20 uV on four channels, and on the first a pulse of 0.5 mV at each
whole second of the system clock. It says ``streaming`` when the streams can be found and, after the
last sample, when the faults began [s of the system clock]; it ends with its standard input.
"""

import sys
import time

import numpy as np
import pylsl

RATE, CHUNK = 2048, 32
FAULT_AT = 5.0  # s after the start
DRIFT = 500e-6  # ten times that of a crystal, so that seconds show what takes minutes
LABELS = ("SOL", "TA", "GL", "GM")


class Stream:
    def __init__(self, prefix, fault):
        self.fault = fault
        count = 2 if fault == "few_channels" else 4
        info = pylsl.StreamInfo(
            f"{prefix} {fault}", "EMG", count, RATE, "float32", f"{prefix}-{fault}"
        )
        channels = info.desc().append_child("channels")
        for label in LABELS[:count]:
            channel = channels.append_child("channel")
            channel.append_child_value("label", label)
            if fault != "no_unit":
                channel.append_child_value(
                    "unit", "V" if fault == "millivolts_as_volts" else "microvolts"
                )
        self.outlet = pylsl.StreamOutlet(info, CHUNK)
        self.random = np.random.default_rng(3)
        self.held = None

    def chunk(self, since, stamps, wall):
        """Samples in uV, or None for a chunk that is lost."""
        samples = 20.0 * self.random.standard_normal((len(stamps), 4))
        samples[np.floor(wall) != np.floor(wall - 1 / RATE), 0] += 500.0
        after = since >= FAULT_AT
        if self.fault == "millivolts_as_volts":
            samples *= 1e-3
        elif after and self.fault == "flat":
            samples[:, 1] = 3.0
        elif after and self.fault == "saturated":
            samples[:, 1] = np.clip(100.0 * samples[:, 1], -1500.0, 1500.0)
        elif after and self.fault == "hum":
            samples[:, 1] += 60.0 * np.sin(2 * np.pi * 50.0 * stamps)
        elif after and self.fault == "nan":
            samples[5, 1] = np.nan
        elif after and self.fault in ("lost_chunk", "silent"):
            return (
                None if self.fault == "silent" or since < FAULT_AT + 3 * CHUNK / RATE else samples
            )
        return samples[:, :2] if self.fault == "few_channels" else samples

    def send(self, since, stamps, wall):
        samples = self.chunk(since, stamps, wall)
        if samples is None or (self.fault == "half_rate" and round(since * RATE / CHUNK) % 2):
            return
        stamp = stamps[-1]
        if self.fault == "drift":
            stamp -= DRIFT * since
        if self.fault == "clock_jump" and since >= FAULT_AT:
            stamp += 7.0
        if self.fault == "own_clock":
            stamp = since
        self.outlet.push_chunk(np.ascontiguousarray(samples, dtype=np.float32), stamp)


def look():
    """How long a look at both clocks took, and their difference."""
    before, wall, after = pylsl.local_clock(), time.time(), pylsl.local_clock()
    return after - before, wall - 0.5 * (before + after)


def main():
    prefix, seconds, faults = sys.argv[1], float(sys.argv[2]), sys.argv[3:]
    streams = [Stream(prefix, fault) for fault in faults]
    print("streaming", flush=True)
    while not any(stream.outlet.have_consumers() for stream in streams):
        time.sleep(0.01)
    # Of two hundred looks at both clocks the one that nothing interrupted.
    wall_minus_lsl = min(look() for _ in range(200))[1]
    start = pylsl.local_clock()
    for number in range(int(seconds * RATE / CHUNK)):
        stamps = start + (number * CHUNK + np.arange(1, CHUNK + 1)) / RATE
        time.sleep(max(stamps[-1] - pylsl.local_clock(), 0.0))
        for stream in streams:
            stream.send(stamps[-1] - start, stamps, stamps + wall_minus_lsl)
    print(start + wall_minus_lsl + FAULT_AT, flush=True)
    sys.stdin.read()  # streams stay open until whoever started this ends it


main()
