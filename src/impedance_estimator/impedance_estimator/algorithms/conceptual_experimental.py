"""The conceptual and experimental algorithm (CE), section II-D of van 't Veld et al. 2018.

It is C with the measured velocity, where there is one, in place of the differentiated position.
"""

from impedance_estimator.algorithms.conceptual import Conceptual


class ConceptualExperimental(Conceptual):
    """Derives acceleration from the measured velocity (CE)."""

    name = "CE"
    title = "conceptual and experimental: as C, with measured velocity"
    uses_measured_velocity = True


Algorithm = ConceptualExperimental
