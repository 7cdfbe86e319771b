"""The angle about which a term is written, which a fit sets to the recording's mean angle."""

from __future__ import annotations

from ankle_physics.term import Parameter


def operating_angle(meaning: str) -> Parameter:
    """Return the parameter ``xc`` [rad] of a term.

    Parameters
    ----------
    meaning
        What the angle is to the term, in one sentence: the parameter's description.
    """
    return Parameter(
        "xc", "rad", -1.0, 1.0, 0.0, "range of the ankle joint", description=meaning, fitted=False
    )
