"""Each online estimator per block of samples, against the same algorithm in plain SciPy and
recursive least squares of padasip.

    .venv/bin/python benchmarks/estimators.py

One core, after compilation, the paper's CE condition. Processor times of `process`, the Python call
included. `padasip.filters.FilterRLS` gets the simultaneous estimator's regressors (position,
velocity, acceleration, twelve basis functions) ready-made, and only the decimated ones.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import padasip

from ankle_physics.virtual_rig import simulate
from impedance_estimator.algorithms import ALGORITHMS, make_estimator
from impedance_estimator.estimator import Estimator
from impedance_estimator.settings import Settings as CorrelationSettings
from impedance_estimator.simultaneous.regression import INTRINSIC
from impedance_estimator.simultaneous.settings import SimultaneousSettings
from impedance_estimator.stream import EstimateStream
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

sys.path.insert(0, str(Path(__file__).parent))
from calibrated_subject import ADDITIONAL_TERMS, LOAD_PATH, subject
from scipy_estimators import ScipyCE, ScipySimultaneous

RATE, BLOCK = 2048.0, 32
SECONDS, SETTLING_TIME = 60.0, 20.0
"""[s] simulated, and from when on times count: memories are full."""
FORGETTING = 0.9998
"""Per sample at 256 Hz: a memory of 20 s, as the simultaneous estimator's."""


def samples_of(rate: float) -> np.ndarray:
    """t, position, velocity and torque of the paper's CE condition, and the position of the
    reference, shape (n, 5).
    """
    reference = PulseStep(Settings(rate=rate)).next(round(SECONDS * rate))
    simulated = simulate(reference, rate, seed=1)
    return np.column_stack([simulated.time, simulated.measured, reference[:, 0]])


def times_of(estimator: Estimator, samples: np.ndarray, block: int, rate: float) -> np.ndarray:
    """Processor time of an estimator's blocks, with the columns that it takes."""
    return block_times(estimator.process, samples[:, : estimator.sample_columns], block, rate)


def block_times(
    process: Callable[[np.ndarray], object], samples: np.ndarray, block: int, rate: float
) -> np.ndarray:
    """Processor time of each block once memories are full [s]; other work on the machine does not
    count.
    """
    spent = []
    for start in range(0, len(samples) - block + 1, block):
        piece = np.ascontiguousarray(samples[start : start + block])
        began = time.thread_time()
        process(piece)
        spent.append(time.thread_time() - began)
    return np.array(spent[int(SETTLING_TIME * rate) // block :])


def row(what: str, times: np.ndarray, against: float | None = None) -> None:
    """Print median and 99th percentile [us], and the ratio to another median."""
    ratio = f"   {np.median(times) / against:7.1f} x" if against else ""
    print(
        f"{what:58s} median {np.median(times) * 1e6:8.1f} us   p99 "
        f"{np.percentile(times, 99) * 1e6:8.1f} us{ratio}",
        flush=True,
    )


def recursive_least_squares(samples: np.ndarray) -> np.ndarray:
    """Time of padasip's updates for each block of `BLOCK` samples [s]."""
    count = INTRINSIC + round(SimultaneousSettings().basis_functions)
    every = round(RATE / 256.0)
    regressors = np.random.default_rng(0).standard_normal((len(samples) // every, count))
    filter_ = padasip.filters.FilterRLS(count, mu=FORGETTING, w="zeros")
    torque = samples[::every, 3]
    spent = []
    # Every update costs the same: two seconds are enough.
    for start in range(0, 512, BLOCK // every):
        began = time.thread_time()
        for k in range(start, start + BLOCK // every):
            filter_.adapt(torque[k], regressors[k])
        spent.append(time.thread_time() - began)
    return np.array(spent[8:])


def main() -> None:
    """Print the tables."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    samples = samples_of(RATE)
    print(f"Blocks of {BLOCK} samples at {RATE:.0f} Hz, {1e6 * BLOCK / RATE:.0f} us of signal each")
    ours = {}
    for name in ALGORITHMS:
        estimator = make_estimator(name, RATE, True)
        times = times_of(estimator, samples, BLOCK, RATE)
        ours[name] = float(np.median(times))
        row(name, times)
    plain = ScipyCE(RATE)
    row(
        "peer: CE in plain SciPy, ratio to CE",
        block_times(plain.process, samples[:, :4], BLOCK, RATE),
        ours["CE"],
    )
    unbiased = make_estimator("CE", RATE, True, CorrelationSettings(highpass="all"))
    rows = unbiased.process(samples[:, :4])
    print(
        f"  same numbers: K {plain.parameters[0]:.3f} and {rows[-1, 1]:.3f}, G {plain.G:.4f} and "
        f"{rows[-1, 4]:.4f}"
    )
    row(
        "peer: part of simultaneous in plain SciPy, ratio to simultaneous",
        block_times(ScipySimultaneous(RATE).process, samples[:, :4], BLOCK, RATE),
        ours["simultaneous"],
    )
    row(
        "peer: padasip RLS, regressors given, ratio to simultaneous",
        recursive_least_squares(samples),
        ours["simultaneous"],
    )

    for name, stream in (
        ("stream of simultaneous", EstimateStream()),
        (f"with {len(ADDITIONAL_TERMS)} additional terms", EstimateStream(known=subject())),
        ("the same behind straps", EstimateStream(known=subject("fixation_compliance"))),
        (
            "the same with plate and lost motion, too",
            EstimateStream(known=subject(*LOAD_PATH)),
        ),
    ):
        times = block_times(
            lambda piece, stream=stream: stream.feed_samples(piece[:, :4], True, piece[:, 4]),  # type: ignore[misc]
            samples,
            BLOCK,
            RATE,
        )
        row(f"{name}, {100.0 * np.mean(times) * RATE / BLOCK:.2f} % of real time", times)

    print("Block size at 2048 Hz: median per block, and per sample")
    for block in (8, 32, 128, 512, 2048):
        for name in ("CE", "simultaneous"):
            times = times_of(make_estimator(name, RATE, True), samples, block, RATE)
            row(f"{name}, {block} samples, {np.median(times) / block * 1e6:.2f} us a sample", times)
    print(f"Sampling rate, blocks of {BLOCK} samples; share of real time")
    for rate in (500.0, 1000.0, 2048.0, 5000.0, 10_000.0):
        signal = samples_of(rate)
        for name in ("CE", "simultaneous"):
            times = times_of(make_estimator(name, rate, True), signal, BLOCK, rate)
            row(
                f"{name}, {rate:.0f} Hz, {100.0 * np.mean(times) * rate / BLOCK:.2f} % of real "
                "time",
                times,
            )
    print("Functions in the simultaneous estimator's reflex basis, blocks of 32 samples at 2048 Hz")
    for count in (6, 9, 12, 16, 20):
        estimator = make_estimator(
            "simultaneous", RATE, True, SimultaneousSettings(basis_functions=float(count))
        )
        times = times_of(estimator, samples, BLOCK, RATE)
        row(
            f"simultaneous, {count} functions, "
            f"{100.0 * np.mean(times) * RATE / BLOCK:.2f} % of real time",
            times,
        )


if __name__ == "__main__":
    main()
