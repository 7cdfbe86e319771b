"""Parameters of the rig emulator: line, clock, faults, limits, and everything that `ankle_sim` lets
one set of rig and joint.
"""

from __future__ import annotations

from collections.abc import Sequence

import yaml

from ankle_actuator_driver.safety.limits import LIMIT_PARAMETERS
from ankle_actuator_driver.settings import DEVICE_PORT
from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity, Value
from ankle_physics.actuator import Servo
from ankle_physics.model import Model
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import SignalToNoise
from ankle_sim.live_rig import Setup
from ankle_sim.parameters import MODEL, RIG_PARAMETERS, model_parameters, with_voluntary_torque

LINE_PARAMETERS = (
    Quantity("address", default="127.0.0.1", description="Address to receive at."),
    Quantity(
        "port",
        "1",
        1,
        65534,
        DEVICE_PORT,
        description="UDP port of the rig; fault switches are taken at the next one.",
    ),
    Quantity(
        "rate",
        "Hz",
        1000.0,
        10_000.0,
        2048.0,
        description="Rate of servo and samples by the rig's own clock (paper: 2048).",
    ),
    Quantity(
        "clock_drift",
        "1",
        -500e-6,
        500e-6,
        50e-6,
        description="Seconds that the rig's clock gains in a second; a usual crystal.",
    ),
    Quantity(
        "clock_offset",
        "s",
        0.0,
        1e9,
        1000.0,
        description="The rig's clock at the start: it counts from its own power-on.",
    ),
    Quantity(
        "faults", default="none", description="Fault switches at the start, as 'drop=0.1,freeze=1'."
    ),
)
# `wait_for_readers` is about topics, which the emulator does not have.
_OF_RIG = tuple(parameter for parameter in RIG_PARAMETERS if parameter.name != "wait_for_readers")


def given(arguments: Sequence[str]) -> dict[str, object]:
    """The parameters in ``--ros-args -p name:=value ...``, as every other executable takes them;
    remappings mean nothing here.

    Raises
    ------
    QuantityError
        Another argument.
    """
    found: dict[str, object] = {}
    words = iter(word for word in arguments if word != "--ros-args")
    for word in words:
        value = next(words, "")
        name, assigned, text = value.partition(":=")
        if word == "-p" and assigned:
            found[name] = yaml.safe_load(text)
        elif word != "-r":
            raise QuantityError(
                f"'{word} {value}' is not understood; expected --ros-args -p name:=value"
            )
    return found


def _check(parameters: Sequence[Quantity], wanted: dict[str, object]) -> dict[str, Value]:
    return {
        p.name: p.check(_number(wanted[p.name], p.default)) if p.name in wanted else p.default
        for p in parameters
    }


def _number(value: object, default: Value) -> object:
    # YAML 1.1 takes '5e-5' for text; rclpy does not.
    if isinstance(value, str) and isinstance(default, float):
        try:
            return float(value)
        except ValueError:
            return value
    return value


def settings_from(arguments: Sequence[str]) -> tuple[dict[str, Value], Setup]:
    """The emulator's parameters by name, and the rig with its joint.

    Raises
    ------
    QuantityError
        An unknown parameter, or a value that is refused.
    ModelError
        A model or scenario file that is refused.
    OSError
        One that cannot be read.
    """
    wanted = given(arguments)
    path = MODEL.check(wanted.get(MODEL.name, ""))
    model = with_voluntary_torque(Model.load(str(path)) if path else Model.of())
    of_model = model_parameters(model)
    own = (*LINE_PARAMETERS, *LIMIT_PARAMETERS, *_OF_RIG)
    unknown = set(wanted) - {parameter.name for parameter in own} - set(of_model)
    if unknown:
        raise QuantityError(
            f"parameter '{sorted(unknown)[0]}' is unknown; known: "
            f"{', '.join([p.name for p in own] + list(of_model))}"
        )
    values = _check(own, wanted)
    for declared, term, symbol in of_model.values():
        model.entry(term).values[symbol] = _check([declared], wanted)[declared.name]
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
    )
    return values, setup
