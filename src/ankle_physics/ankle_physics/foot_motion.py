"""Motion of a foot behind a coupling whose stiffness depends on its extension.

``I a + B v + K x = S(plate - foot) + b_s (plate' - foot')``: the foot without its reflex, whose
torque pushes it aside by some per cent of itself only. Integrated by the average-acceleration
method (Newmark 1959, J. Eng. Mech. Div. ASCE 85, 67) with Newton steps for S.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.term import Values

# At 2 kHz a resonance of 60 Hz is off by 0.3 %.
STEP_RATE = 2000.0  # Hz
# Points of the coupling's curve; between them it is straight, so that a curvature within its range
# is off by less than 1e-5.
CURVE_POINTS = 2001
# A lightly damped foot swings over the plate's movement by this at most.
OVERSHOOT = 3.0


def foot_motion(
    coupling: CompliantCoupling,
    values: Values,
    impedance: tuple[float, float, float],
    plate: tuple[np.ndarray, np.ndarray],
    rate: float,
) -> np.ndarray:
    """Return the position, velocity and acceleration of the foot, shape (3, n).

    Parameters
    ----------
    coupling
        Between plate and foot.
    values
        Of the coupling.
    impedance
        Inertia [kg.m^2], viscosity [N.m.s/rad] and stiffness [N.m/rad] of the foot.
    plate
        Position about its mean [rad] and velocity [rad/s] of the plate, each of shape (n,).
    rate
        Of the samples [Hz].
    """
    position, velocity = (np.ascontiguousarray(signal, dtype=float) for signal in plate)
    reach = max(OVERSHOOT * float(np.max(np.abs(position))), 1e-6)
    extension = np.linspace(-reach, reach, CURVE_POINTS)
    curve = coupling.coupling_torque(extension, np.zeros(CURVE_POINTS), values)
    damping = coupling.linearised(values)[1]
    substeps = max(1, math.ceil(STEP_RATE / rate))
    return np.asarray(
        _integrate(
            position, velocity, 1.0 / rate, substeps, *impedance, damping, reach, np.asarray(curve)
        )
    )


@njit(cache=True)
def _integrate(
    plate: np.ndarray,
    plate_rate: np.ndarray,
    dt: float,
    substeps: int,
    inertia: float,
    viscosity: float,
    stiffness: float,
    damping: float,
    reach: float,
    curve: np.ndarray,
) -> np.ndarray:
    out = np.empty((3, plate.size))
    h = dt / substeps
    spacing = 2.0 * reach / (curve.size - 1)
    x, v, a = plate[0], 0.0, 0.0
    out[:, 0] = x, v, a
    for k in range(1, plate.size):
        for step in range(1, substeps + 1):
            u = step / substeps
            # Cubic between two samples of the plate, by position and velocity.
            p = (
                (1.0 + 2.0 * u) * (1.0 - u) ** 2 * plate[k - 1]
                + u * (1.0 - u) ** 2 * dt * plate_rate[k - 1]
                + u * u * (3.0 - 2.0 * u) * plate[k]
                + u * u * (u - 1.0) * dt * plate_rate[k]
            )
            w = (1.0 - u) * plate_rate[k - 1] + u * plate_rate[k]
            ahead = a
            for _ in range(3):
                x_next = x + h * v + 0.25 * h * h * (a + ahead)
                v_next = v + 0.5 * h * (a + ahead)
                place = (p - x_next + reach) / spacing
                low = min(max(int(place), 0), curve.size - 2)
                slope = curve[low + 1] - curve[low]
                spring = curve[low] + (place - low) * slope
                excess = (
                    inertia * ahead
                    + viscosity * v_next
                    + stiffness * x_next
                    - spring
                    - damping * (w - v_next)
                )
                ahead -= excess / (
                    inertia
                    + 0.5 * h * (viscosity + damping)
                    + 0.25 * h * h * (stiffness + slope / spacing)
                )
            x, v, a = (
                x + h * v + 0.25 * h * h * (a + ahead),
                v + 0.5 * h * (a + ahead),
                ahead,
            )
        out[0, k], out[1, k], out[2, k] = x, v, a
    return out
