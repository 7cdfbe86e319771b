"""The conceptual (C) and the conceptual and experimental (CE) algorithm (van 't Veld et al. 2018,
section II-D).

Both: 100 Hz low-pass on all inputs, 4th-order backward differences, digital Butterworth averaging
filters. CE also uses the measured velocity where there is one, in place of the differentiated
position.
"""

from impedance_estimator.correlation.correlation_estimator import CorrelationEstimator
from impedance_estimator.digital_filters import butterworth_lowpass


class Conceptual(CorrelationEstimator):
    """C: velocity and acceleration from position."""

    name = "C"
    title = "conceptual: 100 Hz low-pass, 4th-order differences of position"
    input_lowpass = True
    difference_order = 4
    averaging = staticmethod(butterworth_lowpass)
    uses_measured_velocity = False


class ConceptualExperimental(Conceptual):
    """CE: acceleration from measured velocity."""

    name = "CE"
    title = "conceptual and experimental: as C, with measured velocity"
    uses_measured_velocity = True
