"""The original algorithm (O), as van 't Veld et al. 2018 describe it in section II-A.

No low-pass on the inputs, 1st-order backward differences of position, Bessel averaging filters. The
original filters are analog; here they are digital by the bilinear transform, which at cut-offs
below 0.1 Hz is the same.
"""

from impedance_estimator.correlation.correlation_estimator import CorrelationEstimator
from impedance_estimator.digital_filters import bessel_lowpass


class Original(CorrelationEstimator):
    """Derives velocity and acceleration from position without a filter (O)."""

    name = "O"
    title = "original: 1st-order differences of position, no low-pass"
    input_lowpass = False
    difference_order = 1
    averaging = staticmethod(bessel_lowpass)
    uses_measured_velocity = False


Algorithm = Original
