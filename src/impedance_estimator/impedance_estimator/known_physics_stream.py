"""Estimates behind corrected samples are completed to those of the whole joint.

`known_physics_run` corrects the samples; here the contribution of the held terms to K and G at the
present operating point, and the errors of the calibration, are added to what the estimator finds.
"""

from __future__ import annotations

import copy

import numpy as np
from numba import njit

from impedance_estimator.estimator import ESTIMATE_COLUMNS, ReflexColumns, SampleLayout
from impedance_estimator.known_physics import KnownPhysics, gains_of
from impedance_estimator.known_physics_run import KnownPhysicsRun
from impedance_estimator.tracked_gains import TrackedGains

OPERATING_POINT_TIME = 10.0
"""Position and torque are averaged over so long [s]: as long as the estimator's memory."""
OPERATING_POINT_STEP = np.array([0.005, 0.5])
"""Position [rad] and torque [N.m] must change by so much for the reflex gain of the held terms to
be stated anew: a gain that follows them changes by some per cent."""
_K, _G, _I, _ERROR_K, _ERROR_G, _VALID, _DOUBT = (
    ESTIMATE_COLUMNS.index(name)
    for name in (
        "K[N.m/rad]",
        "G[N.m.s/rad]",
        "I[kg.m^2]",
        "se_K[N.m/rad]",
        "se_G[N.m.s/rad]",
        "valid[1]",
        "doubt[1]",
    )
)


