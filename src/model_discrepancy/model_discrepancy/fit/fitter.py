"""Fit of a list of terms to a recording by variable projection (Golub & Pereyra 2003, Inverse
Problems 19, R1).

For given nonlinear parameters the linear ones follow from bounded least squares, so that only the
nonlinear ones are searched; physical signs and ranges hold inside the fit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares

from ankle_physics.term import ModelValues, Parameter, term_library
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.coupled_foot import Foot
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.least_squares import RUN_AWAY, bounded, columns_of, runs_away
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.fit.parameter_scale import (
    UNIT_STEP,
    Start,
    absent_parts,
    at_bounds,
    nonlinear,
    ranges,
    searched,
    stretch,
    to_unit,
    with_unit,
)
from model_discrepancy.fit.projection import Projection
from model_discrepancy.fit.recent_results import RecentResults
from model_discrepancy.fit.rows import LOW_PASS_HZ, Rows, selection
from model_discrepancy.fit.signal_path import Column
from model_discrepancy.recording.motion import Motion

Spectra = Mapping[Column, np.ndarray]
# Whitened columns kept: four models of twelve columns each, of two hypotheses that are followed at
# the same time; one takes 0.1 to 0.2 MB.
_CACHE_SIZE = 96
# A model is compared with several candidates in turn, in each of two hypotheses; the derivatives of
# one take 3 MB.
_DERIVATIVES_KEPT = 8
# Evaluations after which a fit is asked whether it may still do what it is for. Its steps shrink
# like a geometric series, by a third and more from stage to stage.
STAGE_EVALUATIONS = 4
STAGES_AHEAD = 2.0
# A foot behind a compliant fixation is found anew after a third of the evaluations, and no fewer
# than these: what a step of the fit leaves of its motion is a tenth.
FOOT_STAGES = 3
LEAST_FOOT_STAGE = 8
# Another such stage follows one that lowered the score by this many times the tolerance.
STAGE_GAIN = 10.0
# The tolerance of a single fit.
_CONVERGED_SHARE = 1e-4
# Of the torque's variance: a quarter of its noise at the paper's SNR (24.1 dB). What changes less
# is below any instrument's own errors. In a loop whose command was recorded, torque that moved the
# plate lets generic regressors predict up to a half of it.
MATERIAL_SHARE = 1e-3


class Fitter:
    """Fits models to one recording.

    Parameters
    ----------
    columns
        Of the recording.
    rows
        With the whitening that is to be used; None for those of the columns.
    held
        Values of terms that are known, by term and symbol, such as a calibrated rig's; they are
        never fitted.
    """

    def __init__(
        self, columns: Columns, rows: Rows | None = None, held: Start | None = None
    ) -> None:
        self.columns = columns
        self.rows = columns.rows if rows is None else rows
        self.held: Start = held or {}
        self.plain_target = self.rows.plain(columns.target)
        self._refresh()

    @classmethod
    def of(cls, motion: Motion, limit: float = LOW_PASS_HZ, held: Start | None = None) -> Fitter:
        """Build the problem of one recording: its columns and rows up to a limit [Hz], not
        whitened.
        """
        return cls(Columns(motion, Rows(len(motion.position), motion.rate, limit)), held=held)

    def unwhitened(self) -> Fitter:
        """Return a fitter of this problem that minimises the plain error."""
        return Fitter(self.columns, self.rows.unwhitened(), self.held)

    def along(self, motion: Motion) -> Fitter:
        """Return a fitter with this problem and whitening for another movement of that length."""
        return Fitter(Columns(motion, self.rows), held=self.held)

    def holding(self, held: Start) -> Fitter:
        """Return a fitter of this problem that holds these terms too."""
        return Fitter(self.columns, self.rows, {**self.held, **held})

    def searched(self, names: Sequence[str]) -> list[tuple[str, Parameter]]:
        """Return the parameters of these terms that a fit searches for and that are not held."""
        return [(name, p) for name, p in searched(names) if name not in self.held]

    @property
    def motion(self) -> Motion:
        """Return the motion that drives the model."""
        return self.columns.motion

    def whiten_by(self, noise: np.ndarray) -> None:
        """Whiten by these plain rows [N.m], shape (rows.count,), from now on."""
        self.rows.whiten_by(noise)
        self._refresh()

    def _refresh(self) -> None:
        self.target = self.rows.whitened(self.columns.target)
        # Each with what it was made of, so that no other object takes over its identity.
        self._whitened: RecentResults[tuple[np.ndarray, np.ndarray]] = RecentResults(_CACHE_SIZE)
        self._derivatives: RecentResults[tuple[Fit, np.ndarray, list[Column]]] = RecentResults(
            _DERIVATIVES_KEPT
        )

    def whitened(self, spectra: Iterable[np.ndarray]) -> np.ndarray:
        """Return the whitened rows of these spectra, shape (count, size); remembered as long as
        `Columns` gives out the same spectra.
        """
        return columns_of([self._whitened_rows(spectrum) for spectrum in spectra])

    def _whitened_rows(self, spectrum: np.ndarray) -> np.ndarray:
        known = self._whitened.of(id(spectrum), lambda: (spectrum, self.rows.whitened(spectrum)))
        return known[1]

    def start_values(self, names: Sequence[str], start: Start | None = None) -> ModelValues:
        """Return the typical values of these terms, conventions set, overridden by `start` where it
        has the term.
        """
        values = {}
        for name in names:
            values[name] = {
                p.symbol: p.default for p in term_library()[name].parameters
            } | self.columns.convention(name)
            for given in (start or {}, self.held):
                values[name] |= given.get(name, {})
        return values

    # A foot that runs away in a trial step gives an infinite residual, and the step is taken back.
    @np.errstate(over="ignore", invalid="ignore")
    def fit(
        self,
        names: Sequence[str],
        start: Start | None = None,
        mask: np.ndarray | None = None,
        evaluations: int = 40,
        tolerance: float = 1e-4,
    ) -> Fit:
        """Fit these terms from one start.

        Parameters
        ----------
        names
            Terms.
        start
            Values to begin with, by term.
        mask
            Rows to fit, bool, shape (rows.count,); None for all that are usable.
        evaluations
            Of the residual at most.
        tolerance
            Relative change of the sum of squares at which it ends; ten times as much in the scaled
            parameters.
        """
        fitted = self.rows.fitted if mask is None else selection(mask & self.rows.used)
        values = self.start_values(names, start)
        if not self.searched(names):
            return self.solve(values, fitted)
        foot = self.columns.foot(values)
        if foot is None:
            problem = Projection(self, values, self.searched(names), fitted)
            return self._found(problem, evaluations, tolerance)
        each = max(LEAST_FOOT_STAGE, math.ceil(evaluations / FOOT_STAGES))
        problem = Projection(self, values, self.searched(names), fitted, foot)
        best = problem.fit_at(problem.first)
        for done in range(0, evaluations, each):
            values = self._found(problem, min(each, evaluations - done), tolerance).values
            foot = self.columns.foot(values)
            found = self.solve(values, fitted, foot)
            before, best = best.score, min(best, found, key=lambda fit: fit.score)
            if not found.score < (1.0 - STAGE_GAIN * tolerance) * before:
                break
            problem.beside(foot, found)
        return best

    def _found(self, problem: Projection, evaluations: int, tolerance: float) -> Fit:
        """Return the fit that least squares find from where the problem begins."""
        first = problem.first
        if not np.isfinite(problem.residual(first)).all():
            return problem.fit_at(first)
        problem.allow(evaluations)
        found = least_squares(
            problem.short_residual,
            first,
            jac=problem.short_jacobian,
            bounds=(0.0, 1.0),
            x_scale=1.0,
            max_nfev=evaluations,
            ftol=tolerance,
            xtol=10.0 * tolerance,
        )
        return problem.fit_at(found.x)

    def fit_below(
        self,
        names: Sequence[str],
        start: Start,
        limit: float,
        evaluations: int,
    ) -> Fit:
        """Fit these terms as long as their score may still come below a limit.

        Parameters
        ----------
        names, start, evaluations
            As `fit` takes them.
        limit
            Of the score. The fit ends early where two more stages of `STAGE_EVALUATIONS`
            evaluations, each of which lowers the score as much as the last one did, would not
            reach it.
        """
        last = self.solve(self.start_values(names, start)).score
        fit = self.fit(names, start, evaluations=STAGE_EVALUATIONS)
        for _ in range(STAGE_EVALUATIONS, evaluations, STAGE_EVALUATIONS):
            fell = last - fit.score
            if fell < _CONVERGED_SHARE * fit.score or fit.score - STAGES_AHEAD * fell > limit:
                break
            last = fit.score
            fit = self.fit(names, fit.values, evaluations=STAGE_EVALUATIONS)
        return fit

    def solve(
        self,
        values: Start,
        fitted: slice | np.ndarray | None = None,
        foot: Foot | None = None,
    ) -> Fit:
        """Return the fit with these values of what is searched for; only the other, linear
        parameters are solved for, on these rows (a slice or a mask; None for `Rows.fitted`), beside
        a foot that is held (None: as it moves with these values). The score is infinite where the
        model runs away.
        """
        fitted = self.rows.fitted if fitted is None else fitted
        foot = foot or self.columns.foot(values)
        spectra = self.columns.spectra(values, foot)
        order = list(spectra)
        matrix = self.whitened(spectra.values())
        if runs_away(matrix):
            return self._run_away(values)
        amplitudes = np.array([float(values[name][symbol]) for name, symbol in order])
        given = {(name, p.symbol) for name, p in self.searched(list(values))}
        given |= {column for column in order if column[0] in self.held}
        open_ = np.array([column not in given for column in order])
        torque, target = self.columns.target, self.target
        offset = self.columns.offset(values, foot)
        if offset is not None:
            torque, target = torque - offset, target - self.rows.whitened(offset)
            if runs_away(target):
                return self._run_away(values)
        rest = target - matrix[:, ~open_] @ amplitudes[~open_]
        amplitudes[open_] = bounded(
            matrix[fitted][:, open_], rest[fitted], *ranges(c for c in order if c not in given)
        )
        residual = target - matrix @ amplitudes
        left = torque - sum(a * spectra[c] for a, c in zip(amplitudes, order, strict=True))
        filled = {name: dict(given) for name, given in values.items()}
        for amplitude, (name, symbol) in zip(amplitudes, order, strict=True):
            filled[name][symbol] = float(amplitude)
        size = len(nonlinear(list(values))) + len(order)
        return Fit(
            filled,
            residual,
            left,
            self.rows,
            float(residual[fitted] @ residual[fitted]),
            size,
            at_bounds=at_bounds(filled),
            absent=absent_parts(filled),
        )

    def _run_away(self, values: Start) -> Fit:
        """Return a fit that explains nothing and is worse than any other one."""
        filled = {name: dict(given) for name, given in values.items()}
        rows, target = self.rows, self.columns.target
        return Fit(filled, np.full(rows.count, np.inf), target, rows, np.inf, len(filled))

    def evaluate(self, values: Start) -> Fit:
        """Evaluate the model with these values, linear ones too, without fitting anything."""
        left = self.columns.target - self.columns.torque(values)
        residual, used = self.rows.whitened(left), self.rows.used
        return Fit(
            {n: dict(v) for n, v in values.items()},
            residual,
            left,
            self.rows,
            float(residual[used] @ residual[used]),
            0,
        )

    def derivatives(self, fit: Fit, plain: bool = False) -> tuple[np.ndarray, list[Column]]:
        """Return the columns and derivatives by the nonlinear parameters per unit of the scaled
        range, shape (count, size), whitened or plain; those of the last few fits are remembered.
        """
        known = self._derivatives.of(
            (id(fit), plain), lambda: (fit, *self._differentiated(fit, plain))
        )
        return known[1], known[2]

    def _differentiated(self, fit: Fit, plain: bool) -> tuple[np.ndarray, list[Column]]:
        spectra = self.columns.spectra(fit.values)
        amplitudes = {(n, symbol): fit.values[n][symbol] for n, symbol in spectra}
        found = {
            c: self.rows.plain(s) if plain else self.whitened([s])[:, 0]
            for c, s in spectra.items()
            if c[0] not in self.held
        }
        searched = self.searched(fit.terms)
        slopes = in_parallel(
            lambda one: self.slope(fit.values, *one, amplitudes, spectra, plain), searched
        )
        for (name, parameter), slope in zip(searched, slopes, strict=True):
            found[name, parameter.symbol] = (
                slope / stretch(parameter, fit.values[name][parameter.symbol])
                if parameter.linear
                else slope
            )
        return columns_of(list(found.values())), list(found)

    def slope(
        self,
        values: Start,
        name: str,
        parameter: Parameter,
        amplitudes: Mapping[Column, float],
        here: Spectra,
        plain: bool = False,
        foot: Foot | None = None,
    ) -> np.ndarray:
        """Return the derivative of the model torque, whitened or plain, by a searched parameter per
        unit of its scaled range, shape (count,).

        One-sided difference.

        Parameters
        ----------
        values
            Where to differentiate.
        name, parameter
            By what.
        amplitudes
            Of the columns.
        here
            The columns at `values`.
        plain
            Not whitened.
        foot
            Behind a compliant fixation, held; None: as it moves with `values`.
        """
        unit = to_unit(parameter, values[name][parameter.symbol])
        step = UNIT_STEP if unit + UNIT_STEP <= 1.0 else -UNIT_STEP
        moved = with_unit(values, name, parameter, unit + step)
        change = self.columns.change(values, moved, amplitudes, foot)
        if parameter.linear:
            grown = moved[name][parameter.symbol] - amplitudes[name, parameter.symbol]
            own = grown * here[name, parameter.symbol]
            change = own if change is None else change + own
        still = np.zeros(self.rows.count)
        # Beside a place where the model runs away, the difference tells nothing.
        if change is None or not np.abs(change).max() < RUN_AWAY * self.rows.count:
            return still
        rows = self.rows.plain if plain else self.rows.whitened
        return rows(change) / step
