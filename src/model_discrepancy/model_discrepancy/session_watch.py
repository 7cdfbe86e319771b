"""Does the base model fit as well as at the start of the session? For the node; no ROS.

Each window of samples is fitted with the paper's model; its VAF and the share of the whitened
residual that the generic bank still predicts are compared with those of the session's first window.
Where they got worse, the library's terms are screened on the window, and the best one tells the
place.
"""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass

import numpy as np

from ankle_interfaces.continuity import sampling_rate
from model_discrepancy.criticism.remainder import remainder
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.held_out import vaf
from model_discrepancy.problem import prepare
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.recording_checks import faults
from model_discrepancy.search.found import place_of
from model_discrepancy.search.screening import candidates, grid, screen


class RecentSamples:
    """Keeps the last seconds of the stream; one thread adds, another takes copies.

    Parameters
    ----------
    window
        Length that is kept [s].
    """

    def __init__(self, window: float) -> None:
        self.window = window
        self._blocks: deque[np.ndarray] = deque()
        self._lock = threading.Lock()

    def add(self, samples: np.ndarray) -> None:
        """Append samples: time [s], position, torque and, where measured, velocity, shape (n, 3 or
        4).
        """
        with self._lock:
            if self._blocks and self._blocks[-1].shape[1] != samples.shape[1]:
                self._blocks.clear()
            self._blocks.append(samples)
            while self._blocks[0][-1, 0] < samples[-1, 0] - self.window:
                self._blocks.popleft()

    def clear(self) -> None:
        """Forget everything, after a gap that no filter can bridge."""
        with self._lock:
            self._blocks.clear()

    def snapshot(self) -> np.ndarray | None:
        """Return the last window, shape (n, 3 or 4); None until it is full."""
        with self._lock:
            if not self._blocks:
                return None
            samples = np.concatenate(self._blocks)
        inside = samples[samples[:, 0] > samples[-1, 0] - self.window]
        spacing = (inside[-1, 0] - inside[0, 0]) / max(len(inside) - 1, 1)
        return inside if inside[-1, 0] - inside[0, 0] > self.window - 2.5 * spacing else None


@dataclass(frozen=True)
class Indicators:
    """Describes how well the base model fits one window.

    Attributes
    ----------
    time
        Of the window's last sample [s].
    vaf
        Of the base model on the window [%].
    share
        Of the whitened residual that generic regressors predict on unseen rows, 0...1.
    faults
        Why the window cannot be judged; the numbers are then NaN.
    """

    time: float
    vaf: float
    share: float
    faults: tuple[str, ...] = ()


class SessionWatch:
    """Judges window after window against the first one.

    Attributes
    ----------
    reference
        Indicators of the first window that could be judged; None before.
    """

    def __init__(self) -> None:
        self.reference: Indicators | None = None
        self._fitter: Fitter | None = None

    def judge(self, samples: np.ndarray) -> Indicators:
        """Fit one window; the first that can be judged becomes the reference.

        Parameters
        ----------
        samples
            Time [s], position [rad], torque [N.m] and, where measured, velocity [rad/s], shape (n,
            3 or 4).
        """
        rate = sampling_rate(samples[:, 0])
        # Lost blocks are short here and reported by the node; a straight line bridges them.
        grid = np.arange(samples[0, 0], samples[-1, 0] + 0.25 / rate, 1.0 / rate)
        columns = [np.interp(grid, samples[:, 0], column) for column in samples.T[1:]]
        recording = Recording(
            rate,
            columns[0],
            columns[1],
            columns[2] if len(columns) > 2 else None,
            start=float(grid[0]),
        )
        time = float(samples[-1, 0])
        found = tuple(faults(recording))
        if found:
            return Indicators(time, float("nan"), float("nan"), found)
        problem = prepare(recording)
        fitter, base = problem.fitter, problem.base
        used = fitter.rows.used
        left = remainder(problem.bank, fitter, base.residual, base.plain, problem.parts)
        indicators = Indicators(
            time, vaf(fitter.plain_target[used], base.plain[used]), max(left.share, 0.0)
        )
        self._fitter, self._base = fitter, base
        if self.reference is None:
            self.reference = indicators
        return indicators

    def complaint(self, now: Indicators, vaf_fall: float, share_rise: float) -> str | None:
        """Return what got worse since the reference, in one sentence; None for nothing.

        Parameters
        ----------
        now
            Of the window judged last.
        vaf_fall
            [%] that is tolerated.
        share_rise
            That is tolerated, 0...1.
        """
        if now.faults:
            return f"the last samples cannot be judged: {now.faults[0]}"
        then = self.reference
        assert then is not None
        worse = []
        if now.vaf < then.vaf - vaf_fall:
            worse.append(
                f"the base model explains {now.vaf:.1f} % of the torque, {then.vaf:.1f} % at the "
                "start"
            )
        if now.share > then.share + share_rise:
            worse.append(
                f"{100 * now.share:.0f} % of its residual follows the movement, "
                f"{100 * then.share:.0f} % at the start"
            )
        return "; ".join([*worse, self._likely_place()]) if worse else None

    def _likely_place(self) -> str:
        """Return the place of the terms that would explain most of the last window's residual."""
        assert self._fitter is not None
        rows = self._fitter.rows
        points = {name: grid(name, rows.count / rows.rate) for name in candidates(self._base)}
        found = screen(self._fitter, self._base, points)
        best = found[0]
        # Terms of several places that promise nearly the same cannot be told apart without a
        # diagnosis.
        places = list(
            dict.fromkeys(place_of(s.name).value for s in found[:4] if s.share > 0.9 * best.share)
        )
        return (
            f"likely place: {' or '.join(places)} ({best.name.replace('_', ' ')} would explain "
            f"{100 * best.share:.0f} % of the "
            "residual); check straps and cables, and diagnose the recording"
        )
