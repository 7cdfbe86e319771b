"""Every topic of the laboratory: its relative name, message, columns, delivery and rate.

Publishers and subscribers take all of this from here. A name is relative (``ankle/samples``), so
that a namespace makes a second laboratory; in the root namespace it is ``/ankle/samples``, which is
also its name in a bag. Only `DIAGNOSTICS` and `CLOCK` are absolute, as everywhere in ROS.

Adding a column to ``ankle/samples`` touches three files at most: the column here (in
`ANKLE_SAMPLES.columns`, and in ``optional`` where not every rig has it), the node that measures it,
and the reader that wants it. Blocks, recorder, replay, bags, plots and all other readers carry or
leave out the column without a change.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from ankle_interfaces.block import MESSAGE_TYPE, TIME_COLUMN
from ankle_interfaces.errors import BlockError

STRING = "std_msgs/msg/String"
FLOAT = "std_msgs/msg/Float64"
MUSCLES = ("SOL", "TA", "GL", "GM")
"""Soleus, tibialis anterior, gastrocnemius lateralis and medialis (van 't Veld et al. 2018,
section III-B)."""


class Delivery(Enum):
    """Names how messages of a topic reach their readers; `ankle_node.qos` has the profiles."""

    BLOCKS = "reliable; a reader keeps eight seconds of blocks, so that none is lost"
    EVENTS = "reliable; a reader keeps a hundred"
    LATEST = "reliable; only the last one counts, and who connects later receives it too"
    PLOT = "reliable; ten are kept, for tools that people look with"


@dataclass(frozen=True)
class Topic:
    """Describes one topic of the laboratory.

    Attributes
    ----------
    name
        Relative name; a leading slash says that a namespace does not apply.
    message
        ROS type, as ``std_msgs/msg/Float64MultiArray``.
    delivery
        What its readers may count on.
    description
        One sentence that says what it carries.
    rate
        Usual rate of messages [Hz]; None for events.
    columns
        Of a block: every column with its unit, the first one included, in the order in which they
        are published.
    optional
        Those of `columns` that a publisher may leave out.
    plots
        Columns that are published as single numbers as well, each with the name of its topic.
    sparse
        Whether NaN stands for a value that does not exist, and so is no defect of the stream.
    """

    name: str
    message: str
    delivery: Delivery
    description: str
    rate: float | None = None
    columns: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    plots: tuple[tuple[str, str], ...] = ()
    sparse: bool = False

    @property
    def required(self) -> tuple[str, ...]:
        """Return the columns that every block has, without the first one."""
        return tuple(name for name in self.columns[1:] if name not in self.optional)

    def columns_of(self, count: int) -> tuple[str, ...]:
        """Return the names of the first columns, for a publisher that has no more.

        Parameters
        ----------
        count
            Number of columns that the publisher has, time included.

        Raises
        ------
        BlockError
            The topic has fewer columns, or one that is left out is required.
        """
        missing = [name for name in self.columns[count:] if name not in self.optional]
        if missing or count > len(self.columns):
            raise BlockError(
                f"{self.name}: {count} columns are refused; "
                + (f"required: {', '.join(missing)}" if missing else f"{len(self.columns)} exist")
            )
        return self.columns[:count]

    @property
    def absolute(self) -> str:
        """Return the name in the root namespace, as in a bag: ``/ankle/samples``."""
        return f"/{self.name.lstrip('/')}"

    def among(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return those of some absolute names that are this topic, in any namespace."""
        return tuple(name for name in names if f"/{name.lstrip('/')}".endswith(self.absolute))


def _block(
    name: str,
    description: str,
    columns: tuple[str, ...],
    rate: float | None = 64.0,
    optional: tuple[str, ...] = (),
    plots: tuple[tuple[str, str], ...] = (),
    sparse: bool = False,
) -> Topic:
    return Topic(
        name, MESSAGE_TYPE, Delivery.BLOCKS, description, rate, columns, optional, plots, sparse
    )


