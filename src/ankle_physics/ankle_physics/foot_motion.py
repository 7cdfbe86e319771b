"""Motion of a foot behind a coupling whose stiffness depends on its extension.

``I a + B v + K x + T = S(plate - foot) + b_s (plate' - foot')``, with the torque T of all else that
acts on the foot given. With ``S(u) = k u + e(u)``, the equation is
linear but for the excess e. The linear part is advanced exactly for a plate that moves on a cubic
between two samples; the excess is taken as linear over a step (exponential integrator; Hochbruck &
Ostermann 2010, Acta Numerica 19, 209), and its value at the end of the step is found by Newton's
method.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from scipy.linalg import expm

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.term import Values

# Only the excess is taken as linear over a step: at 1 kHz one of 60 Hz is off by 1 %.
STEP_RATE = 1000.0  # Hz
# Points of the coupling's curve; between them it is straight, so that a curvature within its range
# is off by less than 1e-5.
CURVE_POINTS = 2001
# A lightly damped foot swings over the plate's movement by this at most.
OVERSHOOT = 3.0
# A fit may try none; the lightest foot has hundreds of times this.
LEAST_INERTIA = 1e-5  # kg.m^2
# A curve without corners needs two steps of Newton's method; one with a corner may go to and fro.
MOST_ROUNDS = 5


def foot_motion(
    coupling: CompliantCoupling,
    values: Values,
    impedance: tuple[float, float, float],
    plate: tuple[np.ndarray, np.ndarray],
    rate: float,
    push: np.ndarray | None = None,
) -> np.ndarray:
    """Return the position, velocity and acceleration of the foot, shape (3, n).

    Parameters
    ----------
    coupling
        Between plate and foot.
    values
        Parameter values of the coupling.
    impedance
        Inertia [kg.m^2], viscosity [N.m.s/rad] and stiffness [N.m/rad] of the foot.
    plate
        Position about its mean [rad] and velocity [rad/s] of the plate, each of shape (n,).
    rate
        Of the samples [Hz].
    push
        Torque against the foot's movement that its impedance does not make [N.m], shape (n,),
        straight between samples; None for none.
    """
    position, velocity = (np.ascontiguousarray(signal, dtype=float) for signal in plate)
    reach = max(OVERSHOOT * float(np.max(np.abs(position))), 1e-6)
    extension = np.linspace(-reach, reach, CURVE_POINTS)
    spring, damping = coupling.linearised(values)
    excess = coupling.coupling_torque(extension, np.zeros(CURVE_POINTS), values)
    excess = np.asarray(excess - spring * extension)
    substeps = max(1, math.ceil(STEP_RATE / rate))
    inertia, viscosity, stiffness = impedance
    linear = np.array([max(inertia, LEAST_INERTIA), viscosity, stiffness, spring, damping])
    step = _step(linear, 1.0 / (rate * substeps))
    # On each straight piece, the end of a step follows from the extension without the excess.
    slope = np.diff(excess) / np.diff(extension)
    pieces = np.stack([excess[:-1] - slope * extension[:-1], slope]) / (1.0 + slope * step[0, 7])
    return np.asarray(
        _integrate(
            position,
            velocity,
            np.zeros(len(position)) if push is None else np.ascontiguousarray(push, dtype=float),
            1.0 / rate,
            substeps,
            linear,
            step,
            reach,
            pieces,
        )
    )


def _step(linear: np.ndarray, dt: float) -> np.ndarray:
    """Return the rows of foot and foot' after dt from foot, foot', plate and plate' now and then,
    and excess now and then, shape (2, 8).

    Parameters
    ----------
    linear
        I, B, K of the foot, k and b of the coupling.
    dt
        [s].
    """
    inertia, viscosity, stiffness, spring, damping = linear
    # Foot and foot', plate and its three derivatives, excess and its derivative; time in steps.
    system = np.zeros((8, 8))
    system[0, 1] = dt
    system[1, :4] = (
        dt / inertia * np.array([-stiffness - spring, -viscosity - damping, spring, damping / dt])
    )
    system[1, 6] = dt / inertia
    for place in (2, 3, 4, 6):
        system[place, place + 1] = 1.0
    grown = expm(system)[:2]
    # The plate's cubic from both ends (Hermite).
    ends = np.zeros((8, 8))
    ends[0, 0] = ends[1, 1] = ends[2, 2] = ends[6, 6] = 1.0
    ends[3, 3] = dt
    ends[4, 2:6] = -6.0, -4.0 * dt, 6.0, -2.0 * dt
    ends[5, 2:6] = 12.0, 6.0 * dt, -12.0, 6.0 * dt
    ends[7, 6:] = -1.0, 1.0
    return np.ascontiguousarray(grown @ ends)


@njit(cache=True, nogil=True)
def _advanced(
    row: np.ndarray,
    x: float,
    v: float,
    p: float,
    w: float,
    p_next: float,
    w_next: float,
    e: float,
) -> float:
    """Return what a row of `_step` makes of all but the excess at the end of the step."""
    return float(
        row[0] * x
        + row[1] * v
        + row[2] * p
        + row[3] * w
        + row[4] * p_next
        + row[5] * w_next
        + row[6] * e
    )


@njit(cache=True, nogil=True)
def _integrate(
    plate: np.ndarray,
    plate_rate: np.ndarray,
    push: np.ndarray,
    dt: float,
    substeps: int,
    linear: np.ndarray,
    step: np.ndarray,
    reach: float,
    pieces: np.ndarray,
) -> np.ndarray:
    out = np.empty((3, plate.size))
    inertia, viscosity, stiffness, spring, damping = linear
    count = pieces.shape[1]
    scale = count / (2.0 * reach)
    x, v = plate[0], 0.0
    p, w, e = plate[0], plate_rate[0], 0.0
    out[0, 0], out[1, 0], out[2, 0] = x, v, 0.0
    for k in range(1, plate.size):
        for part in range(1, substeps + 1):
            u = part / substeps
            p_next, w_next = plate[k], plate_rate[k]
            if part < substeps:
                rise = plate[k] - plate[k - 1]
                first, last = dt * plate_rate[k - 1], dt * plate_rate[k]
                bend, twist = 3.0 * rise - 2.0 * first - last, first + last - 2.0 * rise
                p_next = plate[k - 1] + u * (first + u * (bend + u * twist))
                w_next = (first + u * (2.0 * bend + 3.0 * u * twist)) / dt
            t = push[k - 1] + (push[k] - push[k - 1]) * (part - 1) / substeps
            t_next = push[k - 1] + (push[k] - push[k - 1]) * u
            x_free = _advanced(step[0], x, v, p, w, p_next, w_next, e - t) - step[0, 7] * t_next
            v_free = _advanced(step[1], x, v, p, w, p_next, w_next, e - t) - step[1, 7] * t_next
            free, piece = p_next - x_free, -1
            for _ in range(MOST_ROUNDS):
                place = (free - step[0, 7] * e + reach) * scale
                found = min(max(int(place), 0), count - 1)
                if found == piece:
                    break
                piece = found
                e = pieces[0, piece] + pieces[1, piece] * free
            x, v, p, w = x_free + step[0, 7] * e, v_free + step[1, 7] * e, p_next, w_next
        out[0, k], out[1, k] = x, v
        out[2, k] = (
            spring * (p - x) + damping * (w - v) + e - push[k] - viscosity * v - stiffness * x
        ) / inertia
    return out
