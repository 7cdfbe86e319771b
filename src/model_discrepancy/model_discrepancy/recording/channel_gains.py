"""Gain and lag of one channel against another that measures the same movement: named as findings."""  # noqa: E501

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from model_discrepancy.recording.encoder_backlash import encoder_gap, motion_without_play
from model_discrepancy.recording.motion import low_pass
from model_discrepancy.recording.recording import Recording

# Encoders and amplifiers are calibrated to better than this; three standard errors are asked for as
# well.
LEAST_GAIN_ERROR = 0.03
LEAST_LAG_S = 0.001
SENSOR, PLAY = "position sensor", "backlash"


@dataclass(frozen=True)
class Finding:
    """Something that is seen in the signals themselves, without a fit.

    Attributes
    ----------
    name
        ``velocity_gain``, ``velocity_lag``, ``position_gain``, ``backlash`` (of the encoder) or
        ``tremor``.
    location
        Place in the signal path.
    parameters
        Value and standard error by name with unit.
    sentence
        In plain words with the number.
    """

    name: str
    location: str
    parameters: dict[str, tuple[float, float]]
    sentence: str


def channel_findings(recording: Recording) -> list[Finding]:
    """Findings from velocity against position, and position against the reference, where they were
    recorded.
    """
    gap = encoder_gap(recording)
    if gap is not None:
        # Play also shrinks and delays what position reads; one error, not three.
        sentence = (
            f"Position stands still for {1000 * gap[0]:.2f} mrad at each reversal: play "
            "between shaft and encoder."
        )
        return [Finding(PLAY, SENSOR, {"gap[rad]": gap}, sentence)]
    found = []
    position = _position_gain(recording)
    if position is not None:
        found.append(position)
    if recording.velocity is None:
        return found
    gain, gain_error, lag, lag_error = _gain_and_lag(
        recording.position, recording.velocity, recording.rate, derivative=True
    )
    # Where position reads too much against the reference, velocity reads too little against
    # position: one error, not two.
    true_gain = gain if position is None else gain * position.parameters["gain[1]"][0]
    if abs(true_gain - 1.0) > max(LEAST_GAIN_ERROR, 3 * gain_error):
        found.append(
            _gain(
                "velocity_gain",
                true_gain,
                gain_error,
                f"The velocity channel reads {true_gain:.3f} times the true velocity.",
            )
        )
    if abs(lag) > max(LEAST_LAG_S, 3 * lag_error):
        word = "late" if lag > 0 else "early"
        sentence = f"The velocity channel is {1000 * abs(lag):.1f} ms {word}."
        found.append(Finding("velocity_lag", SENSOR, {"lag[s]": (lag, lag_error)}, sentence))
    return found


def trusted(recording: Recording, findings: list[Finding]) -> Recording:
    """The recording with its position in true radians, and without a velocity that disagrees: both
    are merged into one motion.
    """
    for finding in findings:
        if finding.name == PLAY:
            recording = replace(recording, position=motion_without_play(recording))
        elif finding.name == "position_gain":
            middle = recording.position.mean()
            recording = replace(
                recording,
                position=middle + (recording.position - middle) / finding.parameters["gain[1]"][0],
            )
        else:
            recording = replace(recording, velocity=None)
    return recording


def _position_gain(recording: Recording) -> Finding | None:
    """Whether held positions differ from the commanded ones."""
    if recording.reference is None or np.std(recording.reference) == 0:
        return None
    gain, error = _static_gain(recording)
    if abs(gain - 1.0) <= max(LEAST_GAIN_ERROR, 3 * error):
        return None
    sentence = f"Held positions read {gain:.3f} times the commanded ones: a gain error of position."
    return _gain("position_gain", gain, error, sentence)


def _gain(name: str, gain: float, error: float, sentence: str) -> Finding:
    return Finding(name, SENSOR, {"gain[1]": (gain, error)}, sentence)


def _gain_and_lag(
    x: np.ndarray, y: np.ndarray, rate: float, derivative: bool
) -> tuple[float, float, float, float]:
    """Gain and lag of y against x (or its derivative) from the cross-spectrum in 1-25 Hz, with
    standard errors over ten parts.
    """
    parts = np.array_split(np.arange(len(x)), 10)
    gains, lags = [], []
    for part in parts:
        window = np.hanning(len(part))
        f = np.fft.rfftfreq(len(part), 1.0 / rate)
        inside = (f > 1.0) & (f < 25.0)
        fx = np.fft.rfft((x[part] - x[part].mean()) * window)[inside] * (
            2j * np.pi * f[inside] if derivative else 1.0
        )
        fy = np.fft.rfft((y[part] - y[part].mean()) * window)[inside]
        cross = fy * np.conj(fx)
        # The lag is the slope of the phase, each frequency weighted by its power.
        weight = np.abs(cross) * f[inside]
        lag = -float(np.sum(weight * np.angle(cross)) / np.sum(weight * 2 * np.pi * f[inside]))
        gains.append(
            float(
                np.real(np.sum(cross * np.exp(2j * np.pi * f[inside] * lag)))
                / np.sum(np.abs(fx) ** 2)
            )
        )
        lags.append(lag)
    root = np.sqrt(len(parts))
    return (
        float(np.mean(gains)),
        float(np.std(gains) / root),
        float(np.mean(lags)),
        float(np.std(lags) / root),
    )


def _static_gain(recording: Recording) -> tuple[float, float]:
    """Position per reference below 2 Hz, where any actuator follows, with a standard error over ten
    parts.
    """
    reference = recording.reference
    assert reference is not None
    gains = []
    for part in np.array_split(np.arange(len(reference)), 10):
        f = np.fft.rfftfreq(len(part), 1.0 / recording.rate)
        window = np.hanning(len(part))
        r, x = (
            np.fft.rfft((s[part] - s[part].mean()) * window) * low_pass(f, 2.0, 8)
            for s in (reference, recording.position)
        )
        if np.sum(np.abs(r) ** 2) > 0:
            gains.append(float(np.abs(np.sum(x * np.conj(r))) / np.sum(np.abs(r) ** 2)))
    return float(np.mean(gains)), float(np.std(gains) / np.sqrt(len(gains)))
