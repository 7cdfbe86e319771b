"""A recorded session through the estimator: bag to estimates to bag, against merely reading the
bag.

    .venv/bin/python benchmarks/offline.py [--seconds 240]

Each figure is the processor time, median of several passes on one core after compilation: other
work on the machine does not count. Peers in the same run: the same blocks read and unpacked without
estimating, and the `mcap` library's own reader without unpacking.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mcap.reader import make_reader

from ankle_interfaces.block import Block, unpack
from ankle_physics.model import Model
from ankle_physics.virtual_rig import simulate
from impedance_estimator.algorithms import ALGORITHMS
from impedance_estimator.offline.recorded_estimates import estimate_bag, estimate_signal
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter

sys.path.insert(0, str(Path(__file__).parent))
from calibrated_subject import ADDITIONAL_TERMS, subject

RATE, BLOCK, PASSES = 2048.0, 32, 5
COLUMNS = ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")


def session(seconds: float, path: Path) -> np.ndarray:
    """Simulate, write a bag of /perturbation/reference and /ankle/samples, and return the samples
    (n, 4).
    """
    reference = PulseStep(Settings(rate=RATE)).next(round(seconds * RATE))
    recording = simulate(reference, RATE, Model.of(), seed=1)
    time_column = 1.8e9 + np.arange(len(reference))[:, None] / RATE
    data = np.hstack([time_column, recording.measured])
    with BagWriter(path) as writer:
        writer.add_topic("/perturbation/reference")
        writer.add_topic("/ankle/samples")
        for start in range(0, len(data), BLOCK):
            part = slice(start, start + BLOCK)
            stamp = round(time_column[part][-1, 0] * 1e9)
            names = (*COLUMNS[:3], "acceleration[rad/s^2]")
            writer.write_block(
                "/perturbation/reference",
                Block(names, np.hstack([time_column[part], reference[part]])),
                stamp,
            )
            writer.write_block(
                "/ankle/samples", Block(COLUMNS, np.ascontiguousarray(data[part])), stamp
            )
    return data


def median_time(work: Callable[[], object]) -> float:
    """Median processor time [s] of several passes."""
    spent = []
    for _ in range(PASSES):
        began = time.process_time()
        work()
        spent.append(time.process_time() - began)
    return float(np.median(spent))


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--seconds", type=float, default=240.0)
    seconds = options.parse_args().seconds
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        data = session(seconds, bag)
        t, position, velocity, torque = data.T

        def read_with_mcap() -> int:
            with open(next(bag.glob("*.mcap")), "rb") as stream:
                return sum(1 for _ in make_reader(stream).iter_messages(["/ankle/samples"]))

        def read_and_unpack() -> int:
            return sum(len(unpack(message).data) for _, _, message in BagReader(bag).messages())

        def read_samples() -> int:
            return sum(len(block.data) for block in BagReader(bag).blocks("/ankle/samples"))

        def whole(name: str) -> object:
            return estimate_bag(bag, Path(folder) / "out", name, overwrite=True)

        for name in ALGORITHMS:
            estimate_signal(t[:4096], position[:4096], velocity[:4096], torque[:4096], name)
        print(
            f"{seconds:.0f} s at {RATE:.0f} Hz, {len(data) // BLOCK} blocks a topic, one core, "
            f"median of {PASSES} passes"
        )
        for name in ALGORITHMS:
            spent = median_time(
                lambda name=name: estimate_signal(t, position, velocity, torque, name)
            )
            print(
                f"{'estimate ' + name + ' from arrays':44s} {spent:7.3f} s = "
                f"{seconds / spent:6.0f} x real time"
            )
        for what, known in (
            ("simultaneous with a reference", None),
            (f"simultaneous with {len(ADDITIONAL_TERMS)} additional terms", subject()),
        ):
            spent = median_time(
                lambda known=known: estimate_signal(
                    t, position, velocity, torque, reference=position, known=known
                )
            )
            print(f"{what:44s} {spent:7.3f} s = {seconds / spent:6.0f} x real time")
        reading, samples, peer = (
            median_time(work) for work in (read_and_unpack, read_samples, read_with_mcap)
        )
        print(f"{'read and unpack every block':44s} {reading:7.3f} s")
        print(f"{'read and unpack /ankle/samples alone':44s} {samples:7.3f} s")
        print(f"{'peer: mcap library reads /ankle/samples':44s} {peer:7.3f} s")
        for name in ("CE", "simultaneous"):
            spent = median_time(lambda name=name: whole(name))
            print(
                f"{f'read, estimate ({name}) and write':44s} {spent:7.3f} s = "
                f"{seconds / spent:6.0f} x real time"
            )
            print(f"{'ratio to reading every block':44s} {spent / reading:7.2f}")
            print(f"{'ratio to reading /ankle/samples alone':44s} {spent / samples:7.2f}")


if __name__ == "__main__":
    main()
