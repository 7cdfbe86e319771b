"""Motion of a foot behind a linear coupling, frequency by frequency.

``(I s^2 + B s + K) x + T = (k_s + b_s s) (plate - x)``, with the torque T of all else that acts on
the foot given. The loops take a quarter of the time of the same expressions on whole arrays, which
go through memory a dozen times, and let other threads go on meanwhile.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def _gives(omega: float, impedance: np.ndarray) -> complex:
    """Return how far a torque moves the foot in its coupling at a frequency [rad/s], in rad/N.m."""
    inertia, viscosity, stiffness, spring, damping = impedance
    real = spring + stiffness - inertia * omega * omega
    imaginary = (damping + viscosity) * omega
    square = real * real + imaginary * imaginary
    return complex(real / square, -imaginary / square)


@njit(cache=True, nogil=True, error_model="numpy")
def foot_spectra(
    plate: np.ndarray, push: np.ndarray, step: float, impedance: np.ndarray
) -> np.ndarray:
    """Return the spectra of position, velocity and acceleration of the foot, shape (3, m).

    Parameters
    ----------
    plate
        Spectra of its position, velocity and acceleration, shape (3, m).
    push
        Spectrum of the torque T, shape (m,).
    step
        From one frequency to the next [rad/s]; the first one is zero.
    impedance
        I, B and K of the foot, k_s and b_s of the coupling.
    """
    spring, damping = impedance[3], impedance[4]
    found = np.empty(plate.shape, plate.dtype)
    for k in range(push.size):
        omega = k * step
        gives = _gives(omega, impedance)
        driven, pushed = complex(spring, damping * omega) * gives, push[k] * gives
        found[0, k] = plate[0, k] * driven - pushed
        found[1, k] = plate[1, k] * driven - pushed * complex(0.0, omega)
        found[2, k] = plate[2, k] * driven + pushed * (omega * omega)
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def foot_torque_spectrum(
    plate: np.ndarray, push: np.ndarray, step: float, impedance: np.ndarray, of: np.ndarray
) -> np.ndarray:
    """Return the spectrum of the torque of an impedance on the foot's motion, shape (m,).

    Parameters
    ----------
    plate, push, step, impedance
        As `foot_spectra` takes them.
    of
        Inertia, viscosity and stiffness of the impedance whose torque is wanted.
    """
    spring, damping = impedance[3], impedance[4]
    found = np.empty(push.size, plate.dtype)
    for k in range(push.size):
        omega = k * step
        gives = _gives(omega, impedance)
        moved = of[0] * plate[2, k] + of[1] * plate[1, k] + of[2] * plate[0, k]
        held = complex(of[2] - of[0] * omega * omega, of[1] * omega)
        found[k] = (moved * complex(spring, damping * omega) - push[k] * held) * gives
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def passed_share(frequency: np.ndarray, impedance: np.ndarray) -> np.ndarray:
    """Return the share of the plate's motion that reaches the foot, complex, shape (m,).

    Parameters
    ----------
    frequency
        [Hz], shape (m,).
    impedance
        As `foot_spectra` takes it.
    """
    spring, damping = impedance[3], impedance[4]
    found = np.empty(frequency.size, np.complex128)
    for k in range(frequency.size):
        omega = 2.0 * np.pi * frequency[k]
        gives = _gives(omega, impedance)
        found[k] = complex(spring, damping * omega) * gives
    return found
