"""A calibrated rig in words, for the terminal."""

from __future__ import annotations

from ankle_physics.rig_file import RigFile
from calibration.fitted_value import Found
from calibration.rig_calibration import Calibrated


def described(calibrated: Calibrated) -> str:
    """Return what was found, line by line, with standard errors and units."""
    found, rig = calibrated.identified, calibrated.rig
    if calibrated.beside is not None:
        sag = _text(_of(rig, "servo_compliance", "k_a"), "N.m/rad")
        return (
            f"servo against load         {sag}\n"
            f"everything else is kept as '{calibrated.beside.title}' states it"
        )
    lines = [
        f"torque behind position     {_ms(found.torque_delay)}",
        f"inertia of the plate       {_text(_of(rig, 'footplate_inertia', 'Ip'), 'kg.m^2')}",
        f"friction of the bearing    {_text(found.friction, 'N.m')}",
        f"servo                      {_text(found.bandwidth, 'Hz')}, damping "
        f"{_text(found.damping, '1')}",
        f"zero of position           {rig.zero_position:.5f} rad",
        f"zero of torque             {rig.zero_torque:.4f} N.m",
        "noise                      "
        + ", ".join(f"{value:.2g} {key.split('[')[1][:-1]}" for key, value in rig.noise.items()),
        f"torque explained           {found.vaf:.2f} % of what follows the plate",
    ]
    if found.velocity_delay is not None:
        lines.insert(1, f"velocity behind position   {_ms(found.velocity_delay)}")
    if rig.model.has("footplate_gravity"):
        weight = _of(rig, "footplate_gravity", "m")
        lines.append(f"weight of the plate        {_text(weight, 'N.m')}")
    if found.lag is not None:
        lines.append(f"lag of the torque sensor   {_ms(found.lag)}")
    if found.mode is not None:
        frequency, damping = found.mode
        lines.append(
            f"mode of the torque sensor  {_text(frequency, 'Hz')}, damping {_text(damping, '1')}"
        )
    if found.servo_stiffness is not None:
        lines.append(f"servo against load         {_text(found.servo_stiffness, 'N.m/rad')}")
    return "\n".join([*lines, *calibrated.remarks])


def _of(rig: RigFile, term: str, symbol: str) -> Found:
    entry = rig.model.entry(term)
    return Found(float(entry.values[symbol]), entry.standard_errors[symbol])


def _text(found: Found, unit: str) -> str:
    return f"{found.value:.4g} ± {found.error:.2g} {unit}"


def _ms(found: Found) -> str:
    return f"{1e3 * found.value:.3f} ± {1e3 * found.error:.3f} ms"
