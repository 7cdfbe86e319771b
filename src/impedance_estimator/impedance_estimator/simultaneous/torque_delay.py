"""The delay of the torque behind the motion, from the shifted accelerations of `explained_motion`.

They make the intrinsic pathway that of a joint behind a delay; the joint's own B and I follow once
the delay is known. It is searched for: each delay has the B and I that fit best.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator.compilation import part
from impedance_estimator.simultaneous.nuisance import EXTRAS, TAPS
from impedance_estimator.simultaneous.state import Plan, State

TAP_SHIFTS = np.repeat(np.arange(1.0, TAPS // 2 + 1.0), 2) * np.tile([1.0, -1.0], TAPS // 2)
"""Decimated samples by which each shifted acceleration is late, as `nuisance.tap_shift`."""
LARGEST_DELAY = 0.012
"""A delay [s] of at most this lies within the reach of the shifted accelerations."""
DELAY_STEP = 0.00025
"""The delay is searched in steps of this size [s]; a parabola through the best three follows."""
DELAYS = np.arange(-LARGEST_DELAY, LARGEST_DELAY + DELAY_STEP / 2.0, DELAY_STEP)
FREQUENCIES = np.arange(3.0, 25.0, 3.0)
"""At these frequencies [Hz] the perturbation has its power, and inertia, viscosity and stiffness
theirs."""
TURNS = np.exp(2j * np.pi * FREQUENCIES * DELAYS[:, None])
"""Each of `DELAYS` turns the phase at each of `FREQUENCIES` by these factors."""


@part
def intrinsic_response(p: Plan, s: State) -> np.ndarray:
    """Return the torque per position of the intrinsic pathway at `FREQUENCIES`, shape (k,)."""
    omega = 2.0 * np.pi * FREQUENCIES
    response = s.solution[0] + 1j * omega * s.solution[1] - omega**2 * s.solution[2]
    first = s.nuisance.coefficients.shape[0] - EXTRAS
    for tap in range(TAPS):
        turn = omega * TAP_SHIFTS[tap] * p.decimation / p.rate
        response -= omega**2 * s.nuisance.coefficients[first + tap] * (np.exp(-1j * turn) - 1.0)
    return response


@part
def behind_delay(
    response: np.ndarray, stiffness: float, turns: np.ndarray
) -> tuple[float, float, float]:
    """Return B, I, and the relative misfit of a joint with a stiffness and a late torque.

    Parameters
    ----------
    response
        Of the intrinsic pathway at `FREQUENCIES`, shape (k,).
    stiffness
        Stiffness K of the joint [N.m/rad].
    turns
        exp(iωD) at `FREQUENCIES`, of the time D by which the torque is late, shape (k,).
    """
    damping = inertia = second = fourth = misfit = 0.0
    for k in range(response.shape[0]):
        omega = 2.0 * np.pi * FREQUENCIES[k]
        weight = 1.0 / (response[k].real ** 2 + response[k].imag ** 2 + 1.0)
        aligned = response[k] * turns[k]
        damping += weight * aligned.imag * omega
        inertia += weight * (stiffness - aligned.real) * omega**2
        second += weight * omega**2
        fourth += weight * omega**4
    damping, inertia = damping / second, inertia / fourth
    for k in range(response.shape[0]):
        omega = 2.0 * np.pi * FREQUENCIES[k]
        weight = 1.0 / (response[k].real ** 2 + response[k].imag ** 2 + 1.0)
        aligned = response[k] * turns[k]
        real = aligned.real - stiffness + omega**2 * inertia
        imaginary = aligned.imag - omega * damping
        misfit += weight * (real**2 + imaginary**2)
    return damping, inertia, np.sqrt(misfit / response.shape[0])


@part
def state_delay(p: Plan, s: State) -> None:
    """Set the delay of the torque behind the motion, and what it adds to B and I."""
    c = s.counters[0]
    response = intrinsic_response(p, s)
    misfit = np.empty(DELAYS.shape[0])
    for k in range(DELAYS.shape[0]):
        misfit[k] = behind_delay(response, s.solution[0], TURNS[k])[2]
    best = min(max(int(np.argmin(misfit)), 1), DELAYS.shape[0] - 2)
    before, least, after = misfit[best - 1], misfit[best], misfit[best + 1]
    bend = before + after - 2.0 * least
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    c.delay = DELAYS[best] + DELAY_STEP * min(max(shift, -1.0), 1.0)
    turns = np.exp(2j * np.pi * FREQUENCIES * c.delay)
    damping, inertia, _ = behind_delay(response, s.solution[0], turns)
    c.added_damping = damping - s.solution[1]
    c.added_inertia = inertia - s.solution[2]
