"""The paper's perturbation: pulses and steps in random order.

Each block of 500 ms begins with a rise from rest. A pulse returns after the short width w, a step
after the long one, 500 ms - w; so a pulse is up for w and down for the rest of the block, and a
step the other way round. With a random order the position 40 to 400 ms after a rise is as often up
as down, whatever it was before: its cross-correlation with half-wave rectified velocity, and with
it the reflex's share in the intrinsic estimate, is zero.

Source: van 't Veld et al. 2018, sections II-A and II-B.
"""

from __future__ import annotations

import numpy as np

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity, Value
from perturbation_generator.settings import Settings
from perturbation_generator.step_sequence import Cycle, StepSequence

# s, width of a pulse with instant edges (paper, section II-A); the reflex delay is not shorter
PULSE = 0.040
# Blocks in a balanced group: enough that the order stays unpredictable, few enough that every 10 s
# are balanced; a multiple of 4, for pulses and steps on each of two sides.
GROUP = 20


class PulseStep(StepSequence):
    """Draws pulses and steps in random order.

    The width is from start of rise to start of fall. With instant edges it is the paper's 40 ms. An
    edge of 24 ms takes part of those 40 ms: velocity lasts as long as the edge, so with a width of
    40 ms the fall and the velocity of the rise still overlap at lags of 40 to 64 ms and the
    correlation there reaches half its peak. The shortest pulse that reaches its amplitude, a width
    of one edge, leaves 0.4 %. Therefore width 0 (the default) stands for one edge where edges have
    a length and for 40 ms where they have none.

    The long part of each block is stretched by a uniform random time, so that the rhythm cannot be
    anticipated.

    With ``balanced`` each group of `GROUP` blocks holds as many pulses as steps on each side, in
    random order, with the same stretches for the pulses as for the steps. The mean position at 40
    to 400 ms after a rise is then exactly the mean position, and the correlation is zero in every
    run of whole groups, not only on average.

    The property holds for velocity rectified in the direction that leaves rest: dorsiflexion
    velocity for ``dorsiflexing``, plantarflexion velocity for ``plantarflexing``; with ``both`` for
    neither (57 % of the peak).
    """

    name = "pulse_step"
    parameters = (
        Quantity(
            "pulse_step.block_length",
            "s",
            0.1,
            5.0,
            0.5,
            description="Length of a pulse or step with its rest (paper: 40 + 460 ms).",
            start_only=True,
        ),
        Quantity(
            "pulse_step.pulse_width",
            "s",
            0.0,
            0.5,
            0.0,
            description=(
                "Start of rise to start of fall of a pulse; 0: one edge duration where edges have "
                "one, else 40 ms."
            ),
            start_only=True,
        ),
        # 0.2 s gives about 100 dorsiflexions a minute with steps and pulses, as many as the paper
        # reports.
        Quantity(
            "pulse_step.stretch",
            "s",
            0.0,
            2.0,
            0.2,
            description="Largest random stretch of the long part of a block.",
            start_only=True,
        ),
        Quantity(
            "pulse_step.balanced",
            default=False,
            description="Whether each group of 20 blocks has as many pulses as steps.",
            start_only=True,
        ),
    )

    def __init__(self, settings: Settings, **own: Value) -> None:
        self._group: list[tuple[bool, int, float]] = []
        super().__init__(settings, **own)
        if not 0 < self._width < self._long:
            raise QuantityError(
                f"parameter 'pulse_step.pulse_width' = {self._width:g} s is refused; "
                f"it must be shorter than half of 'pulse_step.block_length' = {self._block:g} s"
            )

    @property
    def _block(self) -> float:
        return float(self.own["block_length"])

    @property
    def _width(self) -> float:
        return float(self.own["pulse_width"]) or self.settings.shape.length or PULSE

    @property
    def _long(self) -> float:
        return self._block - self._width

    @property
    def spacing(self) -> float:
        """Return the pulse's width [s]."""
        return self._width

    @property
    def longest_cycle(self) -> float:
        """Return the length of a block with the largest stretch [s]."""
        return self._block + float(self.own["stretch"])

    def _draw(self) -> Cycle:
        if not self._group:
            self._group = self._draw_group() if self.own["balanced"] else [self._draw_block()]
        pulse, side, stretch = self._group.pop()
        up = self._width if pulse else self._long + stretch
        return Cycle(((0.0, float(side)), (up, 0.0)), self._block + stretch)

    def _draw_block(self) -> tuple[bool, int, float]:
        random, sides = self._random, self.settings.sides
        return (
            bool(random.integers(2)),
            sides[random.integers(len(sides))],
            random.uniform(0.0, float(self.own["stretch"])),
        )

    def _draw_group(self) -> list[tuple[bool, int, float]]:
        half = GROUP // 2
        sides = np.resize(self.settings.sides, half)
        stretches = self._random.uniform(0.0, float(self.own["stretch"]), half)
        blocks = [
            (pulse, int(side), float(stretch))
            for pulse in (True, False)
            for side, stretch in zip(sides, stretches, strict=True)
        ]
        return [blocks[i] for i in self._random.permutation(GROUP)]
