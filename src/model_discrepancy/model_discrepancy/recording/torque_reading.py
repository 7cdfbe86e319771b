"""What the torque sensor makes of the torque that acts on the plate, and how to undo it.

A servo that gives way is moved by the torque that acts, not by what a sensor reads late, behind a
lag or amplified by a vibration of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ankle_physics.term import Place, Term, term_library
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.recording.known_rig import SKEW, on_time
from model_discrepancy.recording.spectrum import Spectrum, low_pass

# What is faster is not undone [Hz]: the drive's mass holds it, and it is mostly noise.
_UNDONE_HZ, _UNDONE_ORDER = 100.0, 8
# Of the sensor's gain: where it hardly lets anything pass, undoing would magnify noise.
_LEAST_GAIN = 0.1


def sensor_response(term: Term, frequency: np.ndarray, values: Mapping[str, float]) -> np.ndarray:
    """Return the frequency response of a term at the torque sensor, complex [1], shape (n,).

    Parameters
    ----------
    term
        Acts at the torque sensor.
    frequency
        Where to evaluate it [Hz], shape (n,).
    values
        Of its parameters, by symbol.

    Raises
    ------
    DiagnosisError
        It states none.
    """
    response = term.response(frequency, values)
    if response is None:
        raise DiagnosisError(
            f"{term.name} acts at the torque sensor and states no frequency response"
        )
    return np.asarray(response)


@dataclass(frozen=True)
class TorqueReading:
    """Describes how the torque sensor reads what acts on the plate.

    Attributes
    ----------
    late
        Time by which it reads late [s].
    sensor
        Values of the terms at the torque sensor, by term and symbol.
    """

    late: float = 0.0
    sensor: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @classmethod
    def of(cls, values: Mapping[str, Mapping[str, float]]) -> TorqueReading:
        """Return the reading that a model describes.

        Parameters
        ----------
        values
            Of all its terms, by term and symbol.
        """
        library = term_library()
        sensor = {
            name: dict(given)
            for name, given in values.items()
            if name != SKEW and library[name].place is Place.TORQUE_SENSOR
        }
        return cls(float(values.get(SKEW, {}).get("skew", 0.0)), sensor)

    def acting(self, torque: np.ndarray, rate: float) -> np.ndarray:
        """Return the torque that acted at each moment [N.m], shape (n,).

        Parameters
        ----------
        torque
            As it was read, or a part of it [N.m], shape (n,).
        rate
            Of its samples [Hz].

        Raises
        ------
        DiagnosisError
            A term at the sensor states no frequency response.
        """
        torque = on_time(torque, rate, self.late)
        if not self.sensor:
            return torque
        spectrum = Spectrum(torque, rate, 1)
        gain = np.ones(len(spectrum.frequency), dtype=complex)
        for name, values in self.sensor.items():
            gain = gain * sensor_response(term_library()[name](), spectrum.frequency, values)
        undone = np.conj(gain) / np.maximum(np.abs(gain), _LEAST_GAIN) ** 2
        return spectrum.read(undone * low_pass(spectrum.frequency, _UNDONE_HZ, _UNDONE_ORDER))
