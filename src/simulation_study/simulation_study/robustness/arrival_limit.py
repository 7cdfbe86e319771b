"""How often an estimate of the reflex gain can arrive first after a jump, at the very best.

Example: ``python -m simulation_study.robustness.arrival_limit --seed 1 --runs 2000``. Every stretch
tells its own reflex gain exactly, without any noise, and the gains vary from stretch to stretch as
in the recordings with a jump (`JUMP_VARIATION`). Three averages of them are compared, the first and
third of which know more than an estimator can:

- told: the mean of all stretches since the jump, whose moment it knows;
- window: the mean of the last seconds, as long as the memory of the default estimator;
- told window: the mean of the last seconds, which begins anew with the jump.

The reference is the running average of algorithm CE (Butterworth, second order, van 't Veld et al.
2018, section II-A) of the same gains. An estimator has to find the moment of the jump, and there is
noise in its torque, so that it is not expected to arrive first more often than the best of them.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy.signal import butter, lfilter

from blind_rig.protocols import Protocol, levels
from impedance_estimator.settings import Settings
from impedance_estimator.simultaneous.settings import SimultaneousSettings
from simulation_study.robustness.conditions import JUMP_VARIATION, JUMPS
from simulation_study.robustness.estimation import arrival
from simulation_study.verdict_report import rate_with_interval

SECONDS, JUMP_TIME = 60.0, 30.0
"""Length of a run and moment of its jump [s], as in the counted recordings."""
RATE = Settings.estimate_rate
AMPLITUDE, RISE = 0.04, 0.024
"""Size [rad] and edge [s] of pulses and steps are those of the counted recordings."""
AVERAGES = ("told", "window", "told window")


def stretch_gains(random: np.random.Generator, factor: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the reflex gain that each stretch tells, over that before the jump, and whether there
    is a stretch, both at every estimate; shape (n,).

    Parameters
    ----------
    random
        Of the perturbation and of the variation.
    factor
        The gain after the jump.
    """
    times, targets = levels(Protocol("pulse_step", AMPLITUDE, RISE, SECONDS), random)
    begun = times[(targets > 0.0) & (times < SECONDS)]
    gains = np.where(begun < JUMP_TIME, 1.0, factor)
    gains = gains * (1.0 + JUMP_VARIATION * random.standard_normal(len(begun)))
    told, counted = np.zeros(round(SECONDS * RATE)), np.zeros(round(SECONDS * RATE))
    at = (begun * RATE).astype(int)
    np.add.at(told, at, gains)
    np.add.at(counted, at, 1.0)
    return told, counted


def arrivals_of_run(random: np.random.Generator, factor: float) -> dict[str, float]:
    """Return when the reference and each of `AVERAGES` arrive [s]; infinite where they do not."""
    gains, counted = stretch_gains(random, factor)
    last = np.arange(len(gains)) + 1
    jump, memory = round(JUMP_TIME * RATE), round(SimultaneousSettings.memory * RATE)
    sums, counts = (np.concatenate(([0.0], np.cumsum(x))) for x in (gains, counted))

    def mean_since(first: np.ndarray) -> np.ndarray:
        seen = np.maximum(counts[last] - counts[first], 1e-9)
        return (sums[last] - sums[first]) / seen

    since_jump = np.where(last > jump, jump, 0)
    since_memory = np.maximum(last - memory, 0)
    low_pass = butter(2, Settings.reflex_average_cutoff, fs=RATE)
    reference = lfilter(*low_pass, gains) / np.maximum(lfilter(*low_pass, counted), 1e-9)
    values = {
        "reference": reference,
        "told": mean_since(since_jump),
        "window": mean_since(since_memory),
        "told window": mean_since(np.maximum(since_jump, since_memory)),
    }
    time = (last - 1) / RATE
    found = {name: arrival(time, v, 1.0, factor, JUMP_TIME) for name, v in values.items()}
    return {name: np.inf if at is None else at for name, at in found.items()}


def main(arguments: list[str] | None = None) -> None:
    """Print the shares as a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--runs", type=int, default=2000, help="of each jump")
    chosen = parser.parse_args(arguments)
    random = np.random.default_rng(chosen.seed)
    print("| jump | " + " | ".join(AVERAGES) + " |\n| --- |" + " --- |" * len(AVERAGES))
    for _, factor in JUMPS:
        if factor == 1.0:
            continue
        runs = [arrivals_of_run(random, factor) for _ in range(chosen.runs)]
        cells = [
            rate_with_interval(sum(run[name] < run["reference"] for run in runs), len(runs))
            for name in AVERAGES
        ]
        print(f"| G times {factor:g} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
