"""An unexplained mismatch is described by a static curve followed by linear dynamics.

The block acts at one place in the path.

Hammerstein block ``d(t) = sum_l a_l f(u(t - lag_l))`` with ``f(u) = sum_j b_j hinge_j(u)``, fitted
to the whitened residual: of all matrices ``theta = a b^T`` of rank one the one with the least
squares error, by alternating least squares (Bai 1998, Automatica 34, 333; Westwick & Kearney 2003,
Identification of Nonlinear Physiological Systems, chapter 6). What the model itself can imitate is
projected out of residual and columns, so that the block is what the model lacks. The input is the
one whose block predicts most of stretches that it was not trained on. Bands come from a bootstrap
over stretches of 5 s; each keeps its Gram matrix, so that a resample costs a sum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ankle_physics.terms.missing_block import INPUTS as TERM_INPUTS
from ankle_physics.terms.missing_block import LAGS_S as TERM_LAGS_S
from ankle_physics.terms.missing_block import LEVELS as TERM_LEVELS
from model_discrepancy.criticism.rank_one import Products, predicted_share, rank_one, tuned_ridge
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.generic_bank import LAGS_S, lag_windows
from model_discrepancy.fit.halves import STRETCH_S, interleaved
from model_discrepancy.fit.least_squares import orthonormal
from model_discrepancy.fit.movements import Onsets, Peak, peak_after
from model_discrepancy.recording.motion import Motion

# Knots of the static curve on each side of zero, as quantiles of the input's size on that side
# while it moves.
_KNOTS = (0.5, 0.8, 0.98)
# Sizes below this share of the largest are rest and noise; they place no knot.
_REST_SHARE = 0.05
_RESAMPLINGS = 200
# A simpler input (one side only) is kept when a richer one predicts less than this much more.
_MIN_RICHER_GAIN = 0.05
# Stretches from which a bootstrap and two halves can be made.
_LEAST_STRETCHES = 6

# No reflex acts earlier: the fastest pathway of the human calf takes about 35 ms (Sinkjaer et al.
# 1988), less a lag window.
_REFLEX_S = 0.03
# A curve whose smaller end is below this share of the larger one is called one-sided.
_ONE_SIDED_RATIO = 0.2
# Lag up to which a response counts as immediate: the width of the first windows.
_IMMEDIATE_LAG_S = 0.01

INPUTS: dict[str, tuple[str, Callable[[Motion], np.ndarray]]] = {
    "dorsiflexion velocity": ("rad/s", lambda m: np.maximum(m.velocity, 0.0)),
    "plantarflexion velocity": ("rad/s", lambda m: np.minimum(m.velocity, 0.0)),
    "position": ("rad", lambda m: m.position - float(np.mean(m.position))),
    "velocity": ("rad/s", lambda m: m.velocity),
    "acceleration": ("rad/s^2", lambda m: m.acceleration),
}
"""Input of the block: unit, and signal of shape (n,) from the motion."""


@dataclass(frozen=True)
class MissingBlock:
    """Describes a static curve and linear dynamics that predict the residual.

    Attributes
    ----------
    input
        A key of `INPUTS`.
    share
        Of the whitened residual's power that the block predicts on stretches it was not trained on,
        0...1.
    shares
        The same for every input.
    lags
        [s], shape (L,).
    response
        Impulse response [N.m/s] to the curve's output, with its 95 % band, shape (3, L): low,
        middle, high.
    levels
        Of the input, in its unit, shape (H,), zero included.
    curve
        Output of the static curve, 1 at its largest, with its 95 % band, shape (3, H).
    peak
        The largest torque of the block.
    """

    input: str
    share: float
    shares: dict[str, float]
    lags: np.ndarray
    response: np.ndarray
    levels: np.ndarray
    curve: np.ndarray
    peak: Peak

    @property
    def unit(self) -> str:
        """Return the unit of the input."""
        return INPUTS[self.input][0]

    @property
    def place(self) -> str:
        """Return where in the signal path the block points to, by its input and by when it acts."""
        first, last = self._acts
        if first >= _REFLEX_S:
            return "reflex dynamics"
        if self.input == "acceleration":
            return "coupling between footplate and foot"
        # Faster than muscle relaxes, in both directions, and not at once: something that rings or
        # lags in the rig.
        return (
            "torque sensor"
            if _IMMEDIATE_LAG_S < last <= _REFLEX_S + _IMMEDIATE_LAG_S
            and "flexion" not in self.input
            else "intrinsic"
        )

    @property
    def _acts(self) -> tuple[float, float]:
        """Return the first and last lag [s] at which the response is sure and strong."""
        low, middle, high = self.response
        strong = ((low > 0.0) | (high < 0.0)) & (np.abs(middle) > 0.2 * np.abs(middle).max())
        lags = self.lags[strong] if strong.any() else self.lags[[int(np.argmax(np.abs(middle)))]]
        return float(lags[0]), float(lags[-1])

    @property
    def sentence(self) -> str:
        """Return the block in plain words with its numbers."""
        first, last = self._acts
        when = (
            "at once"
            if last <= _IMMEDIATE_LAG_S
            else f"{1000 * max(first, 0.0):.0f} to {1000 * last:.0f} ms later"
        )
        return (
            f"What is missing follows {self.input} and acts {when}: it {self.peak.sentence}; "
            f"{self._shape}. "
            f"It predicts {100 * max(self.share, 0.0):.0f} % of what the model leaves unexplained."
        )

    @property
    def _shape(self) -> str:
        """Return the static curve in words."""
        middle = self.curve[1]
        below, above = abs(middle[0]), abs(middle[-1])
        if min(below, above) < _ONE_SIDED_RATIO * max(below, above):
            side = (
                "" if self.levels[0] == 0.0 or self.levels[-1] == 0.0 else "almost one-sided and "
            )
        else:
            side = (
                "opposite in the two directions and "
                if middle[0] * middle[-1] < 0
                else "of one sign in both directions and "
            )
        end = -1 if above >= below else 0
        half = float(np.interp(0.5 * self.levels[end], self.levels, middle)) / float(middle[end])
        growth = (
            "growing less than in proportion"
            if half > 0.65
            else "growing more than in proportion"
            if half < 0.35
            else "in proportion"
        )
        return f"it is {side}{growth} to it"

    def term_values(self, mean_angle: float) -> dict[str, float]:
        """Return the block as values of the term ``missing_block``, so that a model file holds it.

        What the lag window before the movement holds goes to the movement's beginning: a
        simulation cannot answer a movement to come.

        Parameters
        ----------
        mean_angle
            Of the recording [rad].
        """
        values = {
            "size": 1.0,
            "input": float(TERM_INPUTS.index(self.input)),
            "xc": mean_angle,
        }
        levels = list(self.levels)
        curve = list(self.curve[1])
        while len(levels) < TERM_LEVELS:
            # The curve stays at its end beyond its last level.
            levels.append(levels[-1] + abs(levels[-1]) + 1.0)
            curve.append(curve[-1])
        for k, (level, output) in enumerate(zip(levels, curve, strict=True), start=1):
            values |= {f"u{k}": float(level), f"f{k}": float(output)}
        heights = np.interp(TERM_LAGS_S, self.lags, self.response[1])
        for k, height in enumerate(heights, start=1):
            values[f"h{k}"] = float(height)
        return values

    def content(self) -> dict[str, Any]:
        """Return plain data for ``verdict.json``."""
        low, middle, high = (row.tolist() for row in self.response)
        bottom, curve, top = (row.tolist() for row in self.curve)
        return {
            "input": f"{self.input}[{self.unit}]",
            "share_predicted": self.share,
            "share_by_input": self.shares,
            "dynamics": {
                "lag[s]": self.lags.tolist(),
                "response[N.m/s]": middle,
                "low[N.m/s]": low,
                "high[N.m/s]": high,
            },
            "static_curve": {
                f"input[{self.unit}]": self.levels.tolist(),
                "output[1]": curve,
                "low[1]": bottom,
                "high[1]": top,
            },
            "peak_torque[N.m]": self.peak.torque,
            "peak_time[s]": self.peak.time,
            "direction": self.peak.direction,
            "sentence": self.sentence,
        }


def missing_block(fitter: Fitter, fit: Fit, onsets: Onsets, seed: int = 0) -> MissingBlock | None:
    """Return the block that best predicts the whitened residual of a fit; None for a recording of
    less than six stretches.

    Parameters
    ----------
    fitter
        Whose whitening and motion apply.
    fit
        Whose residual is to be described.
    onsets
        Of the recording's movements, for the size of the torque.
    seed
        Of the bootstrap.
    """
    stretches = _stretches(fitter)
    if len(stretches) < _LEAST_STRETCHES:
        return None
    rows = fitter.rows
    inside = np.concatenate(stretches)
    basis = orthonormal(fitter.derivatives(fit)[0][inside])
    residual = np.zeros(rows.count)
    residual[inside] = fit.residual[inside] - basis @ (basis.T @ fit.residual[inside])
    found: dict[str, tuple[float, np.ndarray, np.ndarray, Products]] = {}
    for name, (_, signal_of) in INPUTS.items():
        signal = signal_of(fitter.columns.motion)
        levels = _levels(signal)
        spectra = _spectra(fitter, signal, levels)
        if not spectra:
            # Too few different values for a curve.
            continue
        columns = np.zeros((rows.count, len(spectra)))
        whitened = np.column_stack([rows.whitened(s) for s in spectra])[inside]
        columns[inside] = whitened - basis @ (basis.T @ whitened)
        scale = np.sqrt(np.mean(columns[inside] ** 2, axis=0)) + 1e-30
        products = Products(columns / scale, residual, stretches)
        found[name] = (predicted_share(products, len(levels) - 1), levels, scale, products)
    if not found:
        return None
    shares = {name: entry[0] for name, entry in found.items()}
    name = _simplest(shares)
    return _describe(
        fitter,
        name,
        shares,
        found[name][1],
        found[name][2],
        found[name][3],
        onsets,
        np.random.default_rng(seed),
    )


def _describe(
    fitter: Fitter,
    name: str,
    shares: dict[str, float],
    levels: np.ndarray,
    scale: np.ndarray,
    products: Products,
    onsets: Onsets,
    random: np.random.Generator,
) -> MissingBlock:
    hinges = len(levels) - 1
    everything = np.arange(len(products.power))
    ridge = tuned_ridge(products, everything, hinges)
    weights = rank_one(products, everything, hinges, ridge) / scale
    count = len(everything)
    drawn = [
        rank_one(products, random.integers(0, count, count), hinges, ridge) / scale
        for _ in range(_RESAMPLINGS)
    ]
    zero = int(np.argmin(np.abs(levels)))
    pairs = [_factors(w, hinges, zero) for w in [weights, *drawn]]
    response, curve = pairs[0]
    # Only the product of the factors is determined: each resample's curve gets the size and sign of
    # the first.
    ratios = [float(b @ curve) / float(curve @ curve) for _, b in pairs[1:]]
    aligned = [
        (a * ratio, b / ratio)
        for (a, b), ratio in zip(pairs[1:], ratios, strict=True)
        if ratio != 0.0
    ]
    bands = [np.percentile([pair[k] for pair in aligned], [2.5, 97.5], axis=0) for k in (0, 1)]
    signal = INPUTS[name][1](fitter.columns.motion)
    torque = fitter.rows.plain(
        np.tensordot(weights, np.stack(_spectra(fitter, signal, levels)), axes=1)
    )
    return MissingBlock(
        name,
        shares[name],
        shares,
        np.array(LAGS_S),
        np.stack([bands[0][0], response, bands[0][1]]),
        levels,
        np.stack([bands[1][0], curve, bands[1][1]]),
        peak_after(fitter.rows.rate, torque, onsets),
    )


def _stretches(fitter: Fitter) -> list[np.ndarray]:
    """Return the rows of each stretch of 5 s without its guard; empty ones left out."""
    rows = fitter.rows
    first, second = interleaved(rows)
    number = (rows.time / STRETCH_S).astype(int)
    found = [np.flatnonzero((first | second) & (number == k)) for k in range(int(number.max()) + 1)]
    return [index for index in found if len(index) > 0.5 * STRETCH_S * rows.rate]


def _levels(signal: np.ndarray) -> np.ndarray:
    """Return the knots of the static curve, zero included, ascending."""
    knots = [0.0]
    for sign in (1.0, -1.0):
        size = sign * signal
        moving = size[size > _REST_SHARE * np.abs(signal).max()]
        if len(moving) > 100:
            knots += [sign * float(q) for q in np.quantile(moving, _KNOTS)]
    return np.array(sorted(knots))


def _spectra(fitter: Fitter, signal: np.ndarray, levels: np.ndarray) -> list[np.ndarray]:
    """Return the spectra of every hinge through every lag window, lags outermost; the hinge at zero
    is left out (f(0) = 0).
    """
    rows = fitter.rows
    zero = int(np.argmin(np.abs(levels)))
    hinges = [
        rows.spectrum(np.interp(signal, levels, unit))
        for k, unit in enumerate(np.eye(len(levels)))
        if k != zero
    ]
    return [window * hinge for window in lag_windows(rows.frequency) for hinge in hinges]


def _simplest(shares: dict[str, float]) -> str:
    """Return input that predicts most; an earlier (one-sided) one when it does nearly as well."""
    best = max(shares.values())
    return next(
        name for name, share in shares.items() if share >= best - _MIN_RICHER_GAIN * abs(best)
    )


def _factors(weights: np.ndarray, hinges: int, zero: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the impulse response [N.m/s] at the lags and curve at all levels, of size 1 and rising
    towards positive input where it acts there.
    """
    u, s, v = np.linalg.svd(weights.reshape(-1, hinges), full_matrices=False)
    top = v[0][int(np.argmax(np.abs(v[0])))]
    if zero < hinges and abs(v[0][-1]) > _ONE_SIDED_RATIO * abs(top):
        top = abs(top) * np.sign(v[0][-1])
    lags = np.array(LAGS_S)
    steps = np.diff(lags)
    # A window of unit area has its peak at 2 / base; its base is that of `lag_windows`.
    base = np.concatenate([[0.01], steps]) + np.concatenate([steps, [0.2]])
    return u[:, 0] * s[0] * top * 2.0 / base, np.insert(v[0] / top, zero, 0.0)
