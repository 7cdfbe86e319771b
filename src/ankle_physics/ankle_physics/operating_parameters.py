"""The angle and the torque about which a term is written, which a fit sets to the recording's
means, and the range of angles over which it is, which a fit sets to the recording's.
"""

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


SPAN = "span"
"""Symbol of `operating_span`."""


def operating_span(meaning: str) -> Parameter:
    """Return the parameter ``span`` [rad] of a term.

    Parameters
    ----------
    meaning
        What the range of angles is to the term, in one sentence: the parameter's description.
    """
    return Parameter(
        SPAN, "rad", 1e-3, 2.0, 0.06, "range of the ankle joint", description=meaning, fitted=False
    )


def operating_torque(meaning: str) -> Parameter:
    """Return the parameter ``Tc`` [N.m] of a term that follows the torque of the muscles.

    Parameters
    ----------
    meaning
        What the torque is to the term, in one sentence: the parameter's description.
    """
    return Parameter(
        "Tc",
        "N.m",
        -200.0,
        200.0,
        0.0,
        "largest voluntary torque of the ankle (Moraux et al. 2013)",
        description=meaning,
        fitted=False,
    )
