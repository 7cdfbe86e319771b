"""All signals by name, and a signal from parameter values.

A new signal: a file with a subclass of `Signal` (or `StepSequence`), and its class in `SIGNALS`.
"""

from __future__ import annotations

from collections.abc import Mapping

from ankle_interfaces.quantity import Quantity, Value
from perturbation_generator.edges import shape_from
from perturbation_generator.multisine import Multisine
from perturbation_generator.on_request import OnRequest
from perturbation_generator.prbs import Prbs
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.random_steps import RandomSteps
from perturbation_generator.rig_calibration import RigCalibration
from perturbation_generator.settings import COMMON_PARAMETERS, Settings
from perturbation_generator.signal import Signal

SIGNALS: dict[str, type[Signal]] = {
    signal.name: signal
    for signal in (PulseStep, RandomSteps, Prbs, Multisine, RigCalibration, OnRequest)
}
SIGNAL = Quantity(
    "signal",
    default=PulseStep.name,
    description="Kind of the perturbation.",
    choices=tuple(SIGNALS),
    start_only=True,
)


def signal_from(values: Mapping[str, Value]) -> Signal:
    """Return the signal that parameter values describe.

    Parameters
    ----------
    values
        Value of every parameter in `parameters.PARAMETERS`, by name; others are ignored.

    Raises
    ------
    QuantityError
        Values out of range or that contradict each other.
    """
    kind = SIGNALS[str(SIGNAL.check(values[SIGNAL.name]))]
    common = {
        parameter.name: parameter.check(values[parameter.name]) for parameter in COMMON_PARAMETERS
    }
    own = {parameter.name.split(".")[1]: values[parameter.name] for parameter in kind.parameters}
    return kind(Settings(shape=shape_from(values), **common), **own)  # type: ignore[arg-type]
