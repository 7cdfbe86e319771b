"""The estimators by name. A new one: a file with a subclass of `Estimator`, and a line here."""

from __future__ import annotations

from impedance_estimator.correlation.conceptual_experimental import (
    Conceptual,
    ConceptualExperimental,
)
from impedance_estimator.correlation.original import Original
from impedance_estimator.estimator import Estimator
from impedance_estimator.settings import EstimatorSettings
from impedance_estimator.simultaneous.simultaneous_estimator import Simultaneous

ALGORITHMS: dict[str, type[Estimator]] = {
    estimator.name: estimator
    for estimator in (
        ConceptualExperimental,
        Conceptual,
        Original,
        Simultaneous,
    )
}

DEFAULT = Simultaneous.name
"""``docs/estimators.md`` compares them."""


def make_estimator(
    name: str, rate: float, measured_velocity: bool, settings: EstimatorSettings | None = None
) -> Estimator:
    """An estimator by its name.

    Raises
    ------
    ValueError
        No such name, or a rate or settings that the estimator refuses.
    """
    if name not in ALGORITHMS:
        raise ValueError(f"algorithm '{name}' is not known; allowed: {', '.join(ALGORITHMS)}")
    return ALGORITHMS[name](rate, measured_velocity, settings)
