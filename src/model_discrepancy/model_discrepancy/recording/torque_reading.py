"""What the torque sensor makes of the torque that acts on the plate, and how to undo it.

A servo that gives way is moved by the torque that acts, not by what a sensor reads late, behind a
lag or amplified by a vibration of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ankle_physics.term import Place, term_library
from model_discrepancy.recording.known_rig import SKEW, on_time
from model_discrepancy.recording.spectrum import Spectrum, low_pass

# What is faster is not undone [Hz]: the drive's mass holds it, and it is mostly noise.
_UNDONE_HZ, _UNDONE_ORDER = 100.0, 8
# Of the sensor's gain: where it hardly lets anything pass, undoing would magnify noise.
_LEAST_GAIN = 0.1


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
        """Return the reading that a model's values, by term and symbol, describe."""
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
        """
        torque = on_time(torque, rate, self.late)
        if not self.sensor:
            return torque
        spectrum = Spectrum(torque, rate, 1)
        gain = np.ones(len(spectrum.frequency), dtype=complex)
        for name, values in self.sensor.items():
            response = term_library()[name]().response(spectrum.frequency, values)
            assert response is not None
            gain = gain * response
        undone = np.conj(gain) / (np.abs(gain) ** 2 + _LEAST_GAIN**2 * (np.abs(gain) < _LEAST_GAIN))
        return spectrum.read(undone * low_pass(spectrum.frequency, _UNDONE_HZ, _UNDONE_ORDER))
