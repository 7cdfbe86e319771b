"""A movement of two sines, and integrations along it that share no code with the terms."""

import numpy as np
from scipy.integrate import solve_ivp

RATE = 2048.0
TIME = np.arange(int(RATE)) / RATE


def movement(t):
    """Position, velocity and acceleration of two sines that start at rest."""
    x, v, a = 0.0, 0.0, 0.0
    for size, frequency in ((0.012, 1.3), (0.004, 6.1)):
        w = 2 * np.pi * frequency
        x = x + size * (1 - np.cos(w * t))
        v = v + size * w * np.sin(w * t)
        a = a + size * w**2 * np.cos(w * t)
    return x, v, a


def integrate(right, states):
    return solve_ivp(
        right, [0, TIME[-1]], states, t_eval=TIME, max_step=2e-3, rtol=1e-5, atol=1e-9
    ).y
