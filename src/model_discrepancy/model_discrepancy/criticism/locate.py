"""A residual is located by time after the movement, direction, size and frequency.

What it depends on is found as well.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import coherence, welch
from scipy.stats import spearmanr

from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.movements import BANDS_HZ, WINDOWS_S, Onsets, find_onsets

SIZES = ("small", "medium", "large")
# What a recording says where it holds too few movements, no response that differs from chance, or
# no residual at all.
NO_LOCATION = "not seen"
_DIRECTIONS = {"up": "dorsiflexion", "down": "plantarflexion", "both": "both"}
_RESAMPLINGS = 200


@dataclass(frozen=True)
class Cell:
    """Holds the mean residual in one window after movements of one direction and size.

    Attributes
    ----------
    mean, low, high
        [N.m] with a 95 % bootstrap band over movements.
    rms
        Of the residual in the window over all movements [N.m].
    """

    direction: str
    size: str
    window: tuple[float, float]
    mean: float
    low: float
    high: float
    rms: float

    @property
    def significant(self) -> bool:
        """Tell whether the band excludes zero."""
        return self.low > 0.0 or self.high < 0.0


@dataclass
class ResidualMap:
    """Holds the residual by time, direction, size, band and dependence.

    Attributes
    ----------
    cells
        By direction, size and window.
    share
        Of the torque's variance in each band that is residual, by band.
    coherent
        Coherence of the residual with position, velocity, rectified velocity, by name and band.
    dependence
        Spearman correlation and p value of the response's misfit with each condition.
    odd_share
        Share of the mean residual response that changes sign with the direction, 0...1.
    responses
        Time [s] and mean residual after dorsiflexion and plantarflexion [N.m].
    """

    onsets: Onsets
    cells: list[Cell]
    share: dict[tuple[float, float], float]
    coherent: dict[str, dict[tuple[float, float], float]]
    dependence: dict[str, tuple[float, float]]
    odd_share: float
    responses: tuple[np.ndarray, np.ndarray, np.ndarray] = field(repr=False)

    def summary(self, place: str) -> dict[str, object]:
        """Return the verdict's ``localisation``."""
        after = [c for c in self.cells if c.window[0] >= 0.0]
        strong = [c for c in after if c.significant]
        peak = max((abs(c.mean) for c in strong), default=0.0)
        main = [c for c in strong if abs(c.mean) > 0.5 * peak]
        seen = bool(main)
        window = (
            [min(c.window[0] for c in main), max(c.window[1] for c in main)]
            if seen
            else NO_LOCATION
        )
        by_direction = {
            d: sum(c.mean**2 for c in strong if c.direction == d) for d in ("up", "down")
        }
        total = sum(by_direction.values()) or 1.0
        direction = next((d for d, power in by_direction.items() if power > 0.8 * total), "both")
        largest = max(self.share.values())
        bands = [b for b, share in self.share.items() if share > 0.5 * largest]
        causes = [name for name, (r, p) in self.dependence.items() if p < 0.001 and abs(r) > 0.25]
        return {
            "path": place,
            "window_s": window,
            "band_hz": [min(b[0] for b in bands), max(b[1] for b in bands)]
            if bands
            else NO_LOCATION,
            "direction": _DIRECTIONS[direction] if seen else NO_LOCATION,
            "symmetry": self._symmetry if seen else NO_LOCATION,
            "depends_on": (", ".join(causes) if causes else "nothing else that was tested")
            if self.dependence
            else NO_LOCATION,
        }

    @property
    def _symmetry(self) -> str:
        """Return how the mean residual responses of the two directions compare."""
        compared = {c.direction for c in self.cells}
        if compared != {"up", "down"}:
            return NO_LOCATION
        return "odd" if self.odd_share > 0.7 else "even" if self.odd_share < 0.3 else "mixed"


def residual_map(columns: Columns, fit: Fit, seed: int = 0) -> ResidualMap:
    """Return where the residual of this fit sits."""
    rows = columns.rows
    onsets = find_onsets(columns)
    inside = (onsets.time > rows.time[rows.used][0] + 0.1) & (
        onsets.time < rows.time[rows.used][-1] - 0.5
    )
    onsets = Onsets(onsets.time[inside], onsets.direction[inside], onsets.size[inside])
    index = np.round(onsets.time * rows.rate).astype(int)
    reach = np.arange(-int(0.1 * rows.rate), int(0.45 * rows.rate))
    segments = (
        fit.plain[index[:, None] + reach[None, :]] if len(index) else np.zeros((0, len(reach)))
    )
    lag = reach / rows.rate
    up, down = segments[onsets.direction > 0], segments[onsets.direction < 0]
    mean_up = up.mean(axis=0) if len(up) else np.zeros(len(lag))
    mean_down = down.mean(axis=0) if len(down) else np.zeros(len(lag))
    odd, even = 0.5 * (mean_up - mean_down), 0.5 * (mean_up + mean_down)
    power = float(odd @ odd + even @ even)
    return ResidualMap(
        onsets,
        _cells(segments, lag, onsets, np.random.default_rng(seed)),
        _band_shares(columns, fit),
        _coherences(columns, fit),
        _dependences(columns, segments, lag, onsets, index),
        float(odd @ odd) / power if power > 0 else 0.5,
        (lag, mean_up, mean_down),
    )


