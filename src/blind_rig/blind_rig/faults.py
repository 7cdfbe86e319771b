"""Broken rigs: what goes wrong between sensor and disk, so that a recording must not be explained
by physics.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from blind_rig.trial import Recording

# A clock difference that is a fault, not a finding: beyond the 20 ms up to which a lag can be
# named.
CLOCK_DIFFERENCE = (0.025, 0.060)


def _torque_sign(r: Recording, generator: np.random.Generator) -> Recording:
    return r._replace(torque=-r.torque)


def _position_sign(r: Recording, generator: np.random.Generator) -> Recording:
    return r._replace(position=-r.position)


def _torque_in_millinewtonmetres(r: Recording, generator: np.random.Generator) -> Recording:
    return r._replace(torque=r.torque * 1000.0)


def _position_in_degrees(r: Recording, generator: np.random.Generator) -> Recording:
    return r._replace(position=np.degrees(r.position), velocity=np.degrees(r.velocity))


def _torque_dead(r: Recording, generator: np.random.Generator) -> Recording:
    dead = r.torque.copy()
    start = int(generator.uniform(0.0, 0.5) * len(dead))
    dead[start:] = dead[:start].mean() if start else 0.0
    dead[start:] += 1e-3 * generator.standard_normal(len(dead) - start)
    return r._replace(torque=dead)


def _torque_saturated(r: Recording, generator: np.random.Generator) -> Recording:
    # The amplifier's limit lies inside the range that the trial needs.
    low, high = np.quantile(
        r.torque, [generator.uniform(0.02, 0.10), generator.uniform(0.80, 0.92)]
    )
    return r._replace(torque=np.clip(r.torque, low, high))


def _encoder_stuck(r: Recording, generator: np.random.Generator) -> Recording:
    position, n = r.position.copy(), len(r.position)
    for start in generator.uniform(0.1, 0.85, int(generator.integers(2, 5))):
        first = int(start * n)
        last = first + int(generator.uniform(0.03, 0.10) * n)
        position[first:last] = position[first]
    return r._replace(position=position)


def _clocks_apart(r: Recording, generator: np.random.Generator) -> Recording:
    step = r.time[1] - r.time[0]
    shift = round(generator.uniform(*CLOCK_DIFFERENCE) / step) * int(generator.choice([-1, 1]))
    late = np.roll(r.torque, shift)
    keep = slice(abs(shift), len(late) - abs(shift))
    return Recording(
        r.time[keep], r.position[keep], r.velocity[keep], late[keep], r.reference[keep], r.emg[keep]
    )


FAULTS: dict[str, Callable[[Recording, np.random.Generator], Recording]] = {
    "torque_sign": _torque_sign,
    "position_sign": _position_sign,
    "torque_in_millinewtonmetres": _torque_in_millinewtonmetres,
    "position_in_degrees": _position_in_degrees,
    "torque_dead": _torque_dead,
    "torque_saturated": _torque_saturated,
    "encoder_stuck": _encoder_stuck,
    "clocks_apart": _clocks_apart,
}


def broken(recording: Recording, fault: str, generator: np.random.Generator) -> Recording:
    """Return the recording as a broken rig would have stored it.

    Raises
    ------
    KeyError
        No such fault.
    """
    return FAULTS[fault](recording, generator)
