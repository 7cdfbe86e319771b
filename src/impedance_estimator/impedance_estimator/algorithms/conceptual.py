"""The conceptual algorithm (C), section II-D of van 't Veld et al. 2018.

It puts a 100 Hz low-pass on all inputs and takes 4th-order backward differences of position and
digital Butterworth filters for the averages.
"""

from impedance_estimator.correlation.correlation_estimator import CorrelationEstimator
from impedance_estimator.digital_filters import butterworth_lowpass


class Conceptual(CorrelationEstimator):
    """Derives velocity and acceleration from position (C)."""

    name = "C"
    title = "conceptual: 100 Hz low-pass, 4th-order differences of position"
    input_lowpass = True
    difference_order = 4
    averaging = staticmethod(butterworth_lowpass)
    uses_measured_velocity = False


Algorithm = Conceptual
