"""The pictures of the demo, which need no knowledge of the project."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from impedance_estimator.estimator import ESTIMATE_COLUMNS, TORQUE_COLUMNS

# Okabe and Ito's palette, distinguished with any colour vision.
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#777777"
RESOLUTION = 130  # dots per inch
WIDTH = 1.96  # standard errors on each side of an interval of 95 %
BEFORE, AFTER = 0.1, 0.4  # s around a perturbation
ONSET_SPEED = (
    0.3  # of the fastest movement; a push is well above, the way between pushes well below
)
LEAST_SPACING = (
    0.15  # s between onsets; the shortest way between two steps of the real trials is 0.2 s
)


def live_run(
    columns: tuple[str, ...],
    estimates: np.ndarray,
    paper: np.ndarray,
    truth_columns: tuple[str, ...],
    truth: np.ndarray,
    path: Path,
) -> None:
    """Draw K and G over time, estimated live and with the paper's algorithm.

    True values of the simulation are shown beside them; each array has the shape (n, m).
    """
    figure, axes = plt.subplots(2, 1, figsize=(9, 6), sharex=True, constrained_layout=True)
    start = truth[0, 0]
    valid = estimates[:, columns.index("valid[1]")] == 1.0
    for axis, (symbol, unit, words) in zip(
        axes, (("K", "N.m/rad", "stiffness K"), ("G", "N.m.s/rad", "reflex gain G")), strict=True
    ):
        name = f"{symbol}[{unit}]"
        time = estimates[:, 0] - start
        axis.plot(
            truth[:, 0] - start,
            truth[:, truth_columns.index(name)],
            color=GREY,
            lw=2,
            label="true value in the simulation",
        )
        for rows, color, label in (
            (paper, ORANGE, "the paper's algorithm, from the same bag"),
            (estimates, BLUE, "estimated online, valid"),
        ):
            shown = np.where(
                rows[:, columns.index("valid[1]")] == 1.0, rows[:, columns.index(name)], np.nan
            )
            axis.plot(rows[:, 0] - start, shown, color=color, lw=1.5, label=label)
        axis.set_ylabel(f"{words} [{unit.replace('.', '·')}]")
        axis.set_ylim(bottom=0)
        axis.grid(alpha=0.3)
        if valid.any():
            axis.axvspan(
                0,
                time[valid][0],
                color=GREY,
                alpha=0.12,
                lw=0,
                label="settling: no valid estimate yet",
            )
    axes[0].legend(loc="upper left")
    axes[0].set_title(
        "Simulated ankle: stiffness and reflex gain jump, the online estimates follow"
    )
    axes[1].set_xlabel("time since the start [s]")
    figure.savefig(path, dpi=RESOLUTION)
    plt.close(figure)


def calibrated_run(
    columns: tuple[str, ...],
    without: np.ndarray,
    calibrated: np.ndarray,
    truth: np.ndarray,
    path: Path,
) -> None:
    """Draw K, G and doubt over time, estimated live without and with calibration.

    Parameters
    ----------
    columns
        Of the estimates.
    without, calibrated
        Estimates of the same samples, each of shape (n, m).
    truth
        Time [s], K [N.m/rad] and G [N.m.s/rad], shape (j, 3).
    path
        File to write.
    """
    figure, axes = plt.subplots(
        3, 1, figsize=(9, 7), sharex=True, constrained_layout=True, height_ratios=(3, 3, 1)
    )
    runs = ((without, ORANGE, "without calibration"), (calibrated, BLUE, "calibrated"))
    start = truth[0, 0]
    for k, (axis, name, words) in enumerate(
        zip(
            axes,
            ("K[N.m/rad]", "G[N.m.s/rad]", "doubt[1]"),
            ("stiffness K [N·m/rad]", "reflex gain G [N·m·s/rad]", "doubt"),
            strict=True,
        )
    ):
        if name != "doubt[1]":
            true = truth[:, 1 + k]
            axis.plot(truth[:, 0] - start, true, color=GREY, lw=2, label="true value of the joint")
        for rows, color, label in runs:
            valid = rows[:, columns.index("valid[1]")] == 1.0
            time = rows[:, 0] - start
            value = np.where(valid, rows[:, columns.index(name)], np.nan)
            axis.plot(time, value, color=color, lw=1.5, label=f"live, {label}")
            if name != "doubt[1]":
                error = WIDTH * rows[:, columns.index(f"se_{name}")]
                axis.fill_between(time, value - error, value + error, color=color, alpha=0.15, lw=0)
        axis.set_ylabel(words)
        axis.set_ylim(bottom=0)
        axis.grid(alpha=0.3)
    axes[2].set_ylim(0, 1.05)
    axes[0].legend(loc="lower right")
    axes[0].set_title(
        "Simulated rig with plate, straps, late torque and a servo that gives way\n"
        "(bands: 95 % of what the standard error states)"
    )
    axes[2].set_xlabel("time since the start [s]")
    figure.savefig(path, dpi=RESOLUTION)
    plt.close(figure)


def onsets(time: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return start times [s] and directions of the fast movements in a position signal [rad].

    The signal has the shape (n,); a direction is 1 dorsiflexing, -1 plantarflexing.
    """
    rate = (len(time) - 1) / (time[-1] - time[0])
    window = max(int(rate * 0.005), 1)
    speed = np.convolve(np.gradient(position, time), np.ones(window) / window, mode="same")
    fast = np.abs(speed) > ONSET_SPEED * np.quantile(np.abs(speed), 0.999)
    starts = np.flatnonzero(fast[1:] & ~fast[:-1]) + 1
    chosen: list[int] = []
    for index in starts:
        if not chosen or time[index] - time[chosen[-1]] > LEAST_SPACING:
            chosen.append(int(index))
    kept = np.array(chosen, dtype=int)
    return time[kept], np.sign(speed[kept])


