"""A calibrated rig in words, for the terminal and the operator's page."""

from __future__ import annotations

from ankle_physics.rig_file import RigFile
from calibration.fitted_value import Found
from calibration.rig_calibration import Calibrated

NAME_WIDTH = 26
"""Characters of the column of names; the longest has 24."""


def described(calibrated: Calibrated) -> str:
    """Return what was found, line by line, with standard errors and units."""
    lines = [f"{name:{NAME_WIDTH}s} {text}" for name, text in found_in_words(calibrated).items()]
    if calibrated.beside is not None:
        lines.append(f"everything else is kept as '{calibrated.beside.title}' states it")
    return "\n".join([*lines, *calibrated.remarks])


def found_in_words(calibrated: Calibrated) -> dict[str, str]:
    """Return what was found: names, and values with standard errors and units."""
    found, rig = calibrated.identified, calibrated.rig
    if calibrated.beside is not None:
        sag = _text(_of(rig, "servo_compliance", "k_a"), "N.m/rad")
        return {"servo against load": sag}
    words = {"torque behind position": _ms(found.torque_delay)}
    if found.velocity_delay is not None:
        words["velocity behind position"] = _ms(found.velocity_delay)
    words["inertia of the plate"] = _text(_of(rig, "footplate_inertia", "Ip"), "kg.m^2")
    words["friction of the bearing"] = (
        _text(found.friction, "N.m") if rig.model.has("footplate_friction") else "not seen"
    )
    damping = _text(found.damping)
    words["servo"] = f"{_text(found.bandwidth, 'Hz')}, damping {damping}"
    words["zero of position"] = f"{rig.zero_position:.5f} rad"
    words["zero of torque"] = f"{rig.zero_torque:.4f} N.m"
    words["noise"] = ", ".join(
        f"{value:.2g} {key.split('[')[1][:-1]}" for key, value in rig.noise.items()
    )
    words["torque explained"] = f"{found.vaf:.2f} % of what follows the plate"
    if rig.model.has("footplate_gravity"):
        words["weight of the plate"] = _text(_of(rig, "footplate_gravity", "m"), "N.m")
    if found.lag is not None:
        words["lag of the torque sensor"] = _ms(found.lag)
    if found.mode is not None:
        frequency, damping_of_mode = found.mode
        words["mode of the torque sensor"] = (
            f"{_text(frequency, 'Hz')}, damping {_text(damping_of_mode)}"
        )
    if found.servo_stiffness is not None:
        words["servo against load"] = _text(found.servo_stiffness, "N.m/rad")
    return words


def _of(rig: RigFile, term: str, symbol: str) -> Found:
    entry = rig.model.entry(term)
    return Found(float(entry.values[symbol]), entry.standard_errors[symbol])


def _text(found: Found, unit: str = "") -> str:
    return f"{found.value:.4g} ± {found.error:.2g} {unit}".rstrip()


def _ms(found: Found) -> str:
    return f"{1e3 * found.value:.3f} ± {1e3 * found.error:.3f} ms"