def _cells(
    segments: np.ndarray, lag: np.ndarray, onsets: Onsets, random: np.random.Generator
) -> list[Cell]:
    cells: list[Cell] = []
    if not len(segments):
        return cells
    edges = np.quantile(onsets.size, [0.0, 1 / 3, 2 / 3, 1.0])
    # Equal steps have one size only.
    classes = (
        [("all", 0.0, np.inf)]
        if edges[-2] - edges[1] < 0.1 * edges[-1]
        else list(zip(SIZES, edges[:-1], [*edges[1:-1], np.inf], strict=True))
    )
    for direction, sign in (("up", 1.0), ("down", -1.0)):
        for size, low, high in classes:
            chosen = segments[
                (onsets.direction == sign) & (onsets.size >= low) & (onsets.size < high)
            ]
            if len(chosen) < 8:
                continue
            for window in WINDOWS_S:
                part = chosen[:, (lag >= window[0]) & (lag < window[1])]
                means = part.mean(axis=1)
                drawn = means[random.integers(0, len(means), (_RESAMPLINGS, len(means)))].mean(
                    axis=1
                )
                low_band, high_band = np.percentile(drawn, [2.5, 97.5])
                rms = float(np.sqrt(np.mean(part**2)))
                cells.append(
                    Cell(
                        direction,
                        size,
                        window,
                        float(means.mean()),
                        float(low_band),
                        float(high_band),
                        rms,
                    )
                )
    return cells


def _band_shares(columns: Columns, fit: Fit) -> dict[tuple[float, float], float]:
    rows = columns.rows
    used = rows.used
    segment = int(2.0 * rows.rate)
    f, residual = welch(fit.plain[used], rows.rate, nperseg=segment)
    _, torque = welch(rows.plain(columns.target)[used], rows.rate, nperseg=segment)
    return {
        b: float(residual[(f >= b[0]) & (f < b[1])].sum() / torque[(f >= b[0]) & (f < b[1])].sum())
        for b in BANDS_HZ
    }


def _coherences(columns: Columns, fit: Fit) -> dict[str, dict[tuple[float, float], float]]:
    rows, m = columns.rows, columns.motion
    found = {}
    for name, signal in (
        ("position", m.position),
        ("velocity", m.velocity),
        ("rectified velocity", np.maximum(m.velocity, 0.0)),
    ):
        if not fit.plain[rows.used].any():
            found[name] = dict.fromkeys(BANDS_HZ, 0.0)
            continue
        moved = rows.plain(rows.spectrum(signal))
        f, value = coherence(
            moved[rows.used], fit.plain[rows.used], rows.rate, nperseg=int(rows.rate)
        )
        found[name] = {b: float(np.mean(value[(f >= b[0]) & (f < b[1])])) for b in BANDS_HZ}
    return found


def _dependences(
    columns: Columns, segments: np.ndarray, lag: np.ndarray, onsets: Onsets, index: np.ndarray
) -> dict[str, tuple[float, float]]:
    """Test whether the misfit of a response, per size and in its direction, follows a condition."""
    if len(segments) < 20 or not segments.any():
        return {}
    m, rows = columns.motion, columns.rows
    late = (lag >= 0.0) & (lag < 0.25)
    misfit = segments[:, late].mean(axis=1) * onsets.direction / onsets.size
    at = np.minimum((index * m.rate / rows.rate).astype(int), len(m.position) - 1)
    before = np.maximum(at - int(0.02 * m.rate), 0)
    conditions = {
        "torque level": m.activation[at],
        "position": m.position[before],
        "time into the recording": onsets.time,
        "interval since the last movement": np.diff(onsets.time, prepend=np.nan),
        "size of the movement": onsets.size,
    }
    found = {}
    for name, values in conditions.items():
        known = np.isfinite(values)
        if np.std(values[known]) > 0:
            result = spearmanr(values[known], misfit[known])
            found[name] = (float(result.statistic), float(result.pvalue))
    return found
