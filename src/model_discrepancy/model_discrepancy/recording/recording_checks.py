"""Is the recording usable at all? Faults of the rig end the diagnosis before physics is blamed for
them.

A channel that lags by a few milliseconds or has a wrong gain is a finding, not a fault.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ankle_interfaces.saturation import saturation_sentences
from ankle_physics.joint_profile import joint_in_force
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.spectrum import band, white_density
from model_discrepancy.recording.torque_range import range_sentences
from model_discrepancy.recording.torque_relation import LARGEST_SKEW_S, SHIFTS_S, relation_faults

# The paper's ensembles hold 100 responses in 60 s; a third of that is the least that gives bands.
SHORTEST_S = 20.0
# While the foot moves as usual, torque that falls below this share of its usual size has lost its
# sensor.
DEAD_SHARE = 0.05
_WINDOW_S = 2.0
_LONGEST_FLAT_S = 0.5
# Share of neighbouring samples that are equal: a converter that resolves the noise by one step
# gives up to 0.3.
LARGEST_FLAT_SHARE = 0.3

# A spike bends a channel so many times as much as all but a hundredth of its samples bend, and is
# so many times as large as the channel's median deviation; up to three may be anything.
SPIKE_BENDS, SPIKE_SPREADS, MOST_SPIKES = 40.0, 50.0, 3
# [s] Around a sample in which the plate rests it moves by less than this share of its largest
# movements.
_AROUND_S, REST_SHARE = 0.01, 0.2
# Power of a movement over that of the encoder's noise at a frequency that is compared.
_LEAST_CLEARNESS = 10.0


def faults(recording: Recording) -> list[str]:
    """Return a sentence for each reason why the recording cannot be diagnosed."""
    found = list(recording.faults)
    if not len(recording.position):
        return found
    if recording.duration < SHORTEST_S:
        return [
            *found,
            f"the recording lasts {recording.duration:.1f} s; at least {SHORTEST_S:g} s are needed",
        ]
    channels = recording.channels()
    found += saturation_sentences(channels, recording.reference)
    for column, values in channels.items():
        found += _channel_faults(column.split("[")[0], values, recording.rate)
    if not found:
        found += range_sentences(recording.torque, recording.position, recording.rate)
        found += _spikes(channels, recording)
    if found:
        return found
    found += _movement_faults(recording)
    return found if found else relation_faults(recording)


def _channel_faults(name: str, values: np.ndarray, rate: float) -> list[str]:
    bad = int(np.sum(~np.isfinite(values)))
    if bad:
        return [f"{name} holds {bad} value(s) that are not finite"]
    if np.ptp(values) == 0.0:
        return [f"{name} is dead: constant at {values[0]:g}"]
    found = []
    same = np.diff(values) == 0.0
    longest = _longest_run(same)
    noisy = _is_noisy(values, same)
    if noisy and longest / rate > _LONGEST_FLAT_S:
        found.append(
            f"{name} is stuck: {longest / rate:.2f} s without any change, though it varies "
            "elsewhere"
        )
    return found


def _spikes(channels: dict[str, np.ndarray], recording: Recording) -> list[str]:
    """Return a sentence for each channel that jumps away and back, several times.

    Torque that accelerates the plate as a command jumps does so, too. It counts where the plate
    rests.
    """
    found = []
    for column, values in channels.items():
        name, unit = column.rstrip("]").split("[")
        bend = np.abs(np.diff(values, n=2))
        jumps = bend > SPIKE_BENDS * np.percentile(bend, 99.0)
        if values is recording.torque:
            jumps &= _rests(recording)[1:-1]
        spread = np.median(np.abs(values - np.median(values))) + 1e-12
        if jumps.sum() > MOST_SPIKES and np.ptp(values) > SPIKE_SPREADS * spread:
            found.append(
                f"{name} has {jumps.sum()} spikes: its values span {np.ptp(values):.3g} {unit}"
            )
    return found


def _rests(recording: Recording) -> np.ndarray:
    """Return where the plate hardly moves, bool, shape (n,)."""
    around = max(1, int(_AROUND_S * recording.rate))
    held = np.pad(recording.position, around, mode="edge")
    moved = np.abs(held[2 * around :] - held[: -2 * around])
    return moved < REST_SHARE * np.percentile(moved, 99.0)


def _is_noisy(values: np.ndarray, same: np.ndarray) -> bool:
    """Say whether neighbouring samples differ, as those of a channel with noise do.

    Held steps of a noise-free recording are flat as well. Samples at the extremes do not count: of
    a channel that is saturated half of the time, half are flat. A noise-free movement between two
    levels has few others, and these cannot tell.
    """
    if np.mean(same) < LARGEST_FLAT_SHARE:
        return True
    inside = (values > values.min()) & (values < values.max())
    between = inside[:-1] & inside[1:]
    return bool(
        np.mean(between) > LARGEST_FLAT_SHARE and np.mean(same[between]) < LARGEST_FLAT_SHARE
    )


def _movement_faults(recording: Recording) -> list[str]:
    found = []
    joint = joint_in_force()
    unit = joint.position_unit
    size = float(np.std(band(recording.position, recording.rate, 0.5, 40.0)))
    reach = float(np.ptp(recording.position))
    if reach > joint.largest_range:
        torque = joint.torque_column.split("[")[0]
        reason = (
            f"position and {torque} are swapped, it seems: what is called {torque} suits the "
            "position"
            if _fits_when_swapped(recording)
            else f"probably {'millimetres' if joint.linear else 'degrees'} or a wrong scale, or "
            f"position and {torque} are swapped"
        )
        found.append(
            f"position spans {reach:.3g} {unit}; the {joint.name} moves by "
            f"{joint.largest_range:g} {unit} at most: {reason}"
        )
    elif size < joint.smallest_movement:
        found.append(
            f"no excitation: position moves by {1000 * size:.3g} m{unit} rms; at least "
            f"{1000 * joint.smallest_movement:g} m{unit} are needed"
        )
    if not found:
        found += _lost_torque(recording)
    if recording.velocity is not None and not found:
        v, d = _clear_velocities(recording, recording.velocity)
        lag, strength = _best_lag(v, d, recording.rate)
        gain = float(v @ d / (d @ d))
        if strength < -0.5:
            found.append("velocity has the wrong sign: it falls while position rises")
        elif strength < 0.5:
            found.append(
                f"velocity does not belong to position: correlation {strength:.2f} with the "
                "derivative of position"
            )
        elif abs(lag) > LARGEST_SKEW_S:
            found.append(
                f"the clocks of velocity and position are {1000 * lag:.0f} ms apart; at most "
                f"{1000 * LARGEST_SKEW_S:g} ms"
            )
        elif not 0.5 < gain < 2.0:
            found.append(f"velocity is {gain:.3g} times the derivative of position: a wrong unit")
    return found


def _clear_velocities(recording: Recording, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the velocity channel and the derivative of position, each shape (n,), at frequencies
    of 0.2 to 30 Hz where the movement is clearer than the encoder's noise, which a derivative
    magnifies; at all above 1 Hz where it is clear nowhere.
    """
    rate, count = recording.rate, len(velocity)
    f = np.fft.rfftfreq(count, 1.0 / rate)
    own, other = (
        np.fft.rfft(signal - signal.mean())
        for signal in (np.gradient(recording.position) * rate, velocity)
    )
    noise = 0.5 * white_density(recording.position, rate) * rate * count * (2.0 * np.pi * f) ** 2
    clear = (f > 0.2) & (f < 30.0) & (np.abs(own) ** 2 > _LEAST_CLEARNESS * noise)
    kept = clear if clear.any() else (f > 1.0) & (f < 30.0)
    return np.fft.irfft(other * kept, count), np.fft.irfft(own * kept, count)


