"""How a drive answers a load: a mass on the stiffness and damping of its controller, with dry
friction.

Under a torque T the plate of a drive of mass J, whose controller holds it by a stiffness K and a
damping B, moves by ``-T / (J s² + B s + K)``. Dry friction of its bearings and gears loads it, too:
by ``F tanh(v / v0)``, which follows the direction of its movement (Armstrong-Hélouvry, Dupont &
Canudas de Wit 1994, Automatica 30, 1083). Where that is left out, the response to the load has to
explain it, and is wrong by half and more above 10 Hz.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import rfft, rfftfreq
from scipy.optimize import minimize

from model_discrepancy.recording.spectrum import Spectrum

# Drives of ankle rigs: from a soft, heavy one to one whose current loop is all that is seen.
FREQUENCY_HZ = (5.0, 150.0)
# Controllers are tuned to 0.5 to 1; the mass of a geared drive rings, a slow current loop damps.
DAMPING = (0.1, 10.0)
# Speed v0 within which its friction changes its direction: from that of an encoder's noise to a
# tenth of a fast movement's. A search begins between the two.
TURNING_SPEED = (0.002, 0.1)  # rad/s
_FIRST_TURNING_SPEED = 0.01  # rad/s
# Logarithms of frequency and damping where a search may begin, by damping: a drive that rings and
# one that creeps may both explain a position nearly as well.
STARTS = [
    [np.log([frequency, damping]) for frequency in (8.0, 14.0, 24.0, 40.0, 70.0, 120.0)]
    for damping in (0.3, 0.8, 1.5, 4.0)
]
# Of a search from one start; on recordings of another engine most ended after 16 to 46.
_EVALUATIONS = 60
# Below, a servo that settles slowly says more about itself than about its load.
_LOWEST_HZ = 0.3
# Edges of the recording in the frequency domain, long against the response of the drive.
_TAPER_S = 0.5


@dataclass(frozen=True)
class DriveMode:
    """Describes a mass on a spring and a damper.

    Attributes
    ----------
    frequency
        Natural frequency [Hz].
    damping
        Damping ratio [1].
    """

    frequency: float
    damping: float

    def response(self, frequency: np.ndarray) -> np.ndarray:
        """Return the response at each frequency [Hz] over that at rest, complex."""
        s = 1j * frequency / self.frequency
        return np.asarray(1.0 / (1.0 + 2.0 * self.damping * s + s**2))

    @property
    def likely(self) -> bool:
        """Tell whether a controller may have it: none lets its mass ring so, or is so slow. A
        frequency at the upper end of its range is that of a spring without a mass.
        """
        return self.frequency > 1.01 * FREQUENCY_HZ[0] and self.damping > 1.01 * DAMPING[0]


def friction_column(
    velocity: np.ndarray, turning: float, rate: float, mode: DriveMode
) -> np.ndarray:
    """Return what dry friction of 1 N.m does to a drive of 1 N.m/rad [rad], shape (n,).

    Parameters
    ----------
    velocity
        Of the plate [rad/s], shape (n,).
    turning
        Speed within which friction changes its direction [rad/s].
    rate
        Of the samples [Hz].
    mode
        Of the drive.
    """
    spectrum = Spectrum(np.tanh(velocity / turning), rate, 1)
    return spectrum.read(mode.response(spectrum.frequency))


def best_mode(
    position: np.ndarray,
    following: np.ndarray,
    loaded: Callable[[DriveMode], np.ndarray],
    velocity: np.ndarray,
    rate: float,
    limit: float,
    inner: np.ndarray,
) -> tuple[DriveMode, float]:
    """Return the mode of a drive, and the speed within which its friction turns [rad/s], with which
    command, load and friction explain the position best.

    Parameters
    ----------
    position
        Of the plate [rad], shape (n,).
    following
        What the command may make of it, shape (n, p).
    loaded
        Returns what the load makes of it with a mode, shape (n, q).
    velocity
        Of the plate [rad/s], shape (n,).
    rate
        Of the samples [Hz].
    limit
        Highest frequency at which the load acts [Hz].
    inner
        The samples that count, bool, shape (n,): one run.
    """
    inside = np.flatnonzero(inner)
    part = slice(int(inside[0]), int(inside[-1]) + 1)
    count = part.stop - part.start
    edge = min(int(_TAPER_S * rate), count // 4)
    taper = np.ones(count)
    taper[:edge] = np.sin(0.5 * np.pi * (np.arange(edge) + 0.5) / edge) ** 2
    taper[count - edge :] = taper[:edge][::-1]
    frequency = rfftfreq(count, 1.0 / rate)
    acting = (frequency > _LOWEST_HZ) & (frequency < limit)

    def at_frequencies(columns: np.ndarray) -> np.ndarray:
        found = rfft(columns[part] * taper[:, None], axis=0)[acting]
        return np.concatenate([found.real, found.imag])

    known = at_frequencies(following)
    size = np.linalg.norm(known, axis=0)
    basis = np.linalg.qr(known[:, size > 0.0] / size[size > 0.0])[0]

    def beside(columns: np.ndarray) -> np.ndarray:
        values = at_frequencies(columns)
        return values - basis @ (basis.T @ values)

    wanted = beside(position[:, None])[:, 0]

    def left(point: np.ndarray) -> float:
        mode = mode_at(point)
        dry = friction_column(velocity, _turning_at(point), rate, mode)
        offered = beside(np.column_stack([loaded(mode), dry]))
        size = np.linalg.norm(offered, axis=0)
        offered = offered / np.where(size > 0.0, size, 1.0)
        found = np.linalg.lstsq(offered, wanted, rcond=1e-9)[0]
        return float(np.sum((wanted - offered @ found) ** 2))

    turning = np.log(_FIRST_TURNING_SPEED)
    best = least_point(left, [[np.append(start, turning) for start in some] for some in STARTS])
    return mode_at(best), _turning_at(best)


def least_point(
    left: Callable[[np.ndarray], float], starts: Sequence[Sequence[np.ndarray]]
) -> np.ndarray:
    """Return the point at which a positive function is least, from the two best of the best starts
    of each group on.

    Parameters
    ----------
    left
        The function, of points of shape (p,).
    starts
        Where the search may begin, in groups that may end at different points.
    """
    begun = sorted((min(some, key=left) for some in starts), key=left)[:2]
    return min((_least_from(start, left) for start in begun), key=left)


def _least_from(start: np.ndarray, left: Callable[[np.ndarray], float]) -> np.ndarray:
    """Return the point at which a positive function is least, from one start on (Nelder & Mead
    1965, Computer J. 7, 308).
    """
    # Beside a start, the function is smooth over a quarter of an octave.
    simplex = np.vstack([start, start + 0.25 * np.eye(len(start))])
    options = {"maxfev": _EVALUATIONS, "xatol": 0.02, "fatol": 1e-4, "initial_simplex": simplex}
    found = minimize(
        lambda point: np.log(left(point)), start, method="Nelder-Mead", options=options
    )
    return np.asarray(found.x)


def mode_at(point: np.ndarray) -> DriveMode:
    """Return the mode at the logarithms of its frequency [Hz] and damping, within their ranges."""
    frequency, damping = (
        float(np.clip(np.exp(value), *bounds))
        for value, bounds in zip(point[:2], (FREQUENCY_HZ, DAMPING), strict=True)
    )
    return DriveMode(frequency, damping)


def _turning_at(point: np.ndarray) -> float:
    """Return the speed within which friction turns [rad/s] at its logarithm, within its range."""
    return float(np.clip(np.exp(point[2]), *TURNING_SPEED))