PERTURBATION_REFERENCE = _block(
    "perturbation/reference",
    "Motion that the actuator follows; a source may send the position alone.",
    (TIME_COLUMN, "position[rad]", "velocity[rad/s]", "acceleration[rad/s^2]"),
    optional=("velocity[rad/s]", "acceleration[rad/s^2]"),
)
ANKLE_SAMPLES = _block(
    "ankle/samples",
    "Measured motion and torque, positive in dorsiflexion.",
    (TIME_COLUMN, "position[rad]", "velocity[rad/s]", "torque[N.m]"),
    optional=("velocity[rad/s]",),
    plots=(("position[rad]", "ankle/angle"), ("torque[N.m]", "ankle/torque")),
)
ANKLE_TRUTH = _block(
    "ankle/truth",
    "True values of a simulation, one row each block; NaN for a term that the model lacks.",
    (TIME_COLUMN, "K[N.m/rad]", "G[N.m.s/rad]", "voluntary_torque[N.m]"),
    sparse=True,
)
EMG_SAMPLES = _block(
    "emg/samples",
    "Surface EMG as measured; NaN where a channel is bad.",
    (TIME_COLUMN, *(f"{muscle}[V]" for muscle in MUSCLES)),
)
EMG_RESPONSES = _block(
    "emg/responses",
    "One row each onset: 1 dorsiflexing or -1 plantarflexing, background and reflex of each "
    "muscle; NaN where it could not be measured.",
    (
        TIME_COLUMN,
        "direction[1]",
        *(f"background_{muscle}[V]" for muscle in MUSCLES),
        *(f"reflex_{muscle}[V.s]" for muscle in MUSCLES),
    ),
    rate=None,
    sparse=True,
)
EMG_ENSEMBLE = _block(
    "emg/ensemble",
    "Running average of the rectified EMG about the onsets that stretch each muscle.",
    ("lag[s]", *(f"{muscle}[V]" for muscle in MUSCLES)),
    rate=None,
)
IMPEDANCE_ESTIMATE = _block(
    "impedance/estimate",
    "Joint impedance; where valid is 0 the row holds the last valid estimate, NaN before the "
    "first one. doubt is 0 to 1, NaN where the estimator does not judge itself. The last four "
    "columns are standard errors.",
    (
        TIME_COLUMN,
        "K[N.m/rad]",
        "B[N.m.s/rad]",
        "I[kg.m^2]",
        "G[N.m.s/rad]",
        "vaf_intrinsic[%]",
        "vaf_total[%]",
        "valid[1]",
        "doubt[1]",
        "se_K[N.m/rad]",
        "se_B[N.m.s/rad]",
        "se_I[kg.m^2]",
        "se_G[N.m.s/rad]",
    ),
    plots=(("K[N.m/rad]", "impedance/K"), ("G[N.m.s/rad]", "impedance/G")),
    sparse=True,
)
IMPEDANCE_REFLEX_IRF = _block(
    "impedance/reflex_irf",
    "Reflex impulse response of a muscle: torque after a unit impulse of stretch velocity; and "
    "what a free response adds to it.",
    ("lag[s]", "h[N.m/rad]", "deviation[N.m/rad]"),
    rate=2.0,
)
IMPEDANCE_TRACKED = _block(
    "impedance/tracked",
    "Gains of terms that the model marks as tracked, each with its standard error: as "
    "maxwell_relaxation.k[N.m/rad], se_maxwell_relaxation.k[N.m/rad]; NaN before there are enough "
    "data.",
    (TIME_COLUMN,),
    rate=2.0,
    sparse=True,
)
IMPEDANCE_PROVENANCE = Topic(
    "impedance/provenance",
    STRING,
    Delivery.LATEST,
    "One line of YAML: estimator, settings, model and rig that the estimates are made with.",
)
IMPEDANCE_MODEL = Topic(
    "impedance/model",
    STRING,
    Delivery.LATEST,
    "The model file (YAML) that the estimates are made with; empty where there is none.",
)
JOINT_STATES = Topic(
    "joint_states",
    "sensor_msgs/msg/JointState",
    Delivery.PLOT,
    "Last sample of each block, for echo, plots and robot_state_publisher.",
    64.0,
)
RIG_STATE = Topic(
    "rig/state",
    STRING,
    Delivery.LATEST,
    "State of the rig's driver: disabled, ready, armed, running, stopping or fault, then ': "
    "reason'.",
)
RIG_OPERATOR_ALIVE = Topic(
    "rig/operator_alive",
    STRING,
    Delivery.PLOT,
    "Identifier of the operator's session while its page is open; the driver stops when it stays "
    "away.",
    10.0,
)
SESSION_EVENT = Topic(
    "session/event",
    STRING,
    Delivery.EVENTS,
    "One line of YAML: hold started, hold ended, target changed, fault.",
)
PLOTS = tuple(
    Topic(
        name,
        FLOAT,
        Delivery.PLOT,
        f"{column} of {topic.name}, at most 32 Hz, for tools that plot by name.",
        32.0,
    )
    for topic in (ANKLE_SAMPLES, IMPEDANCE_ESTIMATE)
    for column, name in topic.plots
)
DIAGNOSTICS = Topic(
    "/diagnostics",
    "diagnostic_msgs/msg/DiagnosticArray",
    Delivery.PLOT,
    "Health of every node.",
    1.0,
)
CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock", Delivery.PLOT, "Simulated time of a replay.")

INPUTS = (PERTURBATION_REFERENCE, ANKLE_SAMPLES, JOINT_STATES, EMG_SAMPLES, SESSION_EVENT)
"""What the outside world gives to a session; everything else is computed from it."""

TOPICS = (
    PERTURBATION_REFERENCE,
    ANKLE_SAMPLES,
    ANKLE_TRUTH,
    JOINT_STATES,
    EMG_SAMPLES,
    EMG_RESPONSES,
    EMG_ENSEMBLE,
    IMPEDANCE_ESTIMATE,
    IMPEDANCE_REFLEX_IRF,
    IMPEDANCE_TRACKED,
    IMPEDANCE_PROVENANCE,
    IMPEDANCE_MODEL,
    RIG_STATE,
    RIG_OPERATOR_ALIVE,
    SESSION_EVENT,
    *PLOTS,
    DIAGNOSTICS,
    CLOCK,
)
