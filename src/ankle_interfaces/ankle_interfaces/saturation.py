"""Whether a channel stands at the end of its range: a sensor or a converter that can show no more.

A quantised, clean channel has equal neighbours as well, and a movement with holds stands still. So
samples at the extreme count only where they stay longer than samples between the extremes do, pile
up beside the next value, and are entered at the usual speed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

LEAST_SHARE = 0.002
"""Share of samples at an end below which a few peaks are cut; estimates do not change by it."""
# Two equal samples at the extreme are chance where a converter's step is near the noise.
_SHORTEST_RUN = 3
# Quantile of the samples between the extremes by the length of the run that they stand in: longer
# runs than that are not chance.
_USUAL_QUANTILE = 0.99
# A channel with fewer neighbours between its extremes, as a movement between two levels without
# noise, does not tell what is usual.
_LEAST_BETWEEN = 0.3
# The top of a sine in steps of a converter holds 2.4 times as many samples as the next step.
_LEAST_PILE = 5.0
# Of the usual step: a movement that slows down into a hold has smaller ones before it, a cut
# one about half of the usual.
_LEAST_ENTRY = 0.1
# Of the range: values that differ by rounding, after interpolation, are one.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Saturation:
    """Describes one end at which a channel stands.

    Attributes
    ----------
    side
        ``upper`` or ``lower``.
    extreme
        The value there, in the channel's unit.
    share
        Of all samples, 0 to 1.
    """

    side: str
    extreme: float
    share: float


def saturations(values: np.ndarray, command: np.ndarray | None = None) -> list[Saturation]:
    """Return the ends at which a channel stands for longer than chance allows.

    Parameters
    ----------
    values
        The channel, shape (n,). Values that are not finite are left out.
    command
        What the channel was commanded to do, shape (n,), where it is known: samples at which it
        stands still are a hold.
    """
    finite = np.isfinite(values)
    held = np.zeros(len(values), dtype=bool)
    if command is not None:
        steps = np.abs(np.diff(command, prepend=command[:1]))
        held = ~(steps > _ROUNDING * np.nanmax(np.abs(command), initial=0.0))
    values, held = values[finite], held[finite]
    if len(values) < _SHORTEST_RUN or np.ptp(values) == 0.0:
        return []
    near = _ROUNDING * np.ptp(values)
    ends = {"upper": values >= values.max() - near, "lower": values <= values.min() + near}
    between = ~ends["upper"] & ~ends["lower"]
    steps = np.abs(np.diff(values))
    inner = between[:-1] & between[1:]
    if np.mean(inner) <= _LEAST_BETWEEN:
        return []
    shortest = max(_SHORTEST_RUN, _usual_run(steps, inner) + 1)
    moving = steps[inner & (steps > near)]
    found = []
    for (side, at), sign in zip(ends.items(), (1.0, -1.0), strict=True):
        runs = [run for run in _runs(at) if run[1] - run[0] >= shortest]
        runs = [(start, stop) for start, stop in runs if not held[start + 1 : stop].all()]
        count = sum(stop - start for start, stop in runs)
        if count <= LEAST_SHARE * len(values):
            continue
        following = np.max(sign * values[~at])
        beside = np.count_nonzero(sign * values[~at] >= following - near)
        entries = [steps[start - 1] for start, _ in runs if start > 0]
        if np.count_nonzero(at) > _LEAST_PILE * beside and (
            not entries or np.median(entries) > _LEAST_ENTRY * np.median(moving)
        ):
            found.append(Saturation(side, float(sign * np.max(sign * values)), count / len(values)))
    return found


def saturation_sentences(
    channels: Mapping[str, np.ndarray], command: np.ndarray | None = None
) -> list[str]:
    """Return one sentence for each end at which a channel stands, with what to do.

    Parameters
    ----------
    channels
        By name with unit, as ``torque[N.m]``, each of shape (n,).
    command
        Commanded position, shape (n,), where it is known; it is that of the channel ``position``.
    """
    found = []
    for column, values in channels.items():
        name, _, unit = column.rstrip("]").partition("[")
        for one in saturations(values, command if name == "position" else None):
            found.append(
                f"{name} is saturated: {100 * one.share:.1f} % of the samples stand at its "
                f"{one.side} end {one.extreme:.6g} {unit} for longer than chance allows, and what "
                "was beyond it is lost: record again with a larger range or a lower gain"
            )
    return found


def _runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """Return (start, stop) of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def _usual_run(steps: np.ndarray, inner: np.ndarray) -> int:
    """Return the length of the runs of equal samples between the extremes in which, or in shorter
    ones, nearly all samples stand.
    """
    lengths = np.sort([stop - start + 1 for start, stop in _runs(inner & (steps == 0.0))])
    standing = int(lengths.sum())
    moving = np.count_nonzero(inner) - (standing - len(lengths))
    shares = (moving + np.cumsum(lengths)) / max(1, moving + standing)
    if not len(lengths) or moving >= _USUAL_QUANTILE * (moving + standing):
        return 1
    return int(lengths[np.searchsorted(shares, _USUAL_QUANTILE)])
