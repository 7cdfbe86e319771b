"""Parameters of the node: those of rig and sensors, and every parameter of every term of the loaded
model.
"""

from __future__ import annotations

from ankle_node.parameters import Parameter
from ankle_physics.actuator import Servo
from ankle_physics.model import PAPER_TERMS, Entry, Model
from ankle_physics.sensors import SignalToNoise
from ankle_physics.term import Parameter as TermParameter

MODEL = Parameter(
    "model",
    "",
    "",
    "Model file (YAML); empty: the model of van 't Veld et al. 2018, figure 1.",
    fixed=True,
)
SCENARIO = Parameter(
    "scenario",
    "",
    "",
    "Scenario file (YAML) of scripted parameter changes; empty: none.",
    fixed=True,
)
_PAPER = SignalToNoise()
RIG_PARAMETERS = (
    MODEL,
    SCENARIO,
    Parameter(
        "actuator_bandwidth",
        Servo().bandwidth,
        "Hz",
        "Natural frequency of the second-order servo; 0 is an ideal actuator (default: section "
        "II-B of the paper).",
        0.0,
        500.0,
        fixed=True,
    ),
    Parameter(
        "actuator_damping",
        Servo().damping,
        "1",
        "Damping ratio of the servo (the usual choice).",
        0.1,
        5.0,
        fixed=True,
    ),
    Parameter("noise", True, "", "Whether the samples have sensor noise."),
    Parameter(
        "snr_position",
        _PAPER.position,
        "dB",
        "Signal-to-noise ratio of the position (section II-C of the paper).",
        0.0,
        200.0,
        fixed=True,
    ),
    Parameter(
        "snr_velocity",
        _PAPER.velocity,
        "dB",
        "Signal-to-noise ratio of the velocity (section II-D of the paper).",
        0.0,
        200.0,
        fixed=True,
    ),
    Parameter(
        "snr_torque",
        _PAPER.torque,
        "dB",
        "Signal-to-noise ratio of the torque (section II-C of the paper).",
        0.0,
        200.0,
        fixed=True,
    ),
    Parameter(
        "noise_amplitude",
        0.04,
        "rad",
        "Amplitude of the pulse-step perturbation whose response sets the noise by the "
        "signal-to-noise ratios "
        "(default of the perturbation generator).",
        0.001,
        0.5,
        fixed=True,
    ),
    Parameter("seed", 1, "1", "Seed of noise and voluntary torque.", 0, 2**31 - 1, fixed=True),
    Parameter(
        "wait_for_readers",
        0,
        "1",
        "Readers of /ankle/samples to wait for before the first block is taken.",
        0,
        100,
        fixed=True,
    ),
)
SUBJECT = Parameter(
    "subject",
    0,
    "1",
    "Number of a virtual subject, whose co-contraction and reflexes then set K and G and give "
    "EMG; 0: none.",
    0,
    9999,
    fixed=True,
)
STATE_PARAMETERS = (
    Parameter(
        "cocontraction",
        0.3,
        "1",
        "What the virtual subject does: calf against shin, share of 10 N.m.",
        0.0,
        1.0,
    ),
    Parameter(
        "excitability",
        0.5,
        "1",
        "What the virtual subject does: excitability of the calf's reflex.",
        0.0,
        1.0,
    ),
    Parameter(
        "push",
        0.0,
        "N.m",
        "What the virtual subject does: torque towards plantarflexion.",
        -20.0,
        20.0,
    ),
)
HOLDS = Parameter(
    "holds",
    0,
    "1",
    "Holds that the virtual subject goes through, two of three at 0 N.m, the others at -5 N.m.",
    0,
    100,
    fixed=True,
)
HOLD_DURATION = Parameter(
    "hold_duration",
    60.0,
    "s",
    "Length of a hold (paper, section III-B.2: 60 s).",
    1.0,
    600.0,
    fixed=True,
)
REACH_DURATION = Parameter(
    "reach_duration", 60.0, "s", "Time from one hold to the next.", 1.0, 600.0, fixed=True
)
SUBJECT_PARAMETERS = (SUBJECT, *STATE_PARAMETERS, HOLDS, HOLD_DURATION, REACH_DURATION)
VOLUNTARY_TORQUE = "voluntary_torque"


def with_voluntary_torque(model: Model) -> Model:
    """The model with a voluntary torque of zero where it has none, so that a level can be set while
    it runs.
    """
    if model.has(VOLUNTARY_TORQUE):
        return model
    (silent,) = Model.of({VOLUNTARY_TORQUE: {"level": 0.0, "rms": 0.0}}).entries
    return Model([*model.entries, silent], model.title)


def parameter_name(term: str, symbol: str) -> str:
    """The node's name for a parameter: its symbol in the paper's terms, ``term.symbol`` in all
    others.
    """
    return symbol if term in PAPER_TERMS else f"{term}.{symbol}"


def model_parameters(model: Model) -> dict[str, tuple[Parameter, str, str]]:
    """Node parameter, term name and symbol of every parameter of the model, by node parameter name.

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


def _declared(entry: Entry, own: TermParameter) -> Parameter:
    text = f"{entry.term.name}: {entry.term.sentence} Range: {own.source}."
    name = parameter_name(entry.term.name, own.symbol)
    return Parameter(
        name,
        float(entry.values[own.symbol]),
        own.unit,
        text,
        own.lower,
        own.upper,
        fixed=not own.linear,
    )
