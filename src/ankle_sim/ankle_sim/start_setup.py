"""The rig, joint and subject that the node's start values ask for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ankle_interfaces.quantity import Quantity
from ankle_physics.actuator import Servo
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.own_terms import load_terms
from ankle_physics.rig_file import RigFile
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import SignalToNoise
from ankle_sim.live_rig import Setup
from ankle_sim.live_subject import subject_model
from ankle_sim.parameters import (
    FOOT,
    MODEL,
    RIG,
    RIG_PARAMETERS,
    SCENARIO,
    TERMS,
    model_parameters,
    plate_alone,
    with_voluntary_torque,
)
from ankle_sim.procedure import PlannedHold, some_holds
from ankle_sim.subject_parameters import (
    HOLD_DURATION,
    HOLDS,
    REACH_DURATION,
    STATE_PARAMETERS,
    SUBJECT,
    SUBJECT_PARAMETERS,
)
from ankle_sim.virtual_subject import State, draw_subject

MODEL_CHOICE = (MODEL, FOOT, TERMS, SUBJECT, RIG)
"""Parameters that choose the model, on which the declaration of its own parameters depends."""


def make_model(values: Mapping[str, Any]) -> Model:
    """Make the model that the parameters `model`, `foot`, `subject`, `terms` and `rig` name."""
    load_terms(str(values.get(TERMS.name, "")))
    path, subject = str(values.get(MODEL.name, "")), int(values.get(SUBJECT.name, 0))
    rig = str(values.get(RIG.name, ""))
    if not values.get(FOOT.name, True):
        if path or subject:
            raise ModelError("foot = false leaves out 'model' and 'subject'; give neither")
        return plate_alone(rig)
    if path:
        model = with_voluntary_torque(Model.load(path))
    elif subject:
        model = subject_model(draw_subject(subject))
    else:
        model = with_voluntary_torque(Model.of())
    return RigFile.load(rig).twin(model) if rig else model


def parameters_of(model: Model) -> list[Quantity]:
    """Return every parameter of a node that simulates a model."""
    of_model = model_parameters(model)
    return [
        *RIG_PARAMETERS,
        *SUBJECT_PARAMETERS,
        *(declared for declared, _, _ in of_model.values()),
    ]


def declared_parameters(values: Mapping[str, Any]) -> list[Quantity]:
    """Return the parameters for these start values; they depend on the node's model."""
    return parameters_of(make_model(values))


def setup_from(model: Model, values: Mapping[str, Any]) -> Setup:
    """Return what a rig is made of.

    Parameters
    ----------
    model
        The joint; its values become those of the parameters.
    values
        Value of every parameter in `parameters_of` the model.
    """
    for name, (_, term, symbol) in model_parameters(model).items():
        model.entry(term).values[symbol] = float(values[name])
    scenario, rig = str(values[SCENARIO.name]), str(values[RIG.name])
    return Setup(
        model,
        Servo(values["actuator_bandwidth"], values["actuator_damping"]),
        SignalToNoise(values["snr_position"], values["snr_velocity"], values["snr_torque"]),
        Scenario.load(scenario) if scenario else Scenario([]),
        values["noise_amplitude"],
        int(values["seed"]),
        RigFile.load(rig) if rig else None,
    )


def holds_from(values: Mapping[str, Any]) -> list[PlannedHold]:
    """Return the holds that the simulated subject goes through."""
    return some_holds(
        int(values[HOLDS.name]),
        int(values["seed"]),
        values[HOLD_DURATION.name],
        values[REACH_DURATION.name],
    )


def state_from(values: Mapping[str, Any]) -> State:
    """Return what the simulated subject is asked to do."""
    return State(
        **{parameter.name: float(values[parameter.name]) for parameter in STATE_PARAMETERS}
    )
