"""The movements that calibrate a rig: rest, fast steps, sweeps of uneven speed, slow sweeps, rest.

Fast steps of random size excite plate and servo. Sweeps that keep their direction while their speed
jumps show inertia and torque sensor without any change of the friction. Slow sweeps over the range
show weight, friction and how far the servo sags; rest shows zeros and noise.
"""

from __future__ import annotations

import numpy as np

from ankle_interfaces.quantity import Quantity, Value
from perturbation_generator.edge_train import EdgeTrain
from perturbation_generator.edges import Extremes, Polynomial
from perturbation_generator.settings import Settings
from perturbation_generator.signal import Onset, Signal
from perturbation_generator.uneven_sweep import (
    LONGEST_SWEEP,
    SweepTrain,
    UnevenSweep,
    extremes,
)

INITIAL_REST = 10.0
"""[s] Rest at the start. A recorder that has just begun may hear the samples later than the
reference: by 2.2 s, and by 3 s on a busy computer."""
FINAL_REST = 4.0
"""[s] Rest at the end: 8192 samples give a zero to within a hundredth of the noise."""
FAST_TIME = 24.0
"""[s] Duration of the fast edges, about 60: servo and friction are then known to a per cent."""
PAUSES = (0.25, 0.5)
"""[s] Shortest and longest pause between fast edges: plate and sensor have come to rest."""
LEVELS = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Parts of the amplitude that steps go to, so that steps have many sizes and both directions."""
UNEVEN_TIME = 46.0
"""[s] Duration of the sweeps of uneven speed, about 240: a delay is then known to 0.02 ms with 0.14
N.m of torque noise, and to 0.1 ms beside a lag of the torque sensor."""
SWEEP_TIME = 5.0
"""[s] Time of a sweep from one end of the range to the other: 0.03 rad/s, slow against friction's
velocity."""
SWEEPS = 6
HOLD_TIME = 1.0
"""[s] Rest at each end of a sweep."""
SLOW_TIME = (SWEEPS + 2) * (SWEEP_TIME + HOLD_TIME)
"""[s] Duration of the slow sweeps."""
DURATION = INITIAL_REST + FAST_TIME + UNEVEN_TIME + SLOW_TIME + FINAL_REST
"""[s] Duration of the whole, after which the plate rests."""


class RigCalibration(Signal):
    """Steps by random heights on both sides of rest, then sweeps over the same range, at first with
    a speed that jumps, then slowly.

    Its onsets are the fast edges only; a sweep evokes nothing.
    """

    name = "rig_calibration"
    parameters = (
        Quantity(
            "rig_calibration.on_request",
            default=False,
            description=(
                "Whether the plate rests until the service perturb asks for the movements, so that "
                "a rig can be armed and started before; false: they begin at once."
            ),
            start_only=True,
        ),
    )

    def __init__(self, settings: Settings, **own: Value) -> None:
        super().__init__(settings, **own)
        self._fast = EdgeTrain(settings.shape, settings.rate)
        self._uneven = SweepTrain(settings.rate)
        self._slow = EdgeTrain(Polynomial(SWEEP_TIME), settings.rate)
        self._random = np.random.default_rng(settings.seed)
        if not self.awaits_requests:
            self._plan(0.0)

    @property
    def awaits_requests(self) -> bool:
        """See `Signal.awaits_requests`."""
        return bool(self.own["on_request"])

    def request(self) -> float | None:
        """Begin all movements, with the initial rest; see `Signal.request`.

        The result is None while the last ones are not over, or where the end of the signal is too
        near.
        """
        start = self.time
        if start < self._free_at or start + DURATION > self.settings.end or self.amplitude == 0.0:
            return None
        self._plan(start)
        self._free_at = start + DURATION
        return start

    def rest(self) -> None:
        """End the movements that were requested; see `Signal.rest`.

        The one that has begun is carried out, because it cannot be left without a jump of the
        speed. One more leads back to rest.
        """
        now = self.time
        if not self.awaits_requests or now >= self._free_at:
            return
        self._onsets = [onset for onset in self._onsets if onset.time < now]
        over = [now]
        settling = self.settings.shape.settling
        begun = self._fast.drop_from(now)
        over.append(begun + settling)
        if level := self._fast.level:
            time = max(now, begun + settling, begun + PAUSES[0])
            self._onsets.append(Onset(time, -1 if level > 0 else 1, abs(level)))
            self._fast.add(time, 0.0)
            over.append(time + settling)
        ended, level = self._uneven.drop_from(now)
        over.append(ended)
        if level:
            back = UnevenSweep.drawn(max(now, ended), level, 0.0, self.amplitude, self._random)
            self._uneven.add(back)
            over.append(back.end)
        begun = self._slow.drop_from(now)
        over.append(begun + SWEEP_TIME)
        if self._slow.level:
            time = max(now, begun + SWEEP_TIME)
            self._slow.add(time, 0.0)
            over.append(time + SWEEP_TIME)
        self._free_at = max(over)

    def _plan(self, start: float) -> None:
        last = self.settings.end - FINAL_REST
        self._plan_steps(start + INITIAL_REST, last)
        self._plan_uneven_sweeps(start + INITIAL_REST + FAST_TIME, last)
        self._plan_slow_sweeps(start + INITIAL_REST + FAST_TIME + UNEVEN_TIME + HOLD_TIME)

    def _plan_steps(self, time: float, last: float) -> None:
        random = self._random
        level, amplitude = 0.0, self.amplitude
        end = min(time + FAST_TIME, last)
        while time < end - 2.0 * PAUSES[1]:
            # No step is larger than the amplitude, which velocity and acceleration allow.
            near = [k * amplitude for k in LEVELS if 0.0 < abs(k * amplitude - level) <= amplitude]
            target = float(random.choice(near))
            self._onsets.append(Onset(time, 1 if target > level else -1, abs(target - level)))
            self._fast.add(time, target)
            level = target
            time += float(random.uniform(*PAUSES))
        if level:
            self._onsets.append(Onset(time, -1 if level > 0 else 1, abs(level)))
            self._fast.add(time, 0.0)

    def _plan_uneven_sweeps(self, time: float, last: float) -> None:
        end, level, target = min(time + UNEVEN_TIME, last), 0.0, self.amplitude
        while self.amplitude > 0.0 and time + 2.0 * LONGEST_SWEEP < end:
            sweep = UnevenSweep.drawn(time, level, target, self.amplitude, self._random)
            self._uneven.add(sweep)
            time, level, target = sweep.end, target, -target
        if level:
            self._uneven.add(UnevenSweep.drawn(time, level, 0.0, self.amplitude, self._random))

    def _plan_slow_sweeps(self, time: float) -> None:
        targets = [self.amplitude * (-1.0) ** k for k in range(SWEEPS)]
        for target in targets:
            if time + 2.0 * (SWEEP_TIME + HOLD_TIME) > self.settings.end:
                break
            self._slow.add(time, target)
            time += SWEEP_TIME + HOLD_TIME
        self._slow.add(time, 0.0)

    def set_amplitude(self, amplitude: float) -> None:
        """Set the amplitude of the next movements; the present ones were planned before."""
        self.amplitude = amplitude

    def extremes(self, amplitude: float) -> Extremes:
        """See `Signal.extremes`: no step is larger than the amplitude."""
        edge = self.settings.shape.extremes(amplitude, PAUSES[0], self.settings.rate)
        sweep = extremes(amplitude)
        return Extremes(
            amplitude + edge.position,
            max(edge.velocity, sweep.velocity),
            max(edge.acceleration, sweep.acceleration),
        )

    def _samples(self, first: int, n: int) -> np.ndarray:
        trains = (self._fast, self._uneven, self._slow)
        return np.sum([train.samples(first, n) for train in trains], axis=0)
