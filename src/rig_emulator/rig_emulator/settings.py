"""Parameters of the rig emulator: line, clock, faults, limits, and all parameters of rig and joint
that `ankle_sim` has.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from ankle_actuator_driver.link.rig_link import DEVICE_PORT
from ankle_actuator_driver.safety.limits import LIMIT_PARAMETERS, Limits, limits_from
from ankle_interfaces.quantity import Quantity, Value
from ankle_physics.actuator import Servo
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import SignalToNoise
from ankle_sim.live_rig import Setup
from ankle_sim.parameters import (
    FOOT,
    MODEL,
    RIG_PARAMETERS,
    model_parameters,
    plate_alone,
    with_voluntary_torque,
)
from rig_emulator.faults import Faults

ModelParameters = Mapping[str, tuple[Quantity, str, str]]

LINE_PARAMETERS = (
    Quantity("address", default="127.0.0.1", description="Address to receive at.", start_only=True),
    Quantity(
        "port",
        "1",
        1,
        65534,
        DEVICE_PORT,
        description="UDP port of the rig; fault switches are taken at the next one.",
        start_only=True,
    ),
    Quantity(
        "key_file",
        default="",
        description="File with the key that driver and rig share; empty: a dedicated line.",
        start_only=True,
    ),
    Quantity(
        "rate",
        "Hz",
        1000.0,
        10_000.0,
        2048.0,
        description="Rate of servo and samples by the rig's own clock (paper: 2048).",
        start_only=True,
    ),
    Quantity(
        "clock_drift",
        "1",
        -500e-6,
        500e-6,
        50e-6,
        description="Seconds that the rig's clock gains in a second; a usual crystal.",
        start_only=True,
    ),
    Quantity(
        "clock_offset",
        "s",
        0.0,
        1e9,
        1000.0,
        description="The rig's clock at the start: it counts from its own power-on.",
        start_only=True,
    ),
    Quantity(
        "faults",
        default="none",
        description="Fault switches at the start, as 'drop=0.1,freeze=1'.",
        start_only=True,
    ),
)
# `wait_for_readers` is about topics, which the emulator does not have.
SIMULATED_RIG = tuple(
    parameter for parameter in RIG_PARAMETERS if parameter.name != "wait_for_readers"
)
PARAMETERS = (
    *LINE_PARAMETERS,
    *(replace(parameter, start_only=True) for parameter in (*LIMIT_PARAMETERS, *SIMULATED_RIG)),
)


@dataclass(frozen=True)
class Settings:
    """Holds what a rig emulator is made of.

    Attributes
    ----------
    setup
        Rig, joint and sensors.
    limits
        That the rig enforces.
    rate
        Of servo and samples [Hz].
    clock_drift
        Seconds that its clock gains in a second.
    clock_offset
        Its clock at the start [s].
    noisy
        Whether the samples have sensor noise.
    faults
        Switches at the start.
    key
        Shared with the driver; empty for none.
    """

    setup: Setup
    limits: Limits
    rate: float
    clock_drift: float
    clock_offset: float
    noisy: bool
    faults: Faults
    key: bytes = b""

    @classmethod
    def defaults(cls, key: bytes = b"") -> Settings:
        """Return the paper's joint on a rig with default parameters."""
        model = load_model("")
        values = {parameter.name: parameter.default for parameter in PARAMETERS}
        return settings_from(values, model, key)


def load_model(path: str, rig: str = "", foot: bool = True) -> Model:
    """Return the joint's model from a file, on a calibrated rig.

    It is the paper's model where the path is empty.

    Parameters
    ----------
    path
        Of the model file.
    rig
        Of the rig file whose terms are added; empty: none.
    foot
        Whether a foot is on the plate.

    Raises
    ------
    ModelError
        A file that is refused, or none of a rig without a foot.
    OSError
        One that cannot be read.
    """
    if not foot:
        if path:
            raise ModelError(f"foot = false leaves out what the model file {path} holds")
        return plate_alone(rig)
    model = with_voluntary_torque(Model.load(path) if path else Model.of())
    return RigFile.load(rig).twin(model) if rig else model


def joint_parameters(model: Model) -> ModelParameters:
    """Return parameter, term and symbol of all values of a model that can be set, by name."""
    return {
        name: (replace(declared, start_only=True), term, symbol)
        for name, (declared, term, symbol) in model_parameters(model).items()
    }


def settings_from(values: Mapping[str, Value], model: Model, key: bytes = b"") -> Settings:
    """Return the settings that parameters describe.

    Parameters
    ----------
    values
        Of `PARAMETERS`, by name; those of the model where they are given.
    model
        The joint; its values are changed to the given ones.
    key
        Shared with the driver.

    Raises
    ------
    QuantityError
        A fault switch that is refused.
    ModelError
        A scenario file that is refused.
    OSError
        One that cannot be read.
    """
    for name, (_, term, symbol) in joint_parameters(model).items():
        if name in values:
            model.entry(term).values[symbol] = values[name]
    scenario = Scenario.load(str(values["scenario"])) if values["scenario"] else Scenario([])
    setup = Setup(
        model,
        Servo(float(values["actuator_bandwidth"]), float(values["actuator_damping"])),
        SignalToNoise(
            *(float(values[name]) for name in ("snr_position", "snr_velocity", "snr_torque"))
        ),
        scenario,
        float(values["noise_amplitude"]),
        int(values["seed"]),
        RigFile.load(str(values["rig"])) if values["rig"] else None,
    )
    return Settings(
        setup,
        limits_from(values),
        float(values["rate"]),
        float(values["clock_drift"]),
        float(values["clock_offset"]),
        bool(values["noise"]),
        Faults().with_switches(str(values["faults"])),
        key,
    )


__all__ = [
    "FOOT",
    "MODEL",
    "PARAMETERS",
    "Settings",
    "joint_parameters",
    "load_model",
    "settings_from",
]
