"""Pictures of a diagnosis, each as a PNG in base64 for a report that is one file."""

from __future__ import annotations

import base64
import io

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from model_discrepancy.evaluation import HeldOut
from model_discrepancy.fit import Fitter
from model_discrepancy.locate import ResidualMap
from model_discrepancy.search import Found

matplotlib.use("Agg")

_BLOCKS = (
    "actuator and reference",
    "coupling between footplate and foot",
    "intrinsic",
    "reflex input",
    "reflex dynamics",
    "activation",
    "torque sensor",
    "position sensor",
)
_GREY, _BLUE, _RED = "0.35", "#1f6fb4", "#c8372d"


def encoded(figure: Figure) -> str:
    """The figure as base64 PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, bbox_inches="tight")
    return base64.b64encode(buffer.getvalue()).decode()


def before_and_after(fitter: Fitter, base_map: ResidualMap, base: HeldOut, final: HeldOut, noise: float) -> str:
    """Mean torque around movements: recorded, and predicted on unseen data by both models; the band is what no model explains."""
    rows = fitter.rows
    figure = Figure(figsize=(10, 3.6))
    reach = np.arange(-int(0.05 * rows.rate), int(0.4 * rows.rate))
    for number, (sign, word) in enumerate(((1.0, "dorsiflexion"), (-1.0, "plantarflexion"))):
        axes = figure.add_subplot(1, 2, number + 1)
        onsets = base_map.onsets
        index = np.round(onsets.time[onsets.direction == sign] * rows.rate).astype(int)
        index = index[(index + reach[0] >= 0) & (index + reach[-1] < rows.count)]
        if len(index):
            _mean_responses(axes, fitter, index, reach, base, final, noise / np.sqrt(len(index)))
        axes.set_title(f"after {word} ({len(index)} movements)")
        axes.set_xlabel("time after onset [ms]")
        axes.set_ylabel("torque [N.m]")
        axes.legend(fontsize=8)
    return encoded(figure)


def _mean_responses(axes: Axes, fitter: Fitter, index: np.ndarray, reach: np.ndarray, base: HeldOut, final: HeldOut, band: float) -> None:
    segments = index[:, None] + reach
    time = 1000.0 * reach / fitter.rows.rate
    recorded = fitter.plain_target[segments].mean(axis=0)
    axes.fill_between(time, recorded - 2 * band, recorded + 2 * band, color="0.85", label="not explainable (2 standard errors)")
    axes.plot(time, recorded, color="k", lw=2, label="recorded")
    axes.plot(time, recorded - base.residual[segments].mean(axis=0), color=_RED, label="base model")
    axes.plot(time, recorded - final.residual[segments].mean(axis=0), color=_BLUE, label="with the new physics")
    axes.axvline(0.0, color="0.8", lw=0.8)


def path_diagram(marked: set[str]) -> str:
    """The signal path with the guilty blocks in red."""
    figure = Figure(figsize=(10, 1.5))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.axis("off")
    for number, name in enumerate(_BLOCKS):
        guilty = name in marked
        text = name.replace(" and ", "\nand ").replace(" between ", "\nbetween ").replace("footplate and", "footplate\nand")
        style = {
            "boxstyle": "round,pad=0.5",
            "fc": "#f7d6d3" if guilty else "#eef2f6",
            "ec": _RED if guilty else _GREY,
            "lw": 2.2 if guilty else 1.0,
        }
        axes.text((number + 0.5) / len(_BLOCKS), 0.5, text, ha="center", va="center", fontsize=8, bbox=style, transform=axes.transAxes)
    return encoded(figure)


def residual_picture(base: ResidualMap, final: ResidualMap) -> str:
    """Residual by time after onset and direction, and its share of torque by frequency band, before and after."""
    figure = Figure(figsize=(10, 3.4))
    for number, direction in enumerate((1, 2)):
        axes = figure.add_subplot(1, 3, number + 1)
        for found, color, label in ((base, _RED, "base model"), (final, _BLUE, "with the new physics")):
            axes.plot(1000 * found.responses[0], found.responses[direction], color=color, label=label)
        axes.axhline(0.0, color="0.8", lw=0.8)
        axes.set_title(f"mean residual, {('dorsiflexion', 'plantarflexion')[number]}", fontsize=10)
        axes.set_xlabel("time after onset [ms]")
        axes.set_ylabel("residual [N.m]")
        axes.legend(fontsize=7)
    axes = figure.add_subplot(1, 3, 3)
    place = np.arange(len(base.share))
    axes.bar(place - 0.2, [100 * s for s in base.share.values()], 0.4, color=_RED)
    axes.bar(place + 0.2, [100 * s for s in final.share.values()], 0.4, color=_BLUE)
    axes.set_xticks(place, [f"{low:g}-{high:g}" for low, high in base.share], fontsize=7)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("residual, % of torque")
    figure.tight_layout()
    return encoded(figure)


def ladder(found: Found) -> str:
    """What each term takes off the whitened error."""
    figure = Figure(figsize=(7, 0.6 + 0.4 * max(len(found.effects), 1)))
    axes = figure.add_subplot()
    names = [effect.trial.name.replace("_", " ") for effect in found.effects]
    axes.barh(names, [100 * effect.trial.gain for effect in found.effects], color=_BLUE)
    axes.invert_yaxis()
    axes.set_xlabel("whitened error that returns when the term is removed [% of what it was without it]")
    return encoded(figure)
