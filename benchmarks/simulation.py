"""The simulation against a general solver of differential equations at the same accuracy, and
against real time.

    .venv/bin/python benchmarks/simulation.py

Processor time on one core, after compilation: the joint and its actuator under the paper's
pulse-step. Truth is `scipy.integrate.solve_ivp` at a relative tolerance of 1e-10. The peer is each
of its methods at the loosest tolerance that is at least as accurate as we are; it gets the exact
reference and is told where the edges begin. What is compared is the time for a simulated
second: of joint and actuator alone, which is what the peer does, and of a whole recording with
anti-alias filter, sampling and noise.
"""

from __future__ import annotations

import os
import time
from bisect import bisect_right
from collections.abc import Callable
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from ankle_physics.actuator import Actuator, Servo
from ankle_physics.model import Model
from ankle_physics.signals import Signals
from ankle_physics.virtual_rig import STRETCH, simulate
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE, PASSES = 2048.0, 5
COMPARED_DURATION, LONG_DURATION = 4.0, 240.0  # s
K, B, I, G, DELAY, OMEGA, Z = 100.0, 0.63, 0.0137, 10.0, 0.040, 21.0, 0.8
EDGE = 0.024  # s


def median_time(work: Callable[[], object], passes: int = PASSES) -> float:
    """Median processor time [s]: other work on the machine does not count."""
    spent = []
    for _ in range(passes):
        began = time.process_time()
        work()
        spent.append(time.process_time() - began)
    return float(np.median(spent))


def exact_reference(signal: PulseStep) -> tuple[Callable[[float], float], list[float]]:
    """Return the reference position as a function of time, and the times of its corners."""
    onsets = signal.onsets()
    starts = [onset.time for onset in onsets]
    levels = np.concatenate(
        [[0.0], np.cumsum([onset.direction * onset.amplitude for onset in onsets])]
    )

    def position(t: float) -> float:
        index = bisect_right(starts, t)
        if index == 0:
            return 0.0
        u = min((t - starts[index - 1]) / EDGE, 1.0)
        return float(
            levels[index - 1]
            + (levels[index] - levels[index - 1]) * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        )

    # One edge may begin where another ends.
    return position, sorted(
        {round(corner, 9) for start in starts for corner in (start, start + EDGE)}
    )


def solved(
    position: Callable[[float], float],
    corners: list[float],
    times: np.ndarray,
    method: str,
    tolerance: float,
) -> np.ndarray:
    """Torque at `times` [N.m] by `solve_ivp`: the plate, then the muscle behind its delayed
    velocity; from corner to corner.
    """
    w, d = 2.0 * np.pi * Servo().bandwidth, Servo().damping

    def plate(t: float, y: np.ndarray) -> list[float]:
        return [y[1], w * w * (position(t) - y[0]) - 2.0 * d * w * y[1]]

    bounds = [0.0, *(c for c in corners if 0.0 < c < times[-1]), times[-1]]
    pieces, state = [], [0.0, 0.0]
    for start, stop in pairwise(bounds):
        piece = solve_ivp(
            plate,
            (start, stop),
            state,
            method=method,
            rtol=tolerance,
            atol=1e-3 * tolerance,
            dense_output=True,
        )
        pieces.append(piece.sol)
        state = piece.y[:, -1]

    def motion(t: float) -> np.ndarray:
        return (
            pieces[min(max(bisect_right(bounds, t) - 1, 0), len(pieces) - 1)](t)
            if t > 0.0
            else np.zeros(2)
        )

    def muscle(t: float, y: np.ndarray) -> list[float]:
        return [
            y[1],
            OMEGA * OMEGA * (max(motion(t - DELAY)[1], 0.0) - y[0]) - 2.0 * Z * OMEGA * y[1],
        ]

    delayed = [0.0, *(b + DELAY for b in bounds[:-1] if b + DELAY < times[-1]), times[-1]]
    response, state = [], [0.0, 0.0]
    for start, stop in pairwise(delayed):
        inside = times[(times >= start) & (times < stop)]
        piece = solve_ivp(
            muscle,
            (start, stop),
            state,
            method=method,
            rtol=tolerance,
            atol=1e-3 * tolerance,
            t_eval=[*inside, stop],
        )
        response.append(piece.y[0, :-1])
        state = piece.y[:, -1]
    response.append(np.array([state[0]]))
    moved = np.array([motion(t) for t in times])
    acceleration = np.array(
        [
            w * w * (position(t) - x) - 2.0 * d * w * v
            for t, (x, v) in zip(times, moved, strict=True)
        ]
    )
    return I * acceleration + B * moved[:, 1] + K * moved[:, 0] + G * np.concatenate(response)


def main() -> None:
    """Print the table."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    signal = PulseStep(Settings(rate=RATE, seed=3))
    reference = signal.next(round(COMPARED_DURATION * RATE))
    position, corners = exact_reference(signal)
    times = np.arange(len(reference)) / RATE
    model = Model.of()
    ours = simulate(reference, RATE, model, seed=1)
    torque = np.sum(list(ours.parts.values()), axis=0)
    truth = solved(position, corners, times, "DOP853", 1e-10)

    def error(values: np.ndarray) -> float:
        return float(np.std(values - truth) / np.std(truth))

    long_reference = PulseStep(Settings(rate=RATE, seed=4)).next(round(LONG_DURATION * RATE))

    def joint_alone() -> None:
        actuator = Actuator(Servo(), RATE)
        run = model.start(RATE * actuator.factor)
        for start in range(0, len(long_reference), STRETCH):
            run.torque(
                Signals(
                    RATE * actuator.factor, *actuator.run(long_reference[start : start + STRETCH])
                )
            )

    speed = LONG_DURATION / median_time(lambda: simulate(long_reference, RATE, model, seed=1))
    alone = LONG_DURATION / median_time(joint_alone)
    print(
        f"ours, whole recording: {speed:.0f} x real time; joint and actuator alone: {alone:.0f} x "
        "real time",
        flush=True,
    )
    print(f"error {error(torque):.1e} of the torque's standard deviation", flush=True)
    for method in ("RK45", "DOP853", "LSODA"):
        for tolerance in 10.0 ** np.arange(-2.0, -8.0, -0.5):
            found = error(solved(position, corners, times, method, tolerance))
            if found <= error(torque):
                spent = median_time(partial(solved, position, corners, times, method, tolerance))
                print(
                    f"peer: solve_ivp {method}, relative tolerance {tolerance:.1e}: "
                    f"{COMPARED_DURATION / spent:.1f} x real time, error {found:.1e}; "
                    f"ratio {alone * spent / COMPARED_DURATION:.0f}, of the whole recording "
                    f"{speed * spent / COMPARED_DURATION:.0f}",
                    flush=True,
                )
                break


if __name__ == "__main__":
    main()
