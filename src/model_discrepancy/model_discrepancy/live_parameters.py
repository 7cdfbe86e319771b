"""Parameters of the node that watches the model's fit during a session."""

from __future__ import annotations

from ankle_interfaces.quantity import Quantity

# The diagnosis fits whole minutes; below 15 s the generic regressors have fewer rows than a score
# needs.
WINDOW = Quantity(
    "window",
    "s",
    15.0,
    300.0,
    60.0,
    description="Stretch of samples that each fit sees; the first one is the session's reference.",
    start_only=True,
)
# A strap that comes loose is then seen within a quarter of a minute plus the share of the window
# that it must fill.
PERIOD = Quantity(
    "period",
    "s",
    1.0,
    300.0,
    15.0,
    description="Time of the samples from one fit to the next.",
    start_only=True,
)
# VAF of one minute of a subject who changes nothing scatters by one to two points with voluntary
# torque.
VAF_FALL = Quantity(
    "vaf_fall",
    "%",
    0.1,
    100.0,
    5.0,
    description="Fall of the base model's VAF below the reference that warns.",
)
# Three times the share at which a diagnosis calls a mismatch significant.
SHARE_RISE = Quantity(
    "share_rise",
    "1",
    0.01,
    1.0,
    0.1,
    description=(
        "Rise of the predictable share of the whitened residual above the reference that warns."
    ),
)

PARAMETERS: tuple[Quantity, ...] = (WINDOW, PERIOD, VAF_FALL, SHARE_RISE)
