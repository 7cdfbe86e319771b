"""The grids of the candidates' nonlinear parameters, and what a search learns about them."""

from __future__ import annotations

from collections.abc import Sequence

from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.search.screening import Point, Screened, candidates, grid

# Grids are halved from step to step down to so many points.
MIN_GRID_POINTS = 3


class Grids:
    """Chooses which points of the candidates' nonlinear parameters are worth trying, from what was
    tried before.
    """

    def __init__(self, library: Sequence[str] | None, duration: float) -> None:
        self._library = library
        self._duration = duration
        self._kept: dict[str, list[Point]] = {}
        self._best: dict[str, list[Point]] = {}

    def allows(self, name: str) -> bool:
        """Tell whether a term may be added."""
        return self._library is None or name in self._library

    def points(self, fit: Fit) -> dict[str, list[Point]]:
        """Return, for a further term, the whole grid at first, its better half later."""
        return {
            name: self._kept.get(name) or grid(name, self._duration)
            for name in candidates(fit, self._library)
        }

    def whole(self, name: str) -> list[Point]:
        """Return the whole grid of a candidate."""
        return grid(name, self._duration)

    def best(self, fit: Fit) -> dict[str, list[Point]]:
        """Return, for a rival, the points that were once the best."""
        return {
            name: self._best.get(name) or grid(name, self._duration)
            for name in candidates(fit, self._library)
        }

    def copy(self) -> Grids:
        """Return grids that know the same, and learn on their own."""
        other = Grids(self._library, self._duration)
        other._kept = dict(self._kept)
        other._best = {name: list(points) for name, points in self._best.items()}
        return other

    def learn(self, screened: Sequence[Screened]) -> None:
        """Keep the better half of what was tried."""
        for s in screened:
            ranked = [point for _, point in sorted(s.tried, key=lambda entry: -entry[0])]
            self._kept[s.name] = ranked[
                : max((len(ranked) + 1) // 2, min(MIN_GRID_POINTS, len(ranked)))
            ]
            known = self._best.setdefault(s.name, [])
            known += [point for point in ranked[:2] if point not in known]
