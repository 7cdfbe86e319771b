"""Steps to random levels and back, as in published recordings of the human ankle."""

from __future__ import annotations

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity, Value
from perturbation_generator.settings import Settings
from perturbation_generator.step_sequence import Cycle, StepSequence


class RandomSteps(StepSequence):
    """Goes out to a random level, holds, returns to rest, holds; each hold has a random length.

    The defaults follow two trials of the McGill (REKLAB) stiffness identification toolbox: 238 and
    240 steps that alternate between rest and a level on a random side (``direction`` both), up to
    30 mrad, median 25 mrad, 95 % above 11 mrad; starts 200 to 300 ms apart with a flat distribution
    (one pair in each trial further apart); a rise of 10 to 14 ms from 10 to 90 %, which an edge of
    24 ms gives (12.2 ms). The level is drawn uniformly between ``smallest_level`` and 1, times the
    amplitude.
    """

    name = "random_steps"
    parameters = (
        Quantity(
            "random_steps.shortest_hold",
            "s",
            0.01,
            10.0,
            0.2,
            description="Shortest time between two steps.",
            start_only=True,
        ),
        Quantity(
            "random_steps.longest_hold",
            "s",
            0.01,
            10.0,
            0.3,
            description="Longest time between two steps.",
            start_only=True,
        ),
        Quantity(
            "random_steps.smallest_level",
            "1",
            0.0,
            1.0,
            0.5,
            description="Smallest level as a share of the amplitude.",
            start_only=True,
        ),
    )

    def __init__(self, settings: Settings, **own: Value) -> None:
        super().__init__(settings, **own)
        if self.longest_cycle < 2 * self.spacing:
            raise QuantityError(
                f"parameter 'random_steps.longest_hold' = {self.own['longest_hold']:g} s is "
                "refused; "
                "it must not be below 'random_steps.shortest_hold' = "
                f"{self.own['shortest_hold']:g} s"
            )

    @property
    def spacing(self) -> float:
        """Return the shortest hold [s]."""
        return float(self.own["shortest_hold"])

    @property
    def longest_cycle(self) -> float:
        """Return the length of two of the longest holds [s]."""
        return 2 * float(self.own["longest_hold"])

    def _draw(self) -> Cycle:
        random, sides = self._random, self.settings.sides
        side = sides[random.integers(len(sides))]
        level = side * random.uniform(float(self.own["smallest_level"]), 1.0)
        out, back = random.uniform(self.spacing, float(self.own["longest_hold"]), 2)
        return Cycle(((0.0, level), (out, 0.0)), out + back)
