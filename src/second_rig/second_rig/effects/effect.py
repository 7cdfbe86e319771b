"""What an effect is: what it changes at a strength, and between which strengths it is sought."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Change:
    """Holds what an effect of one strength changes.

    Attributes
    ----------
    parameters
        New numbers by part and name, as `parameters.changed` takes them.
    stiffness, reflex
        Factors on K and on the drive of the reflex in time [1], each of shape (n,).
    torque
        That the subject holds besides [N.m], shape (n,).
    sensor
        Makes of the true torque of shape (n,) and the time step [s] what the sensor gives.
    """

    parameters: Mapping[str, float] = field(default_factory=dict)
    stiffness: np.ndarray | float = 1.0
    reflex: np.ndarray | float = 1.0
    torque: np.ndarray | float = 0.0
    sensor: Callable[[np.ndarray, float], np.ndarray] | None = None


@dataclass(frozen=True)
class Effect:
    """Describes an effect as it was drawn for one subject.

    Attributes
    ----------
    name
        In words.
    equation
        As a formula.
    change
        Returns what the effect changes at a strength.
    start
        Strength at which the search for the wanted one begins.
    weakest, strongest
        Strengths between which it is sought.
    drawn
        Numbers beside the strength.
    """

    name: str
    equation: str
    change: Callable[[float], Change]
    start: float
    weakest: float
    strongest: float
    drawn: Mapping[str, object] = field(default_factory=dict)
