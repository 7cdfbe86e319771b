"""Parameters of the node."""

from __future__ import annotations

from ankle_node.parameters import Parameter
from biofeedback.session.protocol import PAPER
from biofeedback.voluntary_torque import CUTOFF
from biofeedback.web.cursor import NATURAL_FREQUENCY
from biofeedback.web.server import FRAME_RATE

HOST = Parameter(
    "host",
    "127.0.0.1",
    "",
    "Address that is served; any other than this computer's own needs a token.",
    fixed=True,
)
PORT = Parameter(
    "port", 8765, "1", "Port that is served; 0 takes a free one.", 0, 65535, fixed=True
)
TOKEN = Parameter(
    "token",
    "",
    "",
    "At least 16 characters; pages are then opened with ?token=... once.",
    fixed=True,
)
PROTOCOL = Parameter(
    "protocol",
    PAPER,
    "",
    "Session protocol: a name that comes with the package, or a YAML file.",
    fixed=True,
)
STATE_FILE = Parameter(
    "state_file",
    "",
    "",
    "Where progress is kept for a restart; empty: ~/.local/state/ankle/biofeedback_PORT.json.",
    fixed=True,
)
RESUME_WITHIN = Parameter(
    "resume_within",
    900.0,
    "s",
    "A session that was saved longer ago is not gone on with: a crash is noticed within minutes, "
    "the next subject comes later.",
    0.0,
    86400.0,
    fixed=True,
)
RATE = Parameter(
    "frame_rate",
    FRAME_RATE,
    "Hz",
    "Frames of the cursor (paper, section III-B.1: 20 to 30).",
    10.0,
    60.0,
    fixed=True,
)
CURSOR = Parameter(
    "cursor_frequency",
    NATURAL_FREQUENCY,
    "Hz",
    "Natural frequency of the cursor's follower; lags by 1 / (pi f).",
    1.0,
    100.0,
    fixed=True,
)
TORQUE_CUTOFF = Parameter(
    "torque_cutoff", CUTOFF, "Hz", "Low-pass of the subject's torque.", 0.1, 20.0, fixed=True
)
RIG = Parameter(
    "rig",
    "",
    "",
    "Name of the rig's driver node; empty takes the one that offers arm, start and stop.",
    fixed=True,
)

PARAMETERS = (
    HOST,
    PORT,
    TOKEN,
    PROTOCOL,
    STATE_FILE,
    RESUME_WITHIN,
    RATE,
    CURSOR,
    TORQUE_CUTOFF,
    RIG,
)
