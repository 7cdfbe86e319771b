"""What is said to a person of a calibrated session."""

from __future__ import annotations

from ankle_physics.joint_profile import joint_in_force
from calibration.session_calibration import LEAST_GAIN, CalibratedSession
from impedance_estimator.known_physics import LEAST_STIFFNESS, KnownPhysics
from impedance_estimator.simultaneous.doubt import DOUBT_THRESHOLD, LARGEST_ERRORS

LARGEST_SHARE = 0.25
"""[1] A standard error of K or G beyond this share of the value is said before the model is handed
on: the 95 % then reach from half of the value to one and a half of it, more than K and G change in
a session."""
UNITS = {"K": "N.m/rad", "G": "N.m.s/rad"}
"""Each value that a model states of the whole joint has this unit."""
SHOWN_VALUES = ("K", "K_effective", "G")
"""Values of the diagnosis that are shown, in this order."""


def described_session(found: CalibratedSession) -> list[str]:
    """Return K and G of the whole joint with standard errors and units, and from which standard
    errors on later estimates are doubted, line by line.

    Parameters
    ----------
    found
        Of `calibrate_session`.
    """
    joint, lines = joint_in_force(), []
    keys = {key.split("[")[0]: key for key in found.verdict["parameters"]}
    for symbol in SHOWN_VALUES:
        if symbol not in keys:
            continue
        given = found.verdict["parameters"][keys[symbol]]
        error = given.get("standard_error")
        size = "without a standard error" if error is None else f"± {error:.2g}"
        lines.append(f"{joint.in_units(keys[symbol]):<22} {given['augmented']:.4g} {size}")
    at = found.model.stated_at
    if at is not None:
        where = f"at a mean angle of {at.position:.3f} rad and a mean torque of {at.torque:.2f} N.m"
        lines.append(joint.in_units(where))
    limits = f"{100.0 * LARGEST_ERRORS[0]:.0f} % of K or {100.0 * LARGEST_ERRORS[1]:.0f} % of G"
    doubted = KnownPhysics(None, found.model).calibration_doubt >= DOUBT_THRESHOLD
    lines.append(
        f"the standard errors are above {limits}: every later estimate will be doubted"
        if doubted
        else f"with standard errors above {limits}, every later estimate would be doubted"
    )
    return lines


def session_warnings(found: CalibratedSession) -> list[str]:
    """Return one sentence for each reason to be careful with a calibrated session.

    Parameters
    ----------
    found
        Of `calibrate_session`.
    """
    warnings = []
    if found.verdict["verdict"] == "unexplained":
        warnings.append(
            "the verdict is 'unexplained': no known effect explains what the model leaves over, so "
            "K and G may be wrong by more than their standard errors"
        )
    least = {"K": LEAST_STIFFNESS, "G": LEAST_GAIN}
    for symbol, (value, error) in found.model.stated.items():
        joint, unit = joint_in_force(), UNITS[symbol]
        share = error / max(abs(value), least[symbol] * joint.scale(unit))
        if share > LARGEST_SHARE:
            unit = joint.in_units(unit)
            warnings.append(
                f"{symbol} = {value:.4g} ± {error:.2g} {unit} is known to {100.0 * share:.0f} % "
                f"only, more than {100.0 * LARGEST_SHARE:.0f} %: record longer, or with the "
                "subject at rest"
            )
    return warnings
