"""Elastic torque of the joint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


class Elastic(NamedTuple):
    """Holds the elastic torque of the joint.

    Attributes
    ----------
    K
        Stiffness at the mean position of the reference [N.m/rad].
    mean_position
        [rad].
    rise
        Relative rise of stiffness with dorsiflexion [1/rad].
    hardening
        Relative hardening on both sides [1/rad^2].
    contraction_gain
        Share of K that the reflex' own contraction adds at most [1].
    contraction_time
        With which that contraction follows the reflex' torque [s].
    contraction_torque
        Torque of the reflex at which half of it is added [N.m].
    """

    K: float
    mean_position: float
    rise: float = 0.0
    hardening: float = 0.0
    contraction_gain: float = 0.0
    contraction_time: float = 0.1
    contraction_torque: float = 1.0


@njit(cache=True)
def elastic_torque(
    elastic: Elastic, state: np.ndarray, position: float, course: float, reflex: float, dt: float
) -> float:
    """Return the elastic torque, and take the contraction one step on [N.m].

    Parameters
    ----------
    elastic
        Its numbers.
    state
        Torque of the reflex as the contraction follows it, and the sum of the share of K that was
        added so far; shape (2,).
    position
        Of the foot [rad].
    course
        Factor on K at this moment [1].
    reflex
        Torque of the reflex one step ago [N.m].
    dt
        Time step [s].
    """
    x = position - elastic.mean_position
    K = elastic.K * course
    risen = (np.exp(elastic.rise * x) - 1.0) / elastic.rise if elastic.rise != 0.0 else x
    torque = K * (risen + elastic.hardening * x * x * x)
    if elastic.contraction_gain > 0.0:
        state[0] += dt * (reflex - state[0]) / elastic.contraction_time
        held = max(state[0], 0.0)
        share = elastic.contraction_gain * held / (held + elastic.contraction_torque)
        state[1] += share
        torque += elastic.K * share * x
    return torque
