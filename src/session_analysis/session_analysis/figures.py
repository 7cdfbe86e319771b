"""Figures 4, 5 and 8 of van 't Veld et al. 2018 from recorded sessions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from emg_driver.muscles import (
    BACKGROUND,
    DORSIFLEXING,
    MUSCLES,
    REFLEX,
    RESPONSE_COLUMNS,
    STRETCHED_BY,
)
from emg_driver.settings import Settings
from session_analysis.colours import COLOURS
from session_analysis.excerpts import Excerpt, estimate_column, smoothed
from session_analysis.hold_opinions import HoldOpinion
from session_analysis.table3 import Cell, as_text

SHOWN_MUSCLE = "SOL"  # as in the paper's figures
UV = 1e6
HOLDS_IN_A_ROW = 4
"""Number of holds beside one another that are still readable on a printed page."""


def figure4(excerpt: Excerpt, path: Path) -> None:
    """Draw the ensemble average of the rectified EMG, with the windows of background and reflex."""
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    windows = Settings()
    axes = figure.subplots(2, 2, sharex=True).ravel()
    for index, (muscle, axis) in enumerate(zip(MUSCLES, axes, strict=True)):
        axis.axvspan(-1e3 * windows.background_window, 0.0, color="0.85", label="background")
        axis.axvspan(
            1e3 * windows.reflex_start, 1e3 * windows.reflex_end, color="#f5d9b8", label="reflex"
        )
        for measures, wave, colour in zip(
            (excerpt.first, excerpt.second), excerpt.ensembles, COLOURS, strict=False
        ):
            label = (
                f"hold {measures.hold.number}: K {measures.K:.0f} N·m/rad, G {measures.G:.1f} "
                "N·m·s/rad"
            )
            axis.plot(1e3 * wave[:, 0], UV * wave[:, 1 + index], color=colour, lw=1.0, label=label)
        direction = "dorsiflexing" if STRETCHED_BY[muscle] == DORSIFLEXING else "plantarflexing"
        axis.set(title=f"{muscle}, {direction} onsets", ylim=(0.0, None))
    for axis in axes[2:]:
        axis.set_xlabel("time after onset [ms]")
    for axis in axes[::2]:
        axis.set_ylabel("rectified EMG [µV]")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize=8)
    figure.savefig(path, dpi=110)


def figure5(cells: list[Cell], path: Path) -> None:
    """Draw absolute and normalised values of every hold, for the soleus at each target."""
    chosen = [cell for cell in cells if cell.muscle == SHOWN_MUSCLE]
    figure = Figure(figsize=(9.0, 3.2 * len(chosen)), layout="constrained")
    rows = figure.subplots(len(chosen), 2, squeeze=False)
    for cell, (left, right) in zip(chosen, rows, strict=True):
        impedance = "K [N·m/rad]" if cell.pathway == "intrinsic" else "G [N·m·s/rad]"
        emg = "background [µV]" if cell.pathway == "intrinsic" else "reflex [µV·s]"
        for subject, colour in zip(
            dict.fromkeys(cell.subjects.tolist()), COLOURS * (1 + len(cell.subjects)), strict=False
        ):
            own = cell.subjects == subject
            _points(left, cell.impedance[own], UV * cell.emg[own], colour, str(subject))
            _points(right, cell.impedance_z[own], cell.emg_z[own], colour, str(subject))
        left.set(
            xlabel=impedance,
            ylabel=f"{cell.muscle} {emg}",
            title=f"{cell.pathway}, {cell.target:g} N·m: absolute",
        )
        right.set(
            xlabel="z-score of " + impedance.split()[0],
            ylabel="z-score of the EMG",
            title=f"normalised: r = {as_text(cell.correlation)}",
        )
        left.legend(fontsize=7)
    figure.savefig(path, dpi=110)


def _points(axis, x: np.ndarray, y: np.ndarray, colour: str, label: str) -> None:  # type: ignore[no-untyped-def]
    good = np.isfinite(x) & np.isfinite(y)
    axis.plot(x[good], y[good], "o", ms=4, color=colour, label=label)
    if good.sum() >= 3 and np.ptp(x[good]) > 0:
        slope, intercept = np.polyfit(x[good], y[good], 1)
        ends = np.array([x[good].min(), x[good].max()])
        axis.plot(ends, slope * ends + intercept, color=colour, lw=1.0)


def figure8(excerpt: Excerpt, path: Path) -> None:
    """Draw torque, K, G and the soleus's activity through two holds, low-pass filtered."""
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    axes = figure.subplots(5, 1, sharex=True)
    begin = excerpt.first.hold.start
    index = MUSCLES.index(SHOWN_MUSCLE)
    stretched = excerpt.responses[excerpt.responses[:, 1] == STRETCHED_BY[SHOWN_MUSCLE]]
    series = [
        ("torque\n[N·m]", excerpt.torque),
        (
            "K\n[N·m/rad]",
            np.column_stack(
                [excerpt.estimates[:, 0], estimate_column(excerpt.estimates, "K[N.m/rad]")]
            ),
        ),
        (f"{SHOWN_MUSCLE}\nbackground [µV]", _of_responses(stretched, BACKGROUND[index])),
        (
            "G\n[N·m·s/rad]",
            np.column_stack(
                [excerpt.estimates[:, 0], estimate_column(excerpt.estimates, "G[N.m.s/rad]")]
            ),
        ),
        (f"{SHOWN_MUSCLE}\nreflex [µV·s]", _of_responses(stretched, REFLEX[index])),
    ]
    for axis, (label, values), colour in zip(axes, series, COLOURS, strict=False):
        axis.plot(values[:, 0] - begin, values[:, 1], color=colour, lw=1.2)
        axis.set_ylabel(label)
        for measures in (excerpt.first, excerpt.second):
            axis.axvspan(measures.hold.start - begin, measures.hold.end - begin, color="0.92")
    for measures in (excerpt.first, excerpt.second):
        hold = measures.hold
        text = f"hold {hold.number}, target {hold.target:g} N·m"
        axes[0].text(
            0.5 * (hold.start + hold.end) - begin,
            1.03,
            text,
            ha="center",
            transform=axes[0].get_xaxis_transform(),
        )
    figure.align_ylabels()
    axes[-1].set_xlabel("time after the start of the first hold [s]")
    figure.savefig(path, dpi=110)


