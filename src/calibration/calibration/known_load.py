"""The load that is mounted on the plate while a rig is calibrated: what is said, and what shows."""

from __future__ import annotations

from dataclasses import dataclass

from ankle_physics.terms.footplate_gravity import FootplateGravity
from calibration.errors import CalibrationError
from calibration.rig_identification import IdentifiedRig

# A spring shows where at least this share of its stiffness is found. No plate's weight takes away
# half of a spring of 50 N.m/rad and more.
MIN_SPRING_SHARE = 0.5


@dataclass(frozen=True)
class KnownLoad:
    """Describes the load that is mounted on the plate.

    Attributes
    ----------
    inertia
        [kg.m^2]; 0 is none.
    spring
        [N.m/rad]; 0 is none.
    """

    inertia: float = 0.0
    spring: float = 0.0

    def __post_init__(self) -> None:
        for name, value, unit, largest in (
            ("inertia", self.inertia, "kg.m^2", 0.1),
            ("spring", self.spring, "N.m/rad", 1000.0),
        ):
            if not 0.0 <= value <= largest:
                raise CalibrationError(
                    f"known {name} = {value:g} {unit} is refused; allowed: 0 to {largest:g} {unit}"
                )


def require_load(found: IdentifiedRig, load: KnownLoad) -> None:
    """Refuse a plate that is held otherwise than by the known spring.

    Parameters
    ----------
    found
        What the recording shows.
    load
        What is said to be mounted.

    Raises
    ------
    CalibrationError
        Names what holds the plate [N.m/rad], and what may.
    """
    weight = FootplateGravity.parameter("m")
    held = f"{found.slope.value:.4g} ± {found.slope.error:.2g} N.m/rad"
    if load.spring and found.slope.value < MIN_SPRING_SHARE * load.spring:
        raise CalibrationError(
            f"no spring of {load.spring:g} N.m/rad is seen: the plate is held with {held}; is it "
            "mounted, and is its stiffness right (--spring)?"
        )
    left = found.slope.value - load.spring
    if abs(left) > weight.upper:
        beside = f", of which the spring makes {load.spring:g} N.m/rad" if load.spring else ""
        raise CalibrationError(
            f"something holds the plate with {held}{beside}; allowed for the plate's own weight: "
            f"-{weight.upper:g} to {weight.upper:g} N.m/rad. Is it a foot, or a spring (--spring)?"
        )
