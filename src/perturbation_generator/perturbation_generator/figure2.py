"""Figure 2 of van 't Veld et al. 2018: four shapes of the pulse-step signal and their
cross-correlations.

python -m perturbation_generator.figure2 OUT.png
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.signal import cont2discrete, lfilter

from perturbation_generator.correlation import REFLEX_LAGS, cross_correlation, residual
from perturbation_generator.edges import Block, Filtered, Polynomial, Shape
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

SHAPES: dict[str, Shape] = {
    "block": Block(),
    "block filtered at 60 Hz": Filtered(60.0),
    "block filtered at 30 Hz": Filtered(30.0),
    "5th-order polynomial, 24 ms": Polynomial(),
}
RATE = 2048.0  # Hz, paper
DURATION = 240.0  # s, length of the paper's simulations
SHOWN_DURATION = 1.6  # s of the signals in the upper panel: at least three blocks


def signal_of(shape: Shape, duration: float = DURATION, seed: int = 4) -> np.ndarray:
    """Return a balanced pulse-step signal without stretch: position, velocity, acceleration, shape
    (n, 3), at `RATE`.
    """
    signal = PulseStep(Settings(rate=RATE, shape=shape, seed=seed), balanced=True, stretch=0.0)
    return signal.next(round(duration * RATE))


def behind_actuator(
    signals: np.ndarray, rate: float = RATE, bandwidth: float = 30.0, damping: float = 0.7
) -> np.ndarray:
    """Return signals of shape (n, m) behind a second-order actuator: natural frequency [Hz],
    damping [1].

    Between samples the input is taken as straight lines (first-order hold), which gives no delay of
    half a sample.
    """
    omega = 2 * math.pi * bandwidth
    numerator, denominator, _ = cont2discrete(
        ([omega**2], [1.0, 2 * damping * omega, omega**2]), 1 / rate, method="foh"
    )
    return lfilter(np.ravel(numerator), denominator, signals, axis=0)


def correlations(
    duration: float = DURATION, seed: int = 4
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return lags [s] and correlation [rad^2/s] of every signal of the figure, and of the
    polynomial behind the actuator.
    """
    signals = {name: signal_of(shape, duration, seed) for name, shape in SHAPES.items()}
    name = list(SHAPES)[-1]
    signals[f"{name}, behind a 30 Hz actuator"] = behind_actuator(signals[name])
    return {
        name: cross_correlation(samples[:, 0], samples[:, 1], RATE)
        for name, samples in signals.items()
    }


def figure(duration: float = DURATION, seed: int = 4) -> Figure:
    """Draw the signals above, and the correlations in per cent of their peaks below."""
    picture = Figure(figsize=(8, 7), layout="constrained")
    FigureCanvasAgg(picture)
    above, below = picture.subplots(2, 1)
    shown = round(SHOWN_DURATION * RATE)
    for name, shape in SHAPES.items():
        above.plot(
            1e3 * np.arange(shown) / RATE,
            1e3 * signal_of(shape, SHOWN_DURATION, seed)[:, 0],
            label=name,
            linewidth=1.2,
        )
    above.set(
        xlabel="time [ms]", ylabel="position [mrad]", title="Pulse-step signal in four shapes"
    )
    above.set_ylim(top=55)  # mrad, room for the legend
    above.legend(fontsize="small", loc="upper center", ncols=2)
    for name, (lags, values) in correlations(duration, seed).items():
        style = "--" if "actuator" in name else "-"
        label = f"{name}: {residual(lags, values):.1f} %"
        below.plot(
            1e3 * lags, 100 * values / np.abs(values).max(), style, label=label, linewidth=1.2
        )
    below.axvspan(1e3 * REFLEX_LAGS[0], 1e3 * REFLEX_LAGS[1], color="0.92", zorder=0)
    below.set(
        xlabel="lag [ms]",
        ylabel="correlation [% of peak]",
        title="Position with half-wave rectified velocity; largest value at 40 to 400 ms (grey), "
        "where it should be zero",
    )
    below.title.set_fontsize("medium")
    below.legend(fontsize="small", loc="lower center")
    return picture


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the picture and print the largest correlation at 40 to 400 ms for each signal."""
    parser = argparse.ArgumentParser(
        prog="python -m perturbation_generator.figure2", description=main.__doc__
    )
    parser.add_argument("out", type=Path, help="file to write, for instance figure2.png")
    parser.add_argument("--overwrite", action="store_true", help="replace the file where it exists")
    options = parser.parse_args(arguments)
    if options.out.exists() and not options.overwrite:
        print(f"error: {options.out} exists; --overwrite replaces it", file=sys.stderr)
        return 1
    figure().savefig(options.out, dpi=120)
    for name, (lags, values) in correlations().items():
        print(f"{name:52s} {residual(lags, values):6.2f} % of the peak")
    print(f"written: {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
