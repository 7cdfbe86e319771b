"""Single stretches, each given when somebody asks for it.

The plate rests until `OnRequest.request` is called; then one rise, a hold, and the way back. This
is the perturbation of a conditioning course, whose trials wait until the subject holds the
background (Thompson, Chen & Wolpaw, J Neurosci 29:5784, 2009).
"""

from __future__ import annotations

import numpy as np

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity, Value
from perturbation_generator.edge_train import EdgeTrain
from perturbation_generator.edges import Extremes
from perturbation_generator.settings import Settings
from perturbation_generator.signal import Onset, Signal

LEAST_REST = 0.2
"""[s] Least rest between two stretches: five times the 40 ms window of the background, so that no
response stands in the background of the next one."""


class OnRequest(Signal):
    """Gives one stretch for each request, to the side of ``direction`` (``both``: dorsiflexing)."""

    name = "on_request"
    parameters = (
        Quantity(
            "on_request.hold",
            "s",
            0.05,
            5.0,
            0.5,
            description="Start of rise to start of fall; the reflex is over after 0.2 s.",
            start_only=True,
        ),
    )

    def __init__(self, settings: Settings, **own: Value) -> None:
        super().__init__(settings, **own)
        self._hold = float(self.own["hold"])
        if self._hold < settings.shape.length:
            raise QuantityError(
                f"parameter 'on_request.hold' = {self._hold:g} s is refused; an edge takes "
                f"{settings.shape.length:g} s"
            )
        self._train = EdgeTrain(settings.shape, settings.rate)

    @property
    def awaits_requests(self) -> bool:
        """See `Signal.awaits_requests`."""
        return True

    def request(self) -> float | None:
        """Begin a stretch with the next sample.

        Returns
        -------
        float | None
            Time of its onset since the start of the signal [s]; None while the last stretch is not
            over, or where the end of the signal is too near.
        """
        start, settling = self.time, self.settings.shape.settling
        over = start + self._hold + settling
        if start < self._free_at or over > self.settings.end or self.amplitude == 0.0:
            return None
        side = self.settings.sides[0]
        self._train.add(start, side * self.amplitude)
        self._train.add(start + self._hold, 0.0)
        self._onsets += [
            Onset(start, side, self.amplitude),
            Onset(start + self._hold, -side, self.amplitude),
        ]
        self._free_at = over + LEAST_REST
        return start

    def extremes(self, amplitude: float) -> Extremes:
        """See `Signal.extremes`."""
        edge = self.settings.shape.extremes(amplitude, self._hold, self.settings.rate)
        return Extremes(amplitude + edge.position, edge.velocity, edge.acceleration)

    def _samples(self, first: int, n: int) -> np.ndarray:
        return self._train.samples(first, n)