class KnownPhysicsStream:
    """Corrects samples, and states what the held terms contribute to the estimates.

    Parameters
    ----------
    known, layout
        As for `KnownPhysicsRun`.
    """

    def __init__(self, known: KnownPhysics, layout: SampleLayout) -> None:
        # Its tracked terms change with the estimate.
        self._known = copy.deepcopy(known) if known.tracked else known
        self._layout = layout
        self._columns = (1, 3 if layout.measured_velocity else 2)
        rig = known.rig
        self._zeros = (rig.zero_position, rig.zero_torque) if rig is not None else (0.0, 0.0)
        self._modelled_reflex = layout.reflex is ReflexColumns.TORQUE
        self._run = KnownPhysicsRun(self._known, layout)
        self._calibrated = [dict(entry.values) for entry in known.tracked]
        self._gains = TrackedGains(len(known.tracked), layout.rate) if known.tracked else None
        self._calibrated_gain = known.calibrated_gain
        self._nominal = self._calibrated_gain or 1.0
        self._calibration_errors = known.calibration_errors()
        self._calibration_doubt = known.calibration_doubt
        self._taken_inertia = 0.0 if known.has_straps else known.plate_inertia
        self._decay = float(np.exp(-1.0 / (OPERATING_POINT_TIME * layout.rate)))
        self._means = [np.nan, np.nan]
        self._samples = 0
        self._stiffness, self._gain = 0.0, 0.0
        self._stated: np.ndarray = np.full(2, np.nan)
        self._core_stiffness = np.nan
        self._share = 1.0

    def correct(self, samples: np.ndarray) -> np.ndarray:
        """Correct samples as `KnownPhysicsRun.correct` does; position and torque are averaged on
        the way.
        """
        for k, column in enumerate(self._columns):
            self._means[k] = _running_mean(samples[:, column], self._means[k], self._decay)
        self._samples += len(samples)
        corrected = self._run.correct(samples)
        if self._gains is not None:
            self._track(self._gains, corrected)
        if self._modelled_reflex:
            # Of unit gain: the estimator's own limits are in N.m.s/rad.
            corrected[:, -2:] /= self._nominal
        return corrected

    def _track(self, gains: TrackedGains, corrected: np.ndarray) -> None:
        """Hand on corrected samples, with the tracked terms that were subtracted put back."""
        torque_column = self._columns[1]
        torques = self._run.tracked_torques
        reference = torque_column + 1
        reflex = 0 if self._layout.reflex is ReflexColumns.NONE else 2
        known = corrected.shape[1] - reflex > reference
        gains.add(
            corrected[:, 1:torque_column].T,
            corrected[:, torque_column] + self._sizes @ torques[0, 1:],
            torques[0],
            corrected[:, reference] if known else np.full(len(corrected), np.nan),
            torques[1],
        )

    @property
    def _sizes(self) -> np.ndarray:
        """Return the sizes in force of the tracked terms, in units of the calibrated ones."""
        sizes = []
        for entry, calibrated in zip(self._known.tracked, self._calibrated, strict=True):
            symbol = gains_of(entry, calibrated)[0]
            sizes.append(float(entry.values[symbol]) / float(calibrated[symbol]))
        return np.array(sizes)

    def _use_tracked(self, gains: TrackedGains) -> None:
        gains.update()
        for entry, calibrated, size in zip(
            self._known.tracked, self._calibrated, gains.sizes, strict=True
        ):
            symbols = gains_of(entry, calibrated)
            # Within the range of each value; all of them change in proportion.
            most = min(entry.term.parameter(s).upper / float(calibrated[s]) for s in symbols)
            for symbol in symbols:
                entry.values[symbol] = float(np.clip(size, 0.0, most)) * float(calibrated[symbol])

    def tracked_row(self, time: float) -> np.ndarray:
        """Return the tracked gains with standard errors at a time [s], shape (1 + columns,); NaN
        before there are enough data.
        """
        row = [time]
        if self._gains is not None:
            found = zip(
                self._known.tracked,
                self._calibrated,
                self._gains.sizes,
                self._gains.errors,
                strict=True,
            )
            for entry, calibrated, size, error in found:
                for symbol in gains_of(entry, calibrated):
                    value = float(calibrated[symbol])
                    row += [size * value if np.isfinite(error) else np.nan, error * value]
        return np.array(row)

    def restate(self) -> None:
        """State the contribution of the held terms at the present operating point, and
        let the foot in its straps follow the stiffness, and the tracked terms their gains.
        """
        if self._gains is not None:
            self._use_tracked(self._gains)
        position, torque = (
            mean - zero for mean, zero in zip(self._means, self._zeros, strict=True)
        )
        time = self._samples / self._layout.rate
        if np.isfinite(position + torque):
            self._stiffness = self._known.added_stiffness(position, torque, time)
            moved = np.abs(np.array([position, torque]) - self._stated)
            if not np.all(moved < OPERATING_POINT_STEP):
                # The reflex' area is simulated, which takes a few milliseconds.
                self._gain = self._known.added_gain(position, torque, time)
                self._stated = np.array([position, torque])
        share = self._run.follow(self._core_stiffness)
        if self._layout.reflex is ReflexColumns.NONE:
            # Only then the regression does not know that straps hold back a part of the reflex.
            self._share = share

    def complete(self, rows: np.ndarray) -> np.ndarray:
        """Return estimates of the whole joint: with the held terms, without the plate.

        The standard errors hold those of the calibrated session, too.
        """
        rows = rows.copy()
        if len(rows) and rows[-1, _VALID] > 0.0:
            self._core_stiffness = float(rows[-1, _K])
        G, error_K, error_G, doubt = rows[:, [_G, _ERROR_K, _ERROR_G, _DOUBT]].T
        rows[:, _K] += self._stiffness
        rows[:, _I] -= self._taken_inertia
        calibrated = self._calibrated_gain
        if self._modelled_reflex:
            factor = (calibrated + self._gain) / self._nominal
            G, error_G = G * factor, error_G * factor
        else:
            G, error_G = G / self._share, error_G / self._share
        if calibrated > 0.0 and not self._modelled_reflex:
            # The whole reflex changes in proportion, and its core shows a share of the change.
            slope = (calibrated + self._gain) / (calibrated * self._run.projection)
            G = calibrated + self._gain + slope * (G - calibrated)
            error_G = error_G * abs(slope)
        stiffness_error, gain_error = self._calibration_errors
        rows[:, _G] = G
        rows[:, _ERROR_K] = np.hypot(error_K, stiffness_error)
        rows[:, _ERROR_G] = np.hypot(error_G, gain_error * G)
        # An estimator that does not judge itself goes on saying NaN.
        rows[:, _DOUBT] = np.maximum(doubt, self._calibration_doubt)
        return rows


@njit(cache=True)
def _running_mean(values: np.ndarray, mean: float, decay: float) -> float:
    """Return the exponential mean after the finite ones of further values; the first one is the
    mean of itself.
    """
    for value in values:
        if np.isfinite(value):
            if not np.isfinite(mean):
                mean = value
            mean = (1.0 - decay) * value + decay * mean
    return mean
