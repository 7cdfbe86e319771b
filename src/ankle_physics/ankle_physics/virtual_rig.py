"""A rig and a subject in software: perturbation in, samples out, and what was true meanwhile.

Signal path: reference -> actuator (`actuator`) -> joint model (`model`), scripted parameters
(`scenario`) -> anti-alias filter, sampling, noise (`sensors`). Actuator and joint run at the
internal rate, a whole multiple of the sampling rate.

`VirtualRig` works block by block, `simulate` on a whole reference; both give the same samples.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ankle_physics.actuator import Actuator, Servo
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import Noise, Sampler, SignalToNoise
from ankle_physics.servo_loop import ServoLoop
from ankle_physics.signals import Signals

LOWEST_RATE, HIGHEST_RATE = 500.0, 10_000.0  # Hz
# Reference samples that `simulate` takes at once: few calls, and internal signals (128 kB each)
# that stay in the processor's cache.
STRETCH = 4096


@dataclass(frozen=True)
class Samples:
    """Holds the samples that a stretch of n reference samples gave.

    Attributes
    ----------
    clean
        Position [rad], velocity [rad/s], torque [N.m] behind the anti-alias filter, without noise,
        shape (n, 3).
    truth
        Value of each linear parameter at the sample times, keyed ``stiffness.K[N.m/rad]``, each of
        shape (n,).
    parts
        Torque [N.m] of each term at the sample times, before the anti-alias filter, by term name,
        each of shape (n,).
    """

    clean: np.ndarray
    truth: dict[str, np.ndarray]
    parts: dict[str, np.ndarray]


class VirtualRig:
    """Runs rig and subject stretch by stretch; the stretches' size does not change the result.

    Parameters
    ----------
    model
        The joint; copied, so that a run does not change it. None: the paper's.
    rate
        Of reference and samples [Hz].
    servo
        Of the actuator; None: 30 Hz.
    scenario
        Changes of parameters; its time starts with the first sample.
    seed
        Of every random term.

    Raises
    ------
    ModelError
        Rate out of range, or a scenario that the model cannot follow.
    """

    def __init__(
        self,
        model: Model | None = None,
        rate: float = 2048.0,
        servo: Servo | None = None,
        scenario: Scenario | None = None,
        seed: int = 0,
    ) -> None:
        if not LOWEST_RATE <= rate <= HIGHEST_RATE:
            raise ModelError(
                f"sampling rate {rate:g} Hz is outside {LOWEST_RATE:g} to {HIGHEST_RATE:g} Hz"
            )
        self.model = copy.deepcopy(model or Model.of())
        self.rate = rate
        self.scenario = scenario or Scenario([])
        self.scenario.require(self.model)
        self._before = {
            track.key: float(self.model.entry(track.term).values[track.parameter.symbol])
            for track in self.scenario.tracks
        }
        self._actuator = Actuator(servo or Servo(), rate)
        self._factor = self._actuator.factor
        self._run = self.model.start(rate * self._factor, seed)
        self._loop: ServoLoop | None = None
        if self.model.has("servo_compliance"):
            stiffness = float(self.model.entry("servo_compliance").values["k_a"])
            self._loop = ServoLoop(
                self._actuator.servo,
                stiffness,
                rate * self._factor,
                self._run,
                self.model.entries,
            )
        self._sampler = Sampler(rate, self._factor)
        self._count = 0

    def set(self, term: str, symbol: str, value: float) -> None:
        """Change a parameter from the next stretch on.

        Raises
        ------
        ModelError
            No such term or parameter, value out of range, or the scenario determines it.
        """
        entry = self.model.entry(term)
        parameter = entry.term.parameter(symbol)
        self.scenario.require_free(term, symbol)
        entry.values[symbol] = parameter.value(value, term)

    def run(self, reference: np.ndarray) -> Samples:
        """Return the next stretch.

        Parameters
        ----------
        reference
            Position [rad], velocity [rad/s], acceleration [rad/s^2], shape (n, 3), n >= 1, finite;
            or position alone, shape (n, 1).
        """
        factor = self._factor
        given = np.ascontiguousarray(reference, dtype=float)
        motion = self._actuator.run(given) if self._loop is None else self._actuator.command(given)
        # Internal sample factor - 1 of the run is at the time of the first reference sample,
        # scenario time 0.
        time = (np.arange(1 - factor, motion.shape[1] + 1 - factor) + self._count * factor) / (
            self.rate * factor
        )
        self._count += len(reference)
        for track in self.scenario.tracks:
            self.model.entry(track.term).values[track.parameter.symbol] = track.values(
                time, self._before[track.key]
            )
        if self._loop is None:
            signals = Signals(self.rate * factor, motion[0], motion[1], motion[2])
            self._run.torque(signals)
            parts = self._run.parts
        else:
            signals, parts = self._loop.run(motion[0])
        clean = self._sampler.run(
            signals.measured_position, signals.measured_velocity, signals.torque
        )
        at_samples = slice(factor - 1, None, factor)
        truth = {}
        for entry in self.model.entries:
            for parameter in entry.term.parameters:
                if parameter.linear:
                    value = entry.values[parameter.symbol]
                    truth[f"{entry.term.name}.{parameter.key}"] = (
                        value[at_samples]
                        if np.ndim(value)
                        else np.full(len(reference), float(value))
                    )
        return Samples(clean, truth, {name: torque[at_samples] for name, torque in parts.items()})


@dataclass(frozen=True)
class Recording:
    """Holds a simulated recording of n samples.

    Attributes
    ----------
    rate
        [Hz].
    measured
        Position [rad], velocity [rad/s], torque [N.m] with noise, shape (n, 3).
    clean
        The same without noise.
    truth
        Value of each linear parameter, keyed ``stiffness.K[N.m/rad]``, each of shape (n,).
    parts
        Torque [N.m] of each term before the anti-alias filter, by term name, each of shape (n,).
    noise
        Standard deviations of the noise [rad, rad/s, N.m], shape (3,).
    """

    rate: float
    measured: np.ndarray
    clean: np.ndarray
    truth: dict[str, np.ndarray]
    parts: dict[str, np.ndarray]
    noise: np.ndarray

    @property
    def time(self) -> np.ndarray:
        """Return the sample times [s], the first 0, shape (n,)."""
        return np.arange(len(self.measured)) / self.rate

    @property
    def position(self) -> np.ndarray:
        """Return the measured position [rad], shape (n,)."""
        return self.measured[:, 0]

    @property
    def velocity(self) -> np.ndarray:
        """Return the measured velocity [rad/s], shape (n,)."""
        return self.measured[:, 1]

    @property
    def torque(self) -> np.ndarray:
        """Return the measured torque [N.m], shape (n,)."""
        return self.measured[:, 2]


def simulate(
    reference: np.ndarray,
    rate: float = 2048.0,
    model: Model | None = None,
    servo: Servo | None = None,
    signal_to_noise: SignalToNoise | None = None,
    scenario: Scenario | None = None,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Simulate a whole reference; the noise follows from the standard deviations of the clean
    signals themselves.

    Parameters
    ----------
    reference
        Position [rad], velocity [rad/s], acceleration [rad/s^2], shape (n, 3), finite.
    rate
        Of the reference and the samples [Hz].
    model
        The joint; None stands for the paper's model.
    servo
        None: 30 Hz, damping 0.7.
    signal_to_noise
        None: the paper's; `sensors.NO_NOISE` for none.
    scenario
        Changes of parameters while it runs.
    seed
        Of every random term and of the noise.
    progress
        Called now and then with the part done, 0 to 1.

    Raises
    ------
    ModelError
        Rate out of range, not a finite reference, or a scenario that the model cannot follow.
    """
    reference = np.asarray(reference, dtype=float)
    if reference.ndim != 2 or reference.shape[1] not in (1, 3) or not len(reference):
        raise ModelError(
            f"the reference has shape {reference.shape}, expected (n, 3): position, velocity, "
            "acceleration"
        )
    if not np.isfinite(reference).all():
        raise ModelError(
            f"the reference has {np.count_nonzero(~np.isfinite(reference).all(axis=1))} samples "
            "that are not finite"
        )
    rig = VirtualRig(model, rate, servo, scenario, seed)
    total = len(reference)
    # Each channel in one piece.
    clean = np.empty((3, total)).T
    truth: dict[str, np.ndarray] = {}
    parts: dict[str, np.ndarray] = {}
    for start in range(0, total, STRETCH):
        stop = min(start + STRETCH, total)
        samples = rig.run(reference[start:stop])
        clean[start:stop] = samples.clean
        _collect(truth, samples.truth, start, stop, total)
        _collect(parts, samples.parts, start, stop, total)
        if progress is not None:
            progress(stop / total)
    noise = (signal_to_noise or SignalToNoise()).deviations(clean)
    return Recording(rate, Noise(noise, seed).add(clean), clean, truth, parts, noise)


def _collect(
    into: dict[str, np.ndarray], found: Mapping[str, np.ndarray], start: int, stop: int, total: int
) -> None:
    for key, values in found.items():
        if key not in into:
            into[key] = np.empty(total)
        into[key][start:stop] = values