def _of_responses(rows: np.ndarray, name: str) -> np.ndarray:
    return smoothed(np.column_stack([rows[:, 0], UV * rows[:, RESPONSE_COLUMNS.index(name)]]))


def frequency_figure(opinions: Sequence[HoldOpinion], path: Path) -> None:
    """Draw gain, phase and coherence from position to torque of each hold, with the fitted model.

    Parameters
    ----------
    opinions
        Of holds that could be judged.
    path
        The PNG to write.
    """
    bands = -(-len(opinions) // HOLDS_IN_A_ROW)
    columns = min(len(opinions), HOLDS_IN_A_ROW)
    figure = Figure(figsize=(max(3.0 * columns, 5.0), 5.5 * bands), layout="constrained")
    axes = figure.subplots(3 * bands, columns, sharex=True, sharey="row", squeeze=False)
    for axis in axes.ravel():
        axis.set_visible(False)
    for number, one in enumerate(opinions):
        band, column = divmod(number, HOLDS_IN_A_ROW)
        _response(axes[3 * band : 3 * band + 3, column], one, column == 0)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize=8)
    figure.savefig(path, dpi=110)


def _response(axes: np.ndarray, one: HoldOpinion, labelled: bool) -> None:
    """Draw the frequency response of one hold into three axes, one below the other."""
    assert one.opinion is not None
    response = one.opinion.response
    gain, phase, coherence = axes
    for values, colour, label in (
        (response.measured, "0.5", "measured"),
        (response.model, COLOURS[1], "fitted cascade"),
    ):
        gain.plot(response.frequency, np.abs(values), color=colour, lw=1.2, label=label)
        turned = np.degrees(np.unwrap(np.angle(values)))
        phase.plot(response.frequency, turned, color=colour, lw=1.2)
    coherence.plot(response.frequency, response.coherence, color=COLOURS[0], lw=1.2)
    title = f"{one.subject}, hold {one.hold.number}\n{one.hold.target:g} N·m"
    gain.set(xscale="log", yscale="log", title=title)
    coherence.set(ylim=(0.0, 1.02), xlabel="frequency [Hz]")
    for axis, label in zip(axes, ("gain [N·m/rad]", "phase [°]", "coherence"), strict=True):
        axis.set_visible(True)
        axis.tick_params(labelbottom=axis is coherence)
        if labelled:
            axis.set_ylabel(label)
