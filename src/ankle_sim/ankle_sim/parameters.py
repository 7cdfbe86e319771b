"""Parameters of the node: those of rig and sensors, and every parameter of every term of the loaded
model.
"""

from __future__ import annotations

from dataclasses import replace

from ankle_interfaces.quantity import Quantity
from ankle_physics.actuator import Servo
from ankle_physics.errors import ModelError
from ankle_physics.model import PAPER_TERMS, Entry, Model
from ankle_physics.rig_file import RigFile
from ankle_physics.sensors import SignalToNoise
from ankle_physics.term import Parameter

MODEL = Quantity(
    "model",
    default="",
    description="Model file (YAML); empty: the model of van 't Veld et al. 2018, figure 1.",
    start_only=True,
)
FOOT = Quantity(
    "foot",
    default=True,
    description=(
        "Whether a foot is on the plate; false: the plate alone, as a rig is calibrated, which "
        "needs the parameter rig."
    ),
    start_only=True,
)
TERMS = Quantity(
    "terms",
    default="",
    description="Folder of terms of one's own (Python) that the model may hold; empty: none.",
    start_only=True,
)
SCENARIO = Quantity(
    "scenario",
    default="",
    description="Scenario file (YAML) of scripted parameter changes; empty: none.",
    start_only=True,
)
RIG = Quantity(
    "rig",
    default="",
    description=(
        "Rig file (YAML) of a calibrated rig to be simulated: its plate, servo, delays, zeros and "
        "noise; empty: a faultless rig."
    ),
    start_only=True,
)
_PAPER_RATIOS = SignalToNoise()
RIG_PARAMETERS = (
    MODEL,
    FOOT,
    TERMS,
    SCENARIO,
    RIG,
    Quantity(
        "actuator_bandwidth",
        "Hz",
        0.0,
        500.0,
        Servo().bandwidth,
        description=(
            "Natural frequency of the second-order servo; 0 is an ideal actuator (default: section "
            "II-B of the paper)."
        ),
        start_only=True,
    ),
    Quantity(
        "actuator_damping",
        "1",
        0.1,
        5.0,
        Servo().damping,
        description="Damping ratio of the servo (the usual choice).",
        start_only=True,
    ),
    Quantity(
        "at_rest",
        default=False,
        description=(
            "Whether the plate rests until it is armed and started, as a rig's does; else it "
            "follows the perturbation at once."
        ),
        start_only=True,
    ),
    Quantity("noise", default=True, description="Whether the samples have sensor noise."),
    Quantity(
        "snr_position",
        "dB",
        0.0,
        200.0,
        _PAPER_RATIOS.position,
        description="Signal-to-noise ratio of the position (section II-C of the paper).",
        start_only=True,
    ),
    Quantity(
        "snr_velocity",
        "dB",
        0.0,
        200.0,
        _PAPER_RATIOS.velocity,
        description="Signal-to-noise ratio of the velocity (section II-D of the paper).",
        start_only=True,
    ),
    Quantity(
        "snr_torque",
        "dB",
        0.0,
        200.0,
        _PAPER_RATIOS.torque,
        description="Signal-to-noise ratio of the torque (section II-C of the paper).",
        start_only=True,
    ),
    Quantity(
        "noise_amplitude",
        "rad",
        0.001,
        0.5,
        0.04,
        description=(
            "Amplitude of the pulse-step perturbation whose response sets the noise by the "
            "signal-to-noise ratios "
            "(default of the perturbation generator)."
        ),
        start_only=True,
    ),
    Quantity(
        "seed",
        "1",
        0,
        2**31 - 1,
        1,
        description="Seed of noise and voluntary torque.",
        start_only=True,
    ),
    Quantity(
        "wait_for_readers",
        "1",
        0,
        100,
        0,
        description="Readers of /ankle/samples to wait for before the first block is taken.",
        start_only=True,
    ),
)
VOLUNTARY_TORQUE = "voluntary_torque"


def plate_alone(rig: str) -> Model:
    """Return the model of a rig without a foot on its plate.

    Parameters
    ----------
    rig
        Of the rig file.

    Raises
    ------
    ModelError
        No rig file is named, or it is refused.
    """
    if not rig:
        raise ModelError(
            "foot = false needs the parameter rig with a rig file: without it the plate has no "
            "inertia, and there is nothing to be seen; name one, as 'ankle up rig_to_calibrate "
            "--emulator --set rig_emulator.rig=FILE' (docs/calibration.md shows a whole file)"
        )
    return RigFile.load(rig).twin(with_voluntary_torque(Model.of({}, "plate without a foot")))


def with_voluntary_torque(model: Model) -> Model:
    """Return the model with a voluntary torque of zero where it has none, so that a level can be
    set while it runs.
    """
    if model.has(VOLUNTARY_TORQUE):
        return model
    (silent,) = Model.of({VOLUNTARY_TORQUE: {"level": 0.0, "rms": 0.0}}).entries
    return Model([*model.entries, silent], model.title)


def parameter_name(term: str, symbol: str) -> str:
    """Return the node's name for a parameter: its symbol in the paper's terms, ``term.symbol`` in
    all others.
    """
    return symbol if term in PAPER_TERMS else f"{term}.{symbol}"


def model_parameters(model: Model) -> dict[str, tuple[Quantity, str, str]]:
    """Return node parameter, term name and symbol of every parameter of the model, by node
    parameter name.

    Defaults are the model's values. Linear parameters can be set while the node runs, the others at
    start.
    """
    return {
        parameter_name(entry.term.name, own.symbol): (
            _declared(entry, own),
            entry.term.name,
            own.symbol,
        )
        for entry in model.entries
        for own in entry.term.parameters
    }


def _declared(entry: Entry, own: Parameter) -> Quantity:
    return replace(
        own,
        symbol=parameter_name(entry.term.name, own.symbol),
        default=float(entry.values[own.symbol]),
        description=f"{entry.term.name}: {own.description or entry.term.sentence}",
        start_only=not own.linear,
    )
