"""The simultaneous estimator: intrinsic and reflex parameters in one regression, with voluntary
torque as coloured noise.
"""

from __future__ import annotations

import math

import numpy as np

from impedance_estimator import validity
from impedance_estimator.estimator import (
    ESTIMATE_COLUMNS,
    Estimator,
    Expectation,
    ReflexColumns,
)
from impedance_estimator.settings import EstimatorSettings
from impedance_estimator.simultaneous import doubt, nuisance, reflex_shapes, voluntary_torque_noise
from impedance_estimator.simultaneous.block_update import INITIAL_DEVIATIONS
from impedance_estimator.simultaneous.change_detection import (
    LONGEST_SHORT_WINDOW,
    candidate_windows,
)
from impedance_estimator.simultaneous.gaussian_derivatives import gaussian_derivatives
from impedance_estimator.simultaneous.memory_length import PREDICTION_TIME, memory_lengths
from impedance_estimator.simultaneous.noise_model_choice import BATCH_DURATION
from impedance_estimator.simultaneous.reflex_deviation import reflex_deviation
from impedance_estimator.simultaneous.regression import GAINS, INTRINSIC, PARAMETERS
from impedance_estimator.simultaneous.sample_loop import ESTIMATES, advance
from impedance_estimator.simultaneous.settings import SimultaneousSettings
from impedance_estimator.simultaneous.state import COUNTERS, Nuisance, Plan, State

SMOOTHING = 0.0015
"""[s] Standard deviation of the kernel: -3 dB at 88 Hz, well above the perturbation's 30-40 Hz.
Wide enough that noise of acceleration stays below 0.1 % of it in power, narrow enough that the
residual is nearly white at 256 Hz."""
SMOOTHING_WITHOUT_VELOCITY = 0.0025
"""[s] Where acceleration is the second derivative of position, whose noise grows with the fourth
power of frequency.
"""
DECIMATED_RATE = 256.0
"""Signals are decimated to three times the bandwidth of the kernel [Hz]."""
BLOCK = 1.0 / 16.0
"""[s] Resolution of the memory and time between estimates: a twentieth of the rise time that is
asked for.
"""
CHUNK = 8192
"""Samples per compiled call: bounds the buffers, whatever the caller's block."""


