"""Parameters of the node that watches the model's fit during a session."""

from __future__ import annotations

from ankle_node.parameters import Parameter

# The diagnosis fits whole minutes; below 15 s the generic regressors have fewer rows than a score
# needs.
WINDOW = Parameter(
    "window",
    60.0,
    "s",
    "Stretch of samples that each fit sees; the first one is the session's reference.",
    15.0,
    300.0,
    fixed=True,
)
# A strap that comes loose is then seen within a quarter of a minute plus the share of the window
# that it must fill.
PERIOD = Parameter(
    "period", 15.0, "s", "Time of the samples from one fit to the next.", 1.0, 300.0, fixed=True
)
# VAF of one minute of a subject who changes nothing scatters by one to two points with voluntary
# torque.
VAF_FALL = Parameter(
    "vaf_fall", 5.0, "%", "Fall of the base model's VAF below the reference that warns.", 0.1, 100.0
)
# Three times the share at which a diagnosis calls a mismatch significant.
SHARE_RISE = Parameter(
    "share_rise",
    0.1,
    "1",
    "Rise of the predictable share of the whitened residual above the reference that warns.",
    0.01,
    1.0,
)

PARAMETERS: tuple[Parameter, ...] = (WINDOW, PERIOD, VAF_FALL, SHARE_RISE)
