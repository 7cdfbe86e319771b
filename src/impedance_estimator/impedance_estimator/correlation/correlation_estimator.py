"""The estimators of the paper: one separation, whose filters and differences the algorithms O, C
and CE choose.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import ClassVar

import numpy as np

from ankle_interfaces.errors import QuantityError
from impedance_estimator import digital_filters, standard_errors, validity
from impedance_estimator.correlation import running_products
from impedance_estimator.correlation.differences import backward_difference
from impedance_estimator.correlation.reflex_response import decimation, lags
from impedance_estimator.correlation.separation import ESTIMATES, advance
from impedance_estimator.correlation.state import INPUTS, VAF_MOMENTS, Plan, State
from impedance_estimator.digital_filters import filter_state, weight_energy
from impedance_estimator.estimator import ESTIMATE_COLUMNS, Estimator
from impedance_estimator.settings import EstimatorSettings, Settings

LOWPASS_ORDER = 4
"""The filter on all inputs has this order; the paper gives its cut-off only. Two differentiations
raise white position noise by 12 dB an octave. A second-order filter just cancels that, and the
acceleration's noise, so the estimate of I, depends on the sampling rate (0.0100 at 1000 Hz, 0.0131
at 2048 Hz on a real trial); with fourth order the two agree within 1 %. Above, nothing more is
gained.
"""
AVERAGE_ORDER = 2
"""The averaging filters have this order; the second came near the paper's table II."""
LOWPASS_SETTLING_PERIODS = 5.0
"""The input low-pass has forgotten its start to 1e-9 after so many periods of its cut-off."""
CHUNK = 8192
"""Samples per compiled call: bounds the buffers, whatever the caller's block."""


