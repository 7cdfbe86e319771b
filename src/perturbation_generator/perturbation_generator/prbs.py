"""Pseudo-random binary sequence: a maximum-length sequence of 2^n - 1 clock intervals.

Its autocorrelation is that of white noise sampled at the clock: 1 at lag zero, -1/(2^n - 1) at all
others (for levels ±1). One period holds 2^(n-1) ones. Source: Golomb, Shift Register Sequences,
1967; used for ankle stiffness by Kearney, Stein and Parameswaran, IEEE Trans Biomed Eng 44:493-504,
1997.
"""

from __future__ import annotations

import numpy as np

from ankle_interfaces.quantity import Quantity, Value
from perturbation_generator.settings import Settings
from perturbation_generator.step_sequence import Cycle, StepSequence


class Prbs(StepSequence):
    """Switches between rest and the amplitude (``both``: between plus and minus the amplitude) at
    clock times.

    The seed chooses where in the period the sequence starts. A new amplitude holds from the next
    switch on.
    """

    name = "prbs"
    parameters = (
        Quantity(
            "prbs.order",
            "1",
            3,
            20,
            10,
            description="Length n of the shift register; the period is 2^n - 1 clock intervals.",
            start_only=True,
        ),
        # Slow enough for a low mean velocity, which leaves the stretch reflex strong (Kearney et
        # al. 1997).
        Quantity(
            "prbs.clock",
            "s",
            0.005,
            10.0,
            0.15,
            description="Shortest time between two switches.",
            start_only=True,
        ),
    )

    def __init__(self, settings: Settings, **own: Value) -> None:
        from scipy.signal import max_len_seq  # here, because every node would wait a second for it

        super().__init__(settings, **own)
        order = int(self.own["order"])
        state = self._random.integers(0, 2, order)
        if not state.any():  # the register's only state that never changes
            state[0] = 1
        self._bits = max_len_seq(order, state=state)[0].astype(bool)
        self._next = 0

    @property
    def spacing(self) -> float:
        """Return the clock interval [s]."""
        return float(self.own["clock"])

    @property
    def longest_cycle(self) -> float:
        """Return the longest run of equal bits [s]: as many clock intervals as the register has
        bits.
        """
        return int(self.own["order"]) * self.spacing

    @property
    def largest_step(self) -> float:
        """Return the largest step in multiples of the amplitude: 2 between both sides."""
        return float(len(self.settings.sides))

    def _draw(self) -> Cycle:
        bits, first = self._bits, self._next
        one = bits[first % len(bits)]
        run = int(np.argmax(np.roll(bits, -(first % len(bits))) != one))
        self._next = first + run
        sides = self.settings.sides
        low = float(sides[1]) if len(sides) > 1 else 0.0
        return Cycle(((0.0, float(sides[0]) if one else low),), run * self.spacing)
