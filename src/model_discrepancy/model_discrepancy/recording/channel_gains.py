"""Gain and lag of one channel against another that measures the same movement."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from model_discrepancy.recording.clear_movement import clear_spectra
from model_discrepancy.recording.encoder_backlash import encoder_gap, motion_without_backlash
from model_discrepancy.recording.known_rig import SKEW
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.servo import Servo
from model_discrepancy.recording.velocity_coupling import coupling_corner

# Encoders and amplifiers are calibrated to better than this; three standard errors are asked for as
# well.
LEAST_GAIN_ERROR = 0.03
LEAST_LAG_S = 0.001
_COMPARED_HZ = (1.0, 25.0)
# Parts of the recording that tell how much a gain scatters.
_FEWEST_PARTS = 3
SENSOR, BACKLASH = "position sensor", "backlash"
VELOCITY_COUPLING = "velocity_coupling"
VELOCITY_GAIN, POSITION_GAIN, CHANNEL_GAIN = "velocity_gain", "position_gain", "channel_gain"


@dataclass(frozen=True)
class Finding:
    """Describes something that is seen in the signals themselves, without a fit.

    Attributes
    ----------
    name
        ``velocity_gain``, ``position_gain``, ``channel_gain`` (one of the two), ``velocity_lag``,
        ``velocity_coupling``, ``backlash`` (of the encoder) or ``channel_skew``.
    location
        Place in the signal path.
    parameters
        Value and standard error by name with unit.
    sentence
        In plain words with the number.
    siblings
        What else would look the same in this recording.
    """

    name: str
    location: str
    parameters: dict[str, tuple[float, float]]
    sentence: str
    siblings: tuple[str, ...] = ()


def channel_findings(recording: Recording, servo: Servo | None = None) -> list[Finding]:
    """Return the findings from velocity against position, and of both against the command.

    A servo that does not reach its command, or gives way under load, is a property of the rig and
    no finding. A channel is accused only where two others agree against it: position where command
    and velocity do, velocity where command and position do.

    Parameters
    ----------
    recording
        Where velocity was not recorded there are no findings.
    servo
        How position follows the command; None without a command.
    """
    if recording.velocity is None:
        return []
    corner = coupling_corner(recording)
    if corner is not None:
        sentence = (
            f"The velocity channel does not pass movement slower than {corner[0]:.2g} Hz: a "
            "coupling by a capacitor, or a filter."
        )
        return [Finding(VELOCITY_COUPLING, SENSOR, {"corner[Hz]": corner}, sentence)]
    gap = encoder_gap(recording)
    if gap is not None:
        # Backlash also shrinks and delays what position reads; one error, not three.
        sentence = (
            f"Position stands still for {1000 * gap[0]:.2f} mrad at each reversal: backlash "
            "between shaft and encoder."
        )
        return [Finding(BACKLASH, SENSOR, {"gap[rad]": gap}, sentence)]
    gain, gain_error, lag, lag_error = _gain_and_lag(recording)
    found = []
    if abs(gain - 1.0) > max(LEAST_GAIN_ERROR, 3 * gain_error):
        found.append(_disagreement(gain, gain_error, servo))
    if abs(lag) > max(LEAST_LAG_S, 3 * lag_error):
        word = "late" if lag > 0 else "early"
        sentence = f"The velocity channel is {1000 * abs(lag):.1f} ms {word}."
        found.append(Finding("velocity_lag", SENSOR, {"lag[s]": (lag, lag_error)}, sentence))
    return found


def late_finding(late: float, error: float) -> Finding:
    """Return the finding that the torque channel is late.

    Parameters
    ----------
    late, error
        By how much, and the standard error [s].
    """
    word = "later" if late > 0 else "earlier"
    sentence = (
        f"The torque channel is read {1000 * abs(late):.1f} ms {word} than the position channel: "
        "only so does the torque tell how the servo gave way."
    )
    return Finding(SKEW, "torque sensor", {"skew[s]": (late, error)}, sentence)


def trusted(recording: Recording, findings: list[Finding]) -> Recording:
    """Return the recording with its position in true radians, and without a velocity that
    disagrees.
    """
    for finding in findings:
        if finding.name == BACKLASH:
            recording = replace(recording, position=motion_without_backlash(recording))
        elif finding.name == POSITION_GAIN:
            middle = recording.position.mean()
            recording = replace(
                recording,
                position=middle + (recording.position - middle) / finding.parameters["gain[1]"][0],
            )
        recording = replace(recording, velocity=None)
    return recording


def _disagreement(gain: float, error: float, servo: Servo | None) -> Finding:
    """Return which of position and velocity is wrong where velocity reads `gain` times the
    derivative of position.
    """
    if servo is not None:
        follows, spread = servo.following
        tolerance = max(LEAST_GAIN_ERROR, 3.0 * float(np.hypot(spread, error)))
        if abs(follows - 1.0) < tolerance < abs(gain - 1.0):
            sentence = (
                f"The velocity channel reads {gain:.3f} times the true velocity; position agrees "
                "with the command."
            )
            return Finding(VELOCITY_GAIN, SENSOR, {"gain[1]": (gain, error)}, sentence)
        if abs(follows * gain - 1.0) < tolerance < abs(follows - 1.0):
            wrong = (1.0 / gain, error / gain**2)
            sentence = (
                f"Position reads {1.0 / gain:.3f} times the true angle: command and velocity agree "
                "against it."
            )
            return Finding(POSITION_GAIN, SENSOR, {"gain[1]": wrong}, sentence)
    sentence = (
        f"Velocity reads {gain:.3f} times the derivative of position; no third channel tells "
        "which of the two is wrong."
    )
    return Finding(
        CHANNEL_GAIN, SENSOR, {"gain[1]": (gain, error)}, sentence, (VELOCITY_GAIN, POSITION_GAIN)
    )


def _gain_and_lag(recording: Recording) -> tuple[float, float, float, float]:
    """Return the gain and lag of velocity against the derivative of position from their
    cross-spectrum in 1-25 Hz, with standard errors over ten parts; infinite ones where fewer than
    `_FEWEST_PARTS` of these hold a clear movement.
    """
    assert recording.velocity is not None
    gains, lags = [], []
    for part in np.array_split(np.arange(len(recording.position)), 10):
        f, own, other = clear_spectra(recording, recording.velocity, part, _COMPARED_HZ)
        if not len(f):
            continue
        cross = other * np.conj(own)
        # The lag is the slope of the phase, each frequency weighted by its power.
        weight = np.abs(cross) * f
        lag = -float(np.sum(weight * np.angle(cross)) / np.sum(weight * 2 * np.pi * f))
        aligned = cross * np.exp(2j * np.pi * f * lag)
        gains.append(float(np.real(np.sum(aligned)) / np.sum(np.abs(own) ** 2)))
        lags.append(lag)
    if len(gains) < _FEWEST_PARTS:
        return 1.0, np.inf, 0.0, np.inf
    root = np.sqrt(len(gains))
    return (
        float(np.mean(gains)),
        float(np.std(gains) / root),
        float(np.mean(lags)),
        float(np.std(lags) / root),
    )
