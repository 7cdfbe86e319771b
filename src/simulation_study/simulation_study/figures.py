"""The simulated parts of figures 6 and 7 of van 't Veld et al. 2018, and the intrinsic VAF on a
training and a validation set.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ankle_physics.virtual_rig import Recording
from simulation_study.intrinsic_prediction import accuracy, after_stretch, motion, true_torque
from simulation_study.rigs import record
from simulation_study.trial import Ankle, Course, Trial

SECONDS = 60.0
"""Recordings on which torque is predicted last so long [s]: 100 stretches."""
SHOWN_DURATION = 0.150
"""Figure 7 shows so much time [s] after the start of the stretch."""
COLOURS = {"O": "tab:orange", "CE": "tab:blue"}


@dataclass(frozen=True)
class IntrinsicAccuracy:
    """Holds the VAF of the true intrinsic torque [%], mean and standard deviation over seeds; shape
    (2,) each.

    Attributes
    ----------
    algorithm
        O or CE, in the rig CE.
    whole
        All samples; training and validation set.
    window
        The 40 ms after each stretch; training and validation set.
    whole_spread, window_spread
        Standard deviations.
    """

    algorithm: str
    whole: np.ndarray
    window: np.ndarray
    whole_spread: np.ndarray
    window_spread: np.ndarray


def _fixed_trials(results: dict[str, dict[str, Any]]) -> list[tuple[Trial, dict[str, Any]]]:
    found = []
    for name, result in results.items():
        if name.startswith("fixed_") and result["trial"]["rig"] == "CE":
            content = result["trial"]
            ankle, course = (
                Ankle(**content["ankle"]),
                Course(**content["course"]) if content["course"] else None,
            )
            found.append(
                (
                    Trial(**{**content, "ankle": ankle, "course": course, "seconds": SECONDS}),
                    result["estimates"],
                )
            )
    return found


def intrinsic_accuracies(
    results: dict[str, dict[str, Any]], most: int = 10
) -> list[IntrinsicAccuracy]:
    """Return each fixed run's mean K, B and I on its own recording and on another one.

    The other one has another perturbation and noise.

    Parameters
    ----------
    results
        Of the trials of `protocol.table2_trials`.
    most
        Seeds; ten give the mean to a third of the spread.
    """
    found: dict[str, list[list[float]]] = {"O": [], "CE": []}
    for trial, estimates in _fixed_trials(results)[:most]:
        sets = [record(trial), record(replace(trial, seed=trial.seed ^ 1))]
        for algorithm, values in found.items():
            parameters = np.array(estimates[algorithm]["mean"][:3])
            values.append(
                [
                    vaf
                    for recording in sets
                    for vaf in _whole_and_window(recording, algorithm, parameters)
                ]
            )
    out = []
    for algorithm, values in found.items():
        mean, spread = np.mean(values, axis=0), np.std(values, axis=0)
        out.append(IntrinsicAccuracy(algorithm, mean[::2], mean[1::2], spread[::2], spread[1::2]))
    return out


def _whole_and_window(
    recording: Recording, algorithm: str, parameters: np.ndarray
) -> tuple[float, float]:
    predicted, true, within = _predicted(recording, algorithm, parameters)
    settled = recording.time > 1.0
    return accuracy(predicted[settled], true[settled]), accuracy(
        predicted[settled & within], true[settled & within]
    )


def _predicted(
    recording: Recording, algorithm: str, parameters: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    filtered = algorithm != "O"
    predicted = motion(recording, measured_velocity=filtered, filtered=filtered) @ parameters
    return (
        predicted,
        true_torque(recording, filtered),
        after_stretch(recording.clean[:, 1], recording.rate),
    )


def figure6(results: dict[str, dict[str, Any]], path: Path) -> None:
    """Draw identified against simulated K and G, both random, rig CE."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    axes = figure.subplots(1, 2)
    trials = [
        result
        for name, result in results.items()
        if name.startswith("random_K_and_G_") and result["trial"]["rig"] == "CE"
    ]
    for axis, parameter, index, unit in (
        (axes[0], "K", 0, "N·m/rad"),
        (axes[1], "G", 3, "N·m·s/rad"),
    ):
        true = np.array([result["trial"]["ankle"][parameter] for result in trials])
        for algorithm, colour in COLOURS.items():
            mean = np.array([result["estimates"][algorithm]["mean"][index] for result in trials])
            spread = np.array([result["estimates"][algorithm]["sd"][index] for result in trials])
            axis.errorbar(
                true,
                mean,
                spread,
                fmt=".",
                color=colour,
                elinewidth=0.8,
                label=f"algorithm {algorithm}",
            )
        ends = np.array([0.0, true.max()])
        axis.plot(ends, ends, color="black", linewidth=0.8, label="truth")
        axis.set_xlabel(f"simulated {parameter} ({unit})")
        axis.set_ylabel(f"identified {parameter} ({unit})")
        axis.legend(frameon=False)
    figure.suptitle("Figure 6, simulation half: rig CE, mean ± standard deviation of each run")
    figure.savefig(path, dpi=120)


def figure7(results: dict[str, dict[str, Any]], path: Path) -> None:
    """Draw the intrinsic torque after a dorsiflexing step: mean of all stretches, true and as O and
    CE account for it.
    """
    trial, estimates = _fixed_trials(results)[0]
    recording = record(trial)
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    before, after = round(0.02 * recording.rate), round(SHOWN_DURATION * recording.rate)
    within = after_stretch(recording.clean[:, 1], recording.rate)
    starts = np.flatnonzero(within[1:] & ~within[:-1]) + 1
    starts = starts[(starts > recording.rate) & (starts < len(recording.time) - after)]
    # Steps only: a pulse is down again after 48 ms.
    starts = starts[
        recording.clean[starts + round(0.1 * recording.rate), 0] > 0.5 * recording.clean[:, 0].max()
    ]
    time = np.arange(-before, after) / recording.rate * 1e3
    for axis, (algorithm, colour) in zip(axes, COLOURS.items(), strict=True):
        predicted, true, _ = _predicted(
            recording, algorithm, np.array(estimates[algorithm]["mean"][:3])
        )
        for values, style in (
            (
                true,
                {
                    "color": "black",
                    "label": "true"
                    if algorithm == "O"
                    else "true, through the algorithm's low-pass",
                },
            ),
            (predicted, {"color": colour, "label": f"algorithm {algorithm}"}),
        ):
            axis.plot(
                time,
                np.mean([values[start - before : start + after] for start in starts], axis=0),
                **style,
            )
        axis.axvspan(0.0, 40.0, color="0.93")
        axis.set_xlabel("time after the start of the stretch (ms)")
        axis.legend(frameon=False)
    axes[0].set_ylabel("intrinsic torque (N·m)")
    figure.suptitle(
        f"Figure 7, simulation half: rig CE, mean of {len(starts)} steps; grey: the 40 ms before "
        "any reflex"
    )
    figure.savefig(path, dpi=120)