def around(time: np.ndarray, signals: np.ndarray, at: np.ndarray, lags: np.ndarray) -> np.ndarray:
    """Return the mean of signals (n, m) around the times `at`, shape (len(lags), m).

    Each signal counts from its own value before.
    """
    before = lags < -0.01
    segments = []
    for moment in at:
        if moment + lags[0] < time[0] or moment + lags[-1] > time[-1]:
            continue
        segment = np.column_stack([np.interp(moment + lags, time, signal) for signal in signals.T])
        segments.append(segment - segment[before].mean(axis=0))
    return np.mean(segments, axis=0) if segments else np.full((len(lags), signals.shape[1]), np.nan)


def real_trial(
    name: str, estimates: np.ndarray, torques: np.ndarray, samples: np.ndarray, path: Path
) -> None:
    """Draw estimates over a trial, and measured against predicted torque.

    Parameters
    ----------
    name
        Title of the picture.
    estimates
        Shape (n, 12), columns `ESTIMATE_COLUMNS`.
    torques
        Shape (j, 4), columns `TORQUE_COLUMNS`.
    samples
        Shape (k, 3): time [s], position [rad], torque [N.m].
    path
        File to write.
    """
    figure, axes = plt.subplots(2, 2, figsize=(11, 7), constrained_layout=True)
    start = samples[0, 0]
    valid = estimates[:, ESTIMATE_COLUMNS.index("valid[1]")] == 1.0
    for axis, column, words in (
        (axes[0, 0], "K[N.m/rad]", "stiffness K [N·m/rad]"),
        (axes[0, 1], "G[N.m.s/rad]", "reflex gain G [N·m·s/rad]"),
    ):
        value = np.where(valid, estimates[:, ESTIMATE_COLUMNS.index(column)], np.nan)
        axis.plot(estimates[:, 0] - start, value, color=BLUE)
        axis.set(xlabel="time [s]", ylabel=words)
        axis.grid(alpha=0.3)
    lags = np.linspace(-BEFORE, AFTER, 250)
    moments, directions = onsets(samples[:, 0], samples[:, 1])
    settled = moments > estimates[valid, 0][0]
    parts = torques[:, 1:]
    predicted = (
        parts[:, TORQUE_COLUMNS.index("intrinsic_torque[N.m]") - 1]
        + parts[:, TORQUE_COLUMNS.index("reflex_torque[N.m]") - 1]
    )
    shown = np.column_stack([parts, predicted])
    for axis, direction, words in (
        (axes[1, 0], 1, "dorsiflexing"),
        (axes[1, 1], -1, "plantarflexing"),
    ):
        chosen = moments[settled & (directions == direction)]
        mean = around(torques[:, 0], shown, chosen, lags)
        axis.plot(1e3 * lags, mean[:, 0], color="black", lw=2, label="measured")
        axis.plot(
            1e3 * lags, mean[:, 3], color=ORANGE, lw=1.5, label="predicted: intrinsic + reflex"
        )
        axis.plot(1e3 * lags, mean[:, 1], color=BLUE, lw=1, ls="--", label="intrinsic part")
        axis.plot(1e3 * lags, mean[:, 2], color=GREEN, lw=1, ls="--", label="reflex part")
        axis.set(
            xlabel="time after the push [ms]",
            ylabel="torque [N·m]",
            title=f"mean of {len(chosen)} {words} pushes",
        )
        axis.grid(alpha=0.3)
    axes[1, 0].legend(fontsize=8)
    figure.suptitle(
        f"Real human ankle ({name}): what was estimated, and how much of the torque it explains"
    )
    figure.savefig(path, dpi=RESOLUTION)
    plt.close(figure)
