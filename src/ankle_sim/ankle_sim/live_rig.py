"""The virtual rig behind a stream of reference blocks that may have gaps, damaged samples or
another rate.

Time is the reference's own. What is missing in the reference is missing in the samples: the plate
holds its last commanded position for as long, the joint lives on, and nothing is given out for that
stretch.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ankle_interfaces.continuity import RATE_TOLERANCE, sampling_rate
from ankle_physics.actuator import Servo
from ankle_physics.linear_dynamics import Delay
from ankle_physics.model import Model
from ankle_physics.rig_file import LONGEST_DELAY, RigFile
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import Noise, SignalToNoise
from ankle_physics.virtual_rig import VirtualRig, simulate
from ankle_sim.parameters import VOLUNTARY_TORQUE
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

# Long enough for about 60 pulses and steps, so that their random order matters little to the
# standard deviation.
NOMINAL_DURATION = 30.0  # s
# A longer hold ends the run: simulating it would keep the node from its next blocks for about 0.1
# s.
LONGEST_HOLD = 60.0  # s


@dataclass(frozen=True)
class Setup:
    """Holds everything that a rig is made of but the rate.

    Attributes
    ----------
    noise_amplitude
        Of the pulse-step perturbation [rad] whose response sets the noise.
    rig
        A calibrated rig to be simulated; its servo, zeros, delay of the velocity and noise take
        the place of those here, its terms are in the model. None: none.
    """

    model: Model
    servo: Servo
    signal_to_noise: SignalToNoise
    scenario: Scenario
    noise_amplitude: float
    seed: int
    rig: RigFile | None = None

    @property
    def servo_in_force(self) -> Servo:
        """Return the servo of the calibrated rig where there is one that knows it."""
        return (self.rig.servo if self.rig is not None else None) or self.servo


NOISE_KEYS = ("position[rad]", "velocity[rad/s]", "torque[N.m]")


@dataclass(frozen=True)
class Stretch:
    """Holds uninterrupted samples.

    Attributes
    ----------
    time
        [s], shape (n,).
    samples
        Position [rad], velocity [rad/s], torque [N.m], shape (n, 3).
    clean
        The same without noise.
    truth
        Value of each linear parameter at the last sample, keyed ``stiffness.K[N.m/rad]``.
    parts
        Torque [N.m] of each term at the last sample, by term name.
    """

    time: np.ndarray
    samples: np.ndarray
    clean: np.ndarray
    truth: dict[str, float]
    parts: dict[str, float]

    @property
    def truth_row(self) -> np.ndarray:
        """Return the row of ``ankle/truth``, shape (4,); NaN for a term that the model lacks."""
        return np.array(
            [
                self.time[-1],
                self.truth.get("stiffness.K[N.m/rad]", math.nan),
                self.truth.get("reflex.G[N.m.s/rad]", math.nan),
                self.parts.get(VOLUNTARY_TORQUE, math.nan),
            ]
        )


class LiveRig:
    """Turns reference blocks into samples.

    Parameters
    ----------
    setup
        What the rig is made of; its model is changed by `set`.
    tell
        Called with a sentence when something happens that an operator should know.
    noisy
        Whether the samples have noise; may be changed at any time.

    Attributes
    ----------
    held
        Samples for which the plate was held because the reference was missing.
    rate
        Of the present run [Hz]; None before the first block.
    """

    def __init__(self, setup: Setup, tell: Callable[[str], None], noisy: bool = True) -> None:
        setup.scenario.require(setup.model)
        self.setup = setup
        self.noisy = noisy
        self.held = 0
        self.rate: float | None = None
        self._tell = tell
        self._rig: VirtualRig | None = None
        self._fresh = True  # the rig has taken no sample yet
        self._noise: Noise | None = None
        self._velocity_delay: Delay | None = None
        self._deviations: dict[float, np.ndarray] = {}
        self._last_time = 0.0
        self._last_position = 0.0

    def noise_deviations(self, rate: float) -> np.ndarray:
        """Return the standard deviations of the noise at a rate [Hz]: [rad, rad/s, N.m], shape
        (3,).

        A signal-to-noise ratio refers to the whole signal, which a live rig does not know in
        advance. So the paper's pulse-step perturbation is simulated once with the model as it is at
        the start, without scenario and voluntary torque, and the noise that belongs to it stays,
        whatever perturbation then comes.
        """
        if rate not in self._deviations:
            if self.setup.rig is not None and self.setup.rig.noise:
                noise = self.setup.rig.noise
                self._deviations[rate] = np.array([noise.get(key, 0.0) for key in NOISE_KEYS])
                return self._deviations[rate]
            reference = PulseStep(
                Settings(rate=rate, amplitude=self.setup.noise_amplitude, seed=self.setup.seed)
            ).next(int(NOMINAL_DURATION * rate))
            entries = [
                entry for entry in self.setup.model.entries if entry.term.name != VOLUNTARY_TORQUE
            ]
            recording = simulate(
                reference,
                rate,
                Model(entries),
                self.setup.servo_in_force,
                self.setup.signal_to_noise,
                seed=self.setup.seed,
            )
            self._deviations[rate] = recording.noise
        return self._deviations[rate]

    def check(self, term: str, symbol: str, value: float) -> None:
        """Say whether `set` would accept the value.

        Raises
        ------
        ModelError
            As `set`.
        """
        self.setup.scenario.require_free(term, symbol)
        self.setup.model.entry(term).term.parameter(symbol).value(value, term)

    def set(self, term: str, symbol: str, value: float) -> None:
        """Change a parameter of the model from the next block on.

        Raises
        ------
        ModelError
            No such parameter, value out of range, or the scenario determines it.
        """
        self.check(term, symbol, value)
        self.setup.model.entry(term).values[symbol] = value
        if self._rig is not None:
            self._rig.set(term, symbol, value)

    def take(self, time: np.ndarray, reference: np.ndarray) -> list[Stretch]:
        """Simulate one block.

        Parameters
        ----------
        time
            Times of the samples [s], shape (n,).
        reference
            Position, velocity, acceleration, shape (n, 3), or position alone, shape (n, 1). Samples
            that are not finite count as missing.

        Returns
        -------
        list[Stretch]
            One stretch for each uninterrupted part; empty where nothing could be simulated.

        Raises
        ------
        ModelError
            A sampling rate out of range.
        """
        good = np.isfinite(time) & np.isfinite(reference).all(axis=1)
        time, reference = time[good], reference[good]
        if not len(time):
            return []
        self._follow_rate(time)
        if self.rate is None:
            self._tell(
                f"{len(time)} sample(s) at t = {time[0]:.3f} s do not tell a sampling rate and "
                "are dropped"
            )
            return []
        found = []
        steps = np.round(np.diff(time, prepend=self._last_time) * self.rate).astype(int)
        if self._fresh:
            steps[0] = 1
        breaks = [0, *[int(k) for k in np.flatnonzero(steps[1:] != 1) + 1], len(time)]
        for start, stop in pairwise(breaks):
            self._bridge(int(steps[start]) - 1, float(time[start]), reference.shape[1])
            found.append(self._simulate(time[start:stop], reference[start:stop]))
        return found

    def _follow_rate(self, time: np.ndarray) -> None:
        """Begin with the first known rate; begin again at another one."""
        if len(time) < 2:
            return
        # The two ends settle it for the usual block.
        if self.rate is not None and _matches((time[-1] - time[0]) * self.rate, len(time) - 1):
            return
        try:
            rate = sampling_rate(time)
        except ValueError:  # time runs back inside the block, which `take` finds sample by sample
            return
        if self.rate is not None and _matches(rate, self.rate):
            return
        if self.rate is not None:
            self._tell(
                f"the reference comes at {rate:g} Hz instead of {self.rate:g} Hz: rig and "
                f"scenario start again at t = {time[0]:.3f} s"
            )
        self._restart(rate)

    def _restart(self, rate: float) -> None:
        setup = self.setup
        self._rig = VirtualRig(setup.model, rate, setup.servo_in_force, setup.scenario, setup.seed)
        self._velocity_delay = Delay(rate, LONGEST_DELAY)
        self._noise = Noise(self.noise_deviations(rate), setup.seed)
        self.rate = rate
        self._fresh = True

    def _bridge(self, missing: int, at: float, columns: int) -> None:
        """Let time pass for missing samples with the plate held."""
        assert self.rate is not None
        if missing < 0:
            self._tell(
                f"the reference runs back in time at t = {at:.3f} s: rig and scenario start again"
            )
            self._restart(self.rate)
        elif missing > LONGEST_HOLD * self.rate:
            self._tell(
                f"no reference for {missing / self.rate:.1f} s before t = {at:.3f} s: rig and "
                "scenario start again"
            )
            self._restart(self.rate)
        elif missing:
            self._tell(
                f"no reference for {missing} samples before t = {at:.3f} s: the plate was held, "
                "nothing is published for them"
            )
            hold = np.zeros((missing, columns))
            hold[:, 0] = self._last_position
            assert self._rig is not None
            self._rig.run(hold)
            self.held += missing

    def _simulate(self, time: np.ndarray, reference: np.ndarray) -> Stretch:
        assert self._rig is not None
        assert self._noise is not None
        result = self._rig.run(reference)
        self._fresh = False
        self._last_time, self._last_position = float(time[-1]), float(reference[-1, 0])
        clean = self._read(result.clean)
        samples = self._noise.add(clean) if self.noisy else clean
        truth = {key: float(values[-1]) for key, values in result.truth.items()}
        return Stretch(
            time,
            samples,
            clean,
            truth,
            {name: float(torque[-1]) for name, torque in result.parts.items()},
        )

    def _read(self, clean: np.ndarray) -> np.ndarray:
        """Return what the sensors of the calibrated rig make of the samples, shape (n, 3)."""
        rig = self.setup.rig
        if rig is None:
            return clean
        assert self._velocity_delay is not None
        late = self._velocity_delay.run(clean[:, 1], max(rig.velocity_delay.value, 0.0))
        return np.column_stack(
            [clean[:, 0] + rig.zero_position, late, clean[:, 2] + rig.zero_torque]
        )


def _matches(value: float, expected: float) -> bool:
    return abs(value - expected) <= RATE_TOLERANCE * expected