class Simultaneous(Estimator):
    """Estimates by generalised least squares over an adaptive memory (``docs/estimators.md``)."""

    name = "simultaneous"
    title = (
        "intrinsic and reflex part in one regression, voluntary torque as coloured noise, memory "
        "that restarts with changes"
    )
    settings_type = SimultaneousSettings
    uses_reference = True

    def __init__(
        self, rate: float, measured_velocity: bool, settings: EstimatorSettings | None = None
    ) -> None:
        super().__init__(rate, measured_velocity, settings)
        if not isinstance(self.settings, SimultaneousSettings):
            raise ValueError(
                f"settings of type {type(self.settings).__name__} do not fit algorithm "
                "'simultaneous'; expected SimultaneousSettings"
            )
        self._simultaneous_settings = self.settings
        self._torque_parts: list[np.ndarray] = []
        self._consumed = 0
        self._initial = np.array(
            [
                [*np.zeros(GAINS), *reflex_shapes.PRIOR_MEAN],
                [*INITIAL_DEVIATIONS, *reflex_shapes.PRIOR_DEVIATION],
            ]
        )
        self._prepare()

    def _prepare(self) -> None:
        """Make plan, buffers and a state at rest."""
        self._plan = self._make_plan(self._simultaneous_settings)
        self._samples = np.empty((CHUNK, self.sample_columns))
        self._rows = np.empty((CHUNK // self._plan.estimate_every + 1, ESTIMATES))
        self._torques = np.empty((CHUNK // self._plan.decimation + 1, 4))
        self.reset()

    def expect(self, expectation: Expectation) -> None:
        known = np.isfinite(expectation.deviation)
        self._initial[0, known] = expectation.mean[known]
        self._initial[1] = np.minimum(self._initial[1], expectation.deviation)
        self._initial[0, GAINS:] = np.clip(
            self._initial[0, GAINS:], reflex_shapes.LOWEST_SHAPE, reflex_shapes.HIGHEST_SHAPE
        )
        self.reflex_columns = expectation.reflex
        self._prepare()

    def _make_plan(self, s: SimultaneousSettings) -> Plan:
        rate = self.rate
        # 0.8 samples: the least for which the sampled derivatives are exact.
        kernels = gaussian_derivatives(
            max(SMOOTHING if self.measured_velocity else SMOOTHING_WITHOUT_VELOCITY, 0.8 / rate),
            rate,
        )
        every = max(round(rate / DECIMATED_RATE), 1)
        slow = rate / every
        count = round(s.basis_functions)
        functions = reflex_shapes.basis(1.0 / slow, count)
        modelled_reflex = self.reflex_columns is ReflexColumns.TORQUE
        if modelled_reflex:
            lags = np.arange(functions.shape[1]) / slow
            functions = reflex_shapes.shape(self._initial[0, GAINS:], lags)[None]
        whitening = voluntary_torque_noise.whitening_filters(slow)
        block_samples = round(BLOCK * slow)
        lengths = memory_lengths(s.memory, block_samples / slow, s.change_detection == "on")
        windows = (
            candidate_windows(int(lengths[0]))
            if s.change_detection == "on"
            else np.zeros(0, dtype=np.int64)
        )
        # After half the length of the basis 98 % of every reflex has come.
        settled = reflex_shapes.LENGTH / 2.0 + kernels.shape[1] / rate
        return Plan(
            rate=rate,
            measured_velocity=self.measured_velocity,
            modelled_reflex=modelled_reflex,
            given_stretch=self.reflex_columns is ReflexColumns.STRETCH,
            kernels=kernels,
            rest_velocity=s.rest_velocity,
            decimation=every,
            functions=np.ascontiguousarray(functions.T) / slow,
            basis=functions,
            lags=np.arange(functions.shape[1]) / slow,
            area=functions.sum(axis=1) / slow,
            whitening=whitening,
            sections=voluntary_torque_noise.needed_sections(),
            passband=1.0 / voluntary_torque_noise.passband_gain(whitening[0]),
            block_samples=block_samples,
            memory_blocks=int(lengths[0]),
            lengths=lengths,
            horizon=round(PREDICTION_TIME * slow / block_samples),
            windows=windows,
            short_windows=int(np.sum(windows <= LONGEST_SHORT_WINDOW)),
            threshold=s.change_threshold,
            second=round(slow / block_samples),
            settling_samples=round(s.settling_time * rate),
            pause_samples=math.ceil(settled * rate),
            memory=s.memory,
            estimate_every=max(round(rate / s.estimate_rate), 1),
        )

    def reset(self) -> None:
        p = self._plan
        count, lags = p.basis.shape
        size = count + 4
        motion = count + INTRINSIC + nuisance.EXTRAS
        kept = nuisance.packed_size(motion)
        memories = len(p.lengths) + 1
        models = len(p.whitening)
        capacity = max(p.memory_blocks + memories, BATCH_DURATION * p.second) + 1
        n = p.kernels.shape[1] // 2
        estimate = np.full(ESTIMATES, np.nan)
        estimate[ESTIMATE_COLUMNS.index("valid[1]")] = 0.0
        estimate[ESTIMATE_COLUMNS.index("doubt[1]")] = 0.0
        self._state = State(
            clock=np.zeros(1, dtype=validity.CLOCK),
            counters=np.zeros(1, dtype=COUNTERS),
            nuisance=Nuisance(
                gamma=np.zeros((motion, size)),
                combine=np.eye(size, motion),
                unknowns=np.zeros((PARAMETERS + 1, motion)),
                coefficients=np.zeros(motion),
            ),
            raw=np.zeros((6, 2 * (3 * n + 1))),
            rectified=np.zeros((2, 2 * (2 * n + 1))),
            slow_rectified=np.zeros((2, 2 * lags)),
            stretches=np.zeros((capacity, 2)),
            stretch=np.zeros(2),
            muscle=np.zeros(lags),
            actuator=np.zeros(2),
            slow_states=np.zeros((2, 3)),
            past=np.zeros((2 * nuisance.TAP_REACH + 1, 2, motion - nuisance.TAPS + 1)),
            signals=np.zeros(2 * motion + 1),
            whitened=np.zeros(2 * motion + 1),
            filters=np.zeros((models, 2, voluntary_torque_noise.SECTIONS, 2 * motion + 1)),
            block=np.zeros((models, p.block_samples, 2 * motion + 1)),
            ring=np.zeros((models, capacity, kept)),
            totals=np.zeros((models, kept)),
            eta=np.zeros((3, reflex_shapes.SHAPES)),
            tangent=np.zeros((count, 1 + reflex_shapes.SHAPES)),
            initial=self._initial,
            prior=np.zeros((2, 4)),
            solution=np.zeros(PARAMETERS),
            covariance=np.zeros((PARAMETERS, PARAMETERS)),
            output=np.zeros((2, GAINS)),
            held=np.zeros(GAINS),
            response=np.zeros(count),
            compared=np.zeros((models, 2, GAINS)),
            model_error=np.zeros(GAINS),
            predictors=np.zeros((memories, motion)),
            predicted=np.zeros(memories),
            scatter=np.ones((models, GAINS)),
            signs=np.zeros(len(doubt.SIGNS)),
            estimate=estimate,
            valid_response=np.full(count, np.nan),
            shape_work=np.zeros((2, lags)),
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
            self._samples[: len(piece)] = piece
            used, rows, torques = advance(
                self._plan, self._state, self._samples, len(piece), self._rows, self._torques
            )
            parts.append(self._rows[:rows].copy())
            self._torque_parts.append(self._torques[:torques].copy())
            self._consumed += used
        if len(parts) == 1:
            return parts[0]
        return np.concatenate(parts) if parts else np.empty((0, ESTIMATES))

    @property
    def reason(self) -> str:
        return validity.REASONS[
            int(validity.reason_code(self._state.clock, self._plan.settling_samples))
        ]

    @property
    def doubts(self) -> str:
        return doubt.reasons(self._state.signs)

    @property
    def instrument(self) -> str:
        if self._state.counters[0]["referenced"]:
            return "the reference is the instrument: torque that moves the plate does not bias"
        return (
            "no reference: the measured motion is taken as it is, which biases K and G where the "
            "servo gives way"
        )

    @property
    def reflex_response(self) -> np.ndarray:
        return np.column_stack(
            [
                self._plan.lags,
                self._state.valid_response @ self._plan.basis,
                reflex_deviation(self._plan, self._state).coordinates @ self._plan.basis,
            ]
        )

    @property
    def reflex_deviation(self) -> tuple[float, float]:
        found = reflex_deviation(self._plan, self._state)
        return found.area, found.standard_error

    @property
    def torques(self) -> np.ndarray:
        return np.concatenate(self._torque_parts) if self._torque_parts else np.empty((0, 4))

    @property
    def rate_lost(self) -> bool:
        return bool(self._state.clock[0]["rate_lost"])

    @property
    def consumed(self) -> int:
        return self._consumed
