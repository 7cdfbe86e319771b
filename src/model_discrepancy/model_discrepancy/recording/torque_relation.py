"""Sign, unit and clock of the torque: whether it follows the movement as that of a joint would.

A channel that lags by a few milliseconds is a finding, not a fault.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.optimize import nnls
from scipy.signal import bilinear, lfilter

from ankle_physics.joint_profile import joint_in_force
from ankle_physics.reflex_arc import late_stretches
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.spectrum import band

# Beyond this two clocks are apart, below it a channel lags.
LARGEST_SKEW_S = 0.020
# Torque of which movement explains less than this in 3-40 Hz is not the torque of this joint: that
# of another recording of 60 s, or shifted by seconds, is explained to 1 % at most, and a reflex
# that is large beside the intrinsic torque leaves 11 % of a good one.
LEAST_VAF = 0.05
# A first-order filter up to this slow is a lag of the torque channel, which is a finding, and not a
# clock that is off.
_LAGS_S = (0.005, 0.01, 0.015, 0.02)
# Share of the VAF at the best skew: a recording of which as much is explained without one has none.
UNSKEWED_VAF_RATIO = 0.8
# A passive joint that explains less than this does not tell the sign: reflexes make the torque. In
# 228 recordings of the independent rig, 22 of them below it, a joint with reflexes explains at
# least 29 % of VAF more of the torque than of the mirrored one.
PASSIVE_VAF = 0.3
_WRONG_SIGN = (
    "torque or position has the wrong sign: torque falls as the foot is moved upwards; "
    "positive is dorsiflexion for both"
)
SHIFTS_S = np.arange(-0.15, 0.1501, 0.001)
# A joint with reflexes is tried at each fifth of these: its torque changes over tens of ms.
_SHIFTS_PER_TRY = 5
# Reflexes of short and long latency, and a muscle's own time.
_REFLEX_DELAYS_S = (0.04, 0.09)
_MUSCLE_S = 0.045
# Resonances of straps, plate and sensor that the band of 3 to 40 Hz shows.
_MODES_HZ = (12.0, 15.0, 19.0, 24.0, 30.0, 40.0, 55.0)
_MODE_DAMPINGS = (0.05, 0.2)


def relation_faults(recording: Recording) -> list[str]:
    """Return a sentence where torque does not follow position, by the intrinsic model in 3-40 Hz.

    Parameters
    ----------
    recording
        Of which each channel by itself has no fault.
    """
    step = max(1, int(recording.rate // 250.0))
    rate = recording.rate
    x = band(recording.position, rate, 3.0, 40.0)
    v = np.gradient(x) * rate
    a = np.gradient(v) * rate
    t = band(recording.torque, rate, 3.0, 40.0)
    inner = slice(int(0.5 * rate), -int(0.5 * rate), step)
    vafs, models = [], []
    columns = np.column_stack([a, v, x])
    lagging_vaf, lagging_inertia = _lagging(columns, t, inner, rate)
    for shift in SHIFTS_S:
        moved = np.roll(t, -round(shift * rate))[inner]
        model, *_ = np.linalg.lstsq(columns[inner], moved, rcond=None)
        vafs.append(1.0 - np.var(moved - columns[inner] @ model) / np.var(moved))
        models.append(model)
    near = np.abs(SHIFTS_S) <= LARGEST_SKEW_S
    inside = int(np.argmax(np.where(near, vafs, -1.0)))
    # The mirrored joint, with a negative inertia, is not a lag: only shifts with a positive one
    # count.
    positive = np.array([model[0] > 0 for model in models])
    best = int(np.argmax(np.where(positive | near, vafs, -1.0)))
    if vafs[best] < LEAST_VAF:
        reason = (
            f"movement explains {100 * max(vafs[best], 0.0):.0f} % of the torque (3-40 Hz); at "
            f"least {100 * LEAST_VAF:g} % expected"
        )
        joint = joint_in_force()
        if np.std(x) < joint.smallest_movement:
            reason += (
                f", but the movement is slow: {1000 * np.std(x):.2g} m{joint.position_unit} rms "
                "above 3 Hz, which neither inertia nor reflex answers; steps or pulses are needed"
            )
        return [reason]
    if (
        not near[best]
        and vafs[best] > max(vafs[inside], lagging_vaf) + 0.05
        and _ringing_vaf(columns, t, inner, rate, SHIFTS_S[best])
        > _ringing_vaf(columns, t, inner, rate, SHIFTS_S[inside]) + 0.05
        and _reacting_vaf(columns, t, inner, rate, SHIFTS_S[best])
        > _reacting_vaf(columns, t, inner, rate, SHIFTS_S[inside]) - 0.05
    ):
        return [_apart(SHIFTS_S[best])]
    moved = np.roll(t, -round(SHIFTS_S[inside] * rate))[inner]
    # A passive joint has no negative inertia, viscosity or stiffness: which sign of torque can one
    # explain? Torque that moved the plate looks mirrored at some skew: the recording as it stands
    # decides, where a passive joint explains nearly as much of that as at the best skew.
    signs = [
        [_passive_vaf(columns, sign * t, inner, rate, skew) for sign in (1.0, -1.0)]
        for skew in (0.0, SHIFTS_S[inside])
    ]
    right, mirrored = signs[0] if max(signs[0]) > UNSKEWED_VAF_RATIO * vafs[inside] else signs[1]
    # A late reflex behind late torque looks mirrored at the best skew and upright as it stands.
    if mirrored > right + 0.05 and signs[0][1] >= signs[0][0]:
        return _sign_faults(recording, columns, t, inner)
    if max(right, mirrored) < PASSIVE_VAF:
        resisting = np.hstack([columns, _reflexes(recording)])
        right, mirrored = _both_signs(resisting, t, inner, rate)
        if mirrored > right + 0.05:
            return [_WRONG_SIGN]
    joint = joint_in_force()
    low, high = joint.inertia_range
    inertia = models[inside][0]
    # Compliance between sensor and foot may hide the inertia in this band, down to a negative one.
    # Slow movements leave inertia to reflexes and chance: only where all models agree it tells the
    # unit. A late reflex looks like a skew, so that the recording as it stands counts, too. A slow
    # channel takes its lag times the viscosity from the inertia.
    resisting = np.hstack([columns, _reflexes(recording)])[inner]
    inertias = [
        inertia,
        lagging_inertia,
        _viscoelastic_inertia(columns, moved, inner, rate),
        *(np.linalg.lstsq(resisting, torque, rcond=None)[0][0] for torque in (moved, t[inner])),
    ]
    if inertia > 0 and (max(inertias) < low or min(inertias) > high):
        word, unit = ("mass", "kg") if joint.linear else ("inertia", "kg.m^2")
        return [
            f"wrong unit or gain of {joint.torque_column.split('[')[0]} or position: {word} "
            f"{inertia:.3g} {unit} is outside {low:g} to {high:g} {unit} (joint: {joint.name}; "
            "another joint by --joint)"
        ]
    return []


def _sign_faults(
    recording: Recording, columns: np.ndarray, torque: np.ndarray, inner: slice
) -> list[str]:
    """Return what is wrong with a recording whose mirrored torque a passive joint explains better.

    The sign is that of a joint with reflexes; the torque may be late, too.
    """
    rate = recording.rate
    resisting = np.hstack([columns, _reflexes(recording)])
    right, mirrored = _both_signs(resisting, torque, inner, rate)
    if right < mirrored + 0.05:
        return [_WRONG_SIGN]
    shifts = SHIFTS_S[::_SHIFTS_PER_TRY]
    vafs = [_passive_vaf(resisting, torque, inner, rate, shift) for shift in shifts]
    best = int(np.argmax(vafs))
    if abs(shifts[best]) > LARGEST_SKEW_S and vafs[best] > right + 0.05:
        return [_apart(shifts[best])]
    return []


def _apart(skew: float) -> str:
    """Return the sentence about two clocks; the skew [s] is that of torque behind position."""
    torque = joint_in_force().torque_column.split("[")[0]
    return (
        f"the clocks are apart: {torque} comes {1000 * abs(skew):.0f} ms "
        f"{'after' if skew > 0.0 else 'before'} the position; allowed: "
        f"{1000 * LARGEST_SKEW_S:g} ms at most"
    )


def _both_signs(
    resisting: np.ndarray, torque: np.ndarray, inner: slice, rate: float
) -> tuple[float, float]:
    """Return how much of the torque, and of the mirrored torque, what resists a movement explains.

    Beside a reflex that is large, a passive joint explains little of either.
    """
    right, mirrored = (
        _passive_vaf(resisting, sign * torque, inner, rate, 0.0) for sign in (1.0, -1.0)
    )
    return right, mirrored


def _reflexes(recording: Recording) -> np.ndarray:
    """Return the torque of reflexes of short and long latency in both muscles, each against its
    stretch, per unit of its gain, shape (n, 4).
    """
    rate = recording.rate
    velocity = np.gradient(band(recording.position, rate, 0.5, 40.0)) * rate
    found = []
    for delay, sign in product(_REFLEX_DELAYS_S, (1.0, -1.0)):
        late = sign * np.roll(np.maximum(sign * velocity, 0.0), round(delay * rate))
        torque = _relaxed(_relaxed(late, _MUSCLE_S, rate), _MUSCLE_S, rate)
        found.append(band(torque, rate, 3.0, 40.0))
    return np.column_stack(found)


def _passive_vaf(
    columns: np.ndarray, torque: np.ndarray, inner: slice, rate: float, skew: float
) -> float:
    """Return the VAF of torques per unit of what is not negative, inertia, viscosity, stiffness and
    reflexes, at a skew [s].
    """
    moved = np.roll(torque, -round(skew * rate))[inner]
    scaled = columns[inner] / np.linalg.norm(columns[inner], axis=0)
    return 1.0 - float(nnls(scaled, moved)[1] ** 2 / (moved @ moved))


def _lagging(
    columns: np.ndarray, torque: np.ndarray, inner: slice, rate: float
) -> tuple[float, float]:
    """Return the best VAF of inertia, viscosity and stiffness behind a first-order filter, and the
    inertia of that model [kg.m^2].
    """
    tried = []
    for lag in _LAGS_S:
        lagging = _relaxed(columns, lag, rate)[inner]
        model, *_ = np.linalg.lstsq(lagging, torque[inner], rcond=None)
        vaf = 1.0 - np.var(torque[inner] - lagging @ model) / np.var(torque[inner])
        tried.append((float(vaf), float(model[0])))
    return max(tried)


def _ringing_vaf(
    columns: np.ndarray, torque: np.ndarray, inner: slice, rate: float, skew: float
) -> float:
    """Return the best VAF of a joint with reflexes of both muscles behind a resonance: what rings,
    or answers late, is shifted in time as little as clocks that are.

    Parameters
    ----------
    columns
        Acceleration, velocity and position, shape (n, 3).
    torque
        Shape (n,).
    inner
        Samples that count.
    rate
        [Hz].
    skew
        Of the torque behind the position, which is taken out [s].
    """
    torque = np.roll(torque, -round(skew * rate))
    velocity = columns[:, 1]
    reflexes = []
    for delay in _REFLEX_DELAYS_S:
        shift = round(delay * rate)
        for sign in (1.0, -1.0):
            late = np.roll(np.maximum(sign * velocity, 0.0), shift)[:, None]
            reflexes.append(_relaxed(_relaxed(late, _MUSCLE_S, rate), _MUSCLE_S, rate))
    joint = np.hstack([columns, *reflexes])
    vafs = []
    for frequency, damping in ((0.0, 0.0), *product(_MODES_HZ, _MODE_DAMPINGS)):
        seen = joint if frequency == 0.0 else _resonating(joint, frequency, damping, rate)
        seen = seen[inner]
        model, *_ = np.linalg.lstsq(seen, torque[inner], rcond=None)
        vafs.append(1.0 - np.var(torque[inner] - seen @ model) / np.var(torque[inner]))
    return float(max(vafs))


def _reacting_vaf(
    columns: np.ndarray, torque: np.ndarray, inner: slice, rate: float, skew: float
) -> float:
    """Return the VAF of a joint whose reflexes answer stretches of either direction in any way, at
    a skew [s]: strong late reflexes look like clocks that are apart, but a joint with inertia
    resists at once.
    """
    joint = np.column_stack([columns, *late_stretches(columns[:, 1], rate)])[inner]
    moved = np.roll(torque, -round(skew * rate))[inner]
    model, *_ = np.linalg.lstsq(joint, moved, rcond=None)
    return float(1.0 - np.var(moved - joint @ model) / np.var(moved))


def _resonating(signals: np.ndarray, frequency: float, damping: float, rate: float) -> np.ndarray:
    """Return the signals (n, columns) behind a second-order mode with unit gain at rest."""
    omega = 2.0 * np.pi * frequency
    b, a = bilinear([omega**2], [1.0, 2.0 * damping * omega, omega**2], fs=rate)
    return np.asarray(lfilter(b, a, signals, axis=0))


def _viscoelastic_inertia(
    columns: np.ndarray, moved: np.ndarray, inner: slice, rate: float
) -> float:
    """Return the inertia [kg.m^2] where a tendon or tissue that relaxes would hide it from inertia,
    viscosity and stiffness alone.
    """
    position = columns[:, 2:]
    wide = np.hstack(
        [columns, *(_relaxed(position, lag, rate) for lag in (_LAGS_S[0], _LAGS_S[-1]))]
    )[inner]
    return float(np.linalg.lstsq(wide, moved, rcond=None)[0][0])


def _relaxed(signals: np.ndarray, time: float, rate: float) -> np.ndarray:
    """Return the signals (n, columns) behind a first-order filter with this time constant [s]."""
    share = np.exp(-1.0 / (rate * time))
    return lfilter([1.0 - share], [1.0, -share], signals, axis=0)