class CorrelationEstimator(Estimator):
    """Estimates intrinsic parameters and reflex response from running correlations (van 't Veld et
    al. 2018, section II).

    Attributes
    ----------
    input_lowpass
        Whether all inputs pass the low-pass.
    difference_order
        Order of the backward differences, 1 or 4.
    uses_measured_velocity
        Whether a velocity column is used; otherwise position is differentiated.
    """

    input_lowpass: ClassVar[bool]
    difference_order: ClassVar[int]
    uses_measured_velocity: ClassVar[bool]

    @staticmethod
    @abstractmethod
    def averaging(order: int, cutoff: float, rate: float) -> np.ndarray:
        """Return the averaging low-passes as sections, shape (k, 6), for a cut-off [Hz] at a
        sampling rate [Hz].
        """

    settings: Settings
    settings_type = Settings

    def __init__(
        self, rate: float, measured_velocity: bool, settings: EstimatorSettings | None = None
    ) -> None:
        super().__init__(rate, measured_velocity, settings)
        if not isinstance(self.settings, Settings):
            raise ValueError(
                f"settings of type {type(self.settings).__name__} do not fit algorithm "
                f"'{self.name}'; expected Settings"
            )
        if self.input_lowpass and self.settings.lowpass_cutoff > 0.4 * rate:
            raise QuantityError(
                f"lowpass_cutoff = {self.settings.lowpass_cutoff:g} Hz is refused at {rate:g} Hz; "
                f"allowed: at most {0.4 * rate:g} Hz"
            )
        self._plan = self._make_plan()
        step = self._plan.decimation / rate
        self._lags = lags(self.settings.reflex_first_lag, self.settings.reflex_last_lag, 1.0 / step)
        self._lag_step = step
        self._samples = np.empty((CHUNK, self._columns_used))
        self._rows = np.empty((CHUNK // self._plan.estimate_every + 1, ESTIMATES))
        self._torques = np.empty((CHUNK // self._plan.decimation + 1, 4))
        self._torque_parts: list[np.ndarray] = []
        self._consumed = 0
        self.reset()

    @property
    def _columns_used(self) -> int:
        return 4 if self.measured_velocity and self.uses_measured_velocity else 3

    def _make_plan(self) -> Plan:
        s, rate = self.settings, self.rate
        design = type(self).averaging
        every = decimation(rate)
        slow = rate / every
        average = design(AVERAGE_ORDER, s.intrinsic_average_cutoff, slow)
        reflex_average = design(AVERAGE_ORDER, s.reflex_average_cutoff, slow)
        batch_samples = round(standard_errors.batch_length(s.intrinsic_average_cutoff) * rate)
        settled = s.reflex_last_lag + (
            LOWPASS_SETTLING_PERIODS / s.lowpass_cutoff if self.input_lowpass else 0.0
        )
        return Plan(
            rate=rate,
            measured_velocity=self._columns_used == 4,
            highpassed=5 if s.highpass == "all" else 2,
            lowpass=digital_filters.butterworth_lowpass(LOWPASS_ORDER, s.lowpass_cutoff, rate)
            if self.input_lowpass
            else digital_filters.NO_FILTER,
            difference=backward_difference(self.difference_order, rate),
            highpass=digital_filters.highpass(s.highpass_cutoff, rate),
            average=average,
            reflex_average=reflex_average,
            vaf_average=digital_filters.exponential_average(s.intrinsic_average_cutoff, slow),
            batch_average=digital_filters.exponential_average(
                s.intrinsic_average_cutoff, rate / batch_samples
            ),
            decimation=every,
            first_lag=int(lags(s.reflex_first_lag, s.reflex_last_lag, slow)[0]),
            ridge=s.reflex_ridge,
            operating_point_samples=s.operating_point_time * rate,
            settling_samples=round(s.settling_time * rate),
            pause_samples=math.ceil(settled * rate) + 2 * every,
            memory=1.0 / (2.0 * math.pi * s.intrinsic_average_cutoff),
            estimate_every=max(round(rate / s.estimate_rate), 1),
            batch_samples=batch_samples,
            intrinsic_factor=batch_samples / rate * weight_energy(average, slow),
            reflex_factor=batch_samples / rate * weight_energy(reflex_average, slow),
        )

    def reset(self) -> None:
        p, count = self._plan, len(self._lags)
        products = running_products.PRODUCTS
        moments = standard_errors.MOMENTS
        estimate = np.full(ESTIMATES, np.nan)
        estimate[ESTIMATE_COLUMNS.index("valid[1]")] = 0.0
        self._state = State(
            clock=np.zeros(1, dtype=validity.CLOCK),
            lowpass=filter_state(p.lowpass, INPUTS),
            position_history=np.zeros(len(p.difference)),
            velocity_history=np.zeros(len(p.difference)),
            highpass=filter_state(p.highpass, 5),
            operating_point=np.zeros(2),
            inputs=np.zeros(INPUTS),
            filtered=np.zeros(5),
            signals=np.zeros(running_products.SIGNALS),
            product_sums=np.zeros(products),
            product_filter=filter_state(p.average, products),
            products=np.zeros(products),
            parameters=np.zeros(3),
            inverse=np.zeros((3, 3)),
            sums=np.zeros(3),
            rectified=np.zeros(p.first_lag + count),
            correlation_filter=filter_state(p.reflex_average, 2 * count + 1),
            correlations=np.zeros(2 * count + 1),
            column=np.zeros(count),
            response=np.zeros(count),
            row_sums=np.zeros(count),
            levinson=np.zeros((2, count)),
            vaf_filter=filter_state(p.vaf_average, VAF_MOMENTS),
            vaf_moments=np.zeros(VAF_MOMENTS),
            scores=np.zeros(standard_errors.SCORES + 2),
            batch=np.zeros(standard_errors.SCORES),
            batch_filter=filter_state(p.batch_average, moments),
            score_moments=np.zeros(moments),
            estimate=estimate,
            valid_response=np.full(count, np.nan),
        )
        self._torque_parts = []
        self._consumed = 0

    def process(self, samples: np.ndarray) -> np.ndarray:
        if samples.ndim != 2 or samples.shape[1] != self.sample_columns:
            raise ValueError(
                f"samples of shape {samples.shape} do not fit; expected (n, {self.sample_columns})"
            )
        self._torque_parts = []
        self._consumed = 0
        parts = []
        while self._consumed < len(samples) and not self.rate_lost:
            piece = samples[self._consumed : self._consumed + CHUNK]
            n = len(piece)
            if self._columns_used == samples.shape[1]:
                self._samples[:n] = piece
            else:
                self._samples[:n, :2] = piece[:, :2]
                self._samples[:n, 2] = piece[:, 3]
            used, rows, torques = advance(
                self._plan, self._state, self._samples, n, self._rows, self._torques
            )
            self._consumed += used
            parts.append(self._rows[:rows].copy())
            self._torque_parts.append(self._torques[:torques].copy())
        if len(parts) == 1:
            return parts[0]
        return np.concatenate(parts) if parts else np.empty((0, ESTIMATES))

    @property
    def reason(self) -> str:
        return validity.REASONS[
            int(validity.reason_code(self._state.clock, self._plan.settling_samples))
        ]

    @property
    def reflex_response(self) -> np.ndarray:
        response = self._state.valid_response / self._lag_step
        # The response is a free one as a whole.
        return np.column_stack(
            [self._lags * self._lag_step, response, np.full(len(response), np.nan)]
        )

    @property
    def torques(self) -> np.ndarray:
        if len(self._torque_parts) == 1:
            return self._torque_parts[0]
        return np.concatenate(self._torque_parts) if self._torque_parts else np.empty((0, 4))

    @property
    def rate_lost(self) -> bool:
        return bool(self._state.clock[0]["rate_lost"])

    @property
    def consumed(self) -> int:
        return self._consumed
