"""Parameters of the node that set the simulated subject; declared without its physics, so that
a program that only needs the names, such as the operator's page, loads none of it.
"""

from __future__ import annotations

from ankle_interfaces.quantity import Quantity

SUBJECT = Quantity(
    "subject",
    "1",
    0,
    9999,
    0,
    description=(
        "Number of a simulated subject, whose co-contraction and reflexes then set K and G and "
        "give EMG; 0: none."
    ),
    start_only=True,
)
STATE_PARAMETERS = (
    Quantity(
        "cocontraction",
        "1",
        0.0,
        1.0,
        0.3,
        description=(
            "It is the torque with which the subject's calf and shin contract against each other, "
            "as a share of 10 N.m."
        ),
    ),
    Quantity(
        "excitability",
        "1",
        0.0,
        1.0,
        0.5,
        description="It is the excitability of the calf's reflex of the simulated subject.",
    ),
    Quantity(
        "push",
        "N.m",
        -20.0,
        20.0,
        0.0,
        description="It is the torque of the simulated subject towards plantarflexion.",
    ),
)
HOLDS = Quantity(
    "holds",
    "1",
    0,
    100,
    0,
    description=(
        "Holds that the simulated subject goes through, two of three at 0 N.m, the others at "
        "-5 N.m."
    ),
    start_only=True,
)
HOLD_DURATION = Quantity(
    "hold_duration",
    "s",
    1.0,
    600.0,
    60.0,
    description="Length of a hold (paper, section III-B.2: 60 s).",
    start_only=True,
)
REACH_DURATION = Quantity(
    "reach_duration",
    "s",
    1.0,
    600.0,
    60.0,
    description="Time from one hold to the next.",
    start_only=True,
)
SUBJECT_PARAMETERS = (SUBJECT, *STATE_PARAMETERS, HOLDS, HOLD_DURATION, REACH_DURATION)