def _lost_torque(recording: Recording) -> list[str]:
    """Return a sentence on windows in which the foot moves and the torque no longer follows."""
    size = int(_WINDOW_S * recording.rate)
    moved, measured = (
        np.std(
            band(channel, recording.rate, 3.0, 40.0)[: len(channel) // size * size].reshape(
                -1, size
            ),
            axis=1,
        )
        for channel in (recording.position, recording.torque)
    )
    # Where movements are rare, the foot rests in most windows.
    usual = max(np.percentile(moved, 90.0), 0.2 * moved.max())
    lost = (moved > 0.5 * usual) & (measured < DEAD_SHARE * np.percentile(measured, 90.0))
    if lost.sum() < 2:
        return []
    return [
        f"torque is dead during {_WINDOW_S * lost.sum():.0f} s, first at "
        f"{_WINDOW_S * np.argmax(lost):.0f} s, while the foot moves"
    ]


def _fits_when_swapped(recording: Recording) -> bool:
    """Say whether the torque has the range of a position, and follows from it as the position would
    as a torque.
    """
    joint = joint_in_force()
    moved = float(np.std(band(recording.torque, recording.rate, 0.5, 40.0)))
    if np.ptp(recording.torque) > joint.largest_range or moved < joint.smallest_movement:
        return False
    swapped = replace(
        recording, position=recording.torque, torque=recording.position, velocity=None
    )
    return not relation_faults(swapped)


def _best_lag(later: np.ndarray, earlier: np.ndarray, rate: float) -> tuple[float, float]:
    """Return the lag [s] of `later` behind `earlier` at their strongest correlation, with it."""
    shifts = np.round(SHIFTS_S * rate).astype(int)
    values = np.array([np.corrcoef(np.roll(later, -s), earlier)[0, 1] for s in shifts])
    best = int(np.argmax(np.abs(values)))
    return float(SHIFTS_S[best]), float(values[best])


def _longest_run(flags: np.ndarray) -> int:
    """Return the length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return int(np.max(edges[1::2] - edges[::2])) if len(edges) else 0
