"""The estimators by name: each module of this folder offers one, with the class `Algorithm`.

A new estimator is one file here. Its name is then a value of the node's parameter ``algorithm`` and
of ``ankle estimate --algorithm``, and its settings are parameters of the node.
"""

from __future__ import annotations

import pkgutil
from importlib import import_module

from ankle_interfaces.errors import QuantityError
from impedance_estimator.estimator import Estimator
from impedance_estimator.settings import EstimatorSettings

DEFAULT = "simultaneous"
"""``docs/estimators.md`` compares the estimators."""


def _found() -> dict[str, type[Estimator]]:
    """Return the estimator of every module of this folder by its name.

    Raises
    ------
    ImportError
        A module without `Algorithm`, or two estimators of one name.
    """
    found: dict[str, type[Estimator]] = {}
    for module in sorted(module.name for module in pkgutil.iter_modules(__path__)):
        algorithm = getattr(import_module(f"{__name__}.{module}"), "Algorithm", None)
        if algorithm is None:
            raise ImportError(f"{__name__}.{module} has no class 'Algorithm'")
        if algorithm.name in found:
            raise ImportError(f"two modules of {__name__} have the algorithm '{algorithm.name}'")
        found[algorithm.name] = algorithm
    return found


ALGORITHMS: dict[str, type[Estimator]] = _found()


def make_estimator(
    name: str, rate: float, measured_velocity: bool, settings: EstimatorSettings | None = None
) -> Estimator:
    """Make an estimator by its name.

    Parameters
    ----------
    name
        A key of `ALGORITHMS`.
    rate
        Sampling rate [Hz].
    measured_velocity
        Whether samples carry a velocity column.
    settings
        The algorithm's defaults where None.

    Raises
    ------
    QuantityError
        No such name, or a rate or settings that the estimator refuses.
    """
    if name not in ALGORITHMS:
        raise QuantityError(f"algorithm '{name}' is not known; allowed: {', '.join(ALGORITHMS)}")
    return ALGORITHMS[name](rate, measured_velocity, settings)
