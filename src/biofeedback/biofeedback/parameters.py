"""Parameters of the node."""

from __future__ import annotations

from ankle_interfaces.quantity import Quantity
from biofeedback.session.protocol import PAPER
from biofeedback.voluntary_torque import CUTOFF
from biofeedback.web.cursor import NATURAL_FREQUENCY
from biofeedback.web.server import FRAME_RATE

HOST = Quantity(
    "host",
    default="127.0.0.1",
    description="Address that is served; any other than this computer's own needs a token.",
    start_only=True,
)
PORT = Quantity(
    "port",
    "1",
    0,
    65535,
    8765,
    description="Port that is served; 0 takes a free one.",
    start_only=True,
)
TOKEN = Quantity(
    "token",
    default="",
    description=(
        "Access token of the operator, at least 16 characters; entered once at /enter. The "
        "subject's screen has one of its own, in the file of addresses that the node writes."
    ),
    start_only=True,
)
CERTIFICATE = Quantity(
    "certificate",
    default="",
    description="PEM file of the laboratory's TLS certificate; empty: HTTP.",
    start_only=True,
)
KEY = Quantity(
    "key", default="", description="PEM file of the certificate's private key.", start_only=True
)
LANGUAGE = Quantity(
    "language",
    default="en",
    description="Language of the subject's screen.",
    choices=("en", "nl", "de", "fr"),
    start_only=True,
)
PROTOCOL = Quantity(
    "protocol",
    default=PAPER,
    description="Session protocol: a name that comes with the package, or a YAML file.",
    start_only=True,
)
COURSE = Quantity(
    "course",
    default="",
    description=(
        "Conditioning course: a name that comes with the package, or a YAML file; takes the "
        "protocol's place. Needs the parameter subject."
    ),
    start_only=True,
)
SUBJECT = Quantity(
    "subject", default="", description="Pseudonym of the subject, as S07.", start_only=True
)
VISIT = Quantity(
    "visit",
    "1",
    0,
    9999,
    0,
    description="Number of the visit, shown on the operator's page; 0: not stated.",
    start_only=True,
)
BODY_MASS = Quantity(
    "body_mass",
    "kg",
    0.0,
    300.0,
    0.0,
    description="Body mass, for K and G by it on the operator's page; 0: not stated.",
    start_only=True,
)
RIG_FILE = Quantity(
    "rig_file",
    default="",
    description=(
        "Calibration of the rig (rig.yaml) that the check list reads, and that a protocol which "
        "calibrates the rig writes; empty: none, and for that protocol ~/.local/state/ankle."
    ),
    start_only=True,
)
RIG_CALIBRATION_DAYS = Quantity(
    "rig_calibration_days",
    "d",
    1.0,
    3650.0,
    90.0,
    description=(
        "For how long a rig's calibration holds; a quarter, as laboratories check force plates."
    ),
    start_only=True,
)
SUBJECT_FILE = Quantity(
    "subject_file",
    default="",
    description=(
        "Model of the subject (subject.yaml) of this visit, which the session's calibration writes "
        "and the check list reads; empty: one of this subject and visit in ~/.local/state/ankle."
    ),
    start_only=True,
)
COURSE_RECORD = Quantity(
    "course_record",
    default="",
    description=(
        "Record of the subject's course, from which the next session follows; empty: in a study "
        "the subject's folder, else ~/.local/state/ankle/course_SUBJECT.yaml."
    ),
    start_only=True,
)
STATE_FILE = Quantity(
    "state_file",
    default="",
    description=(
        "File of the progress, for a restart; empty: one of this port, subject and visit in "
        "~/.local/state/ankle."
    ),
    start_only=True,
)
RESUME_WITHIN = Quantity(
    "resume_within",
    "s",
    0.0,
    86400.0,
    900.0,
    description=(
        "A session that was saved longer ago is not continued: a crash is noticed within minutes, "
        "the next subject comes later."
    ),
    start_only=True,
)
RATE = Quantity(
    "frame_rate",
    "Hz",
    10.0,
    60.0,
    FRAME_RATE,
    description="Frames of the cursor (paper, section III-B.1: 20 to 30).",
    start_only=True,
)
CURSOR = Quantity(
    "cursor_frequency",
    "Hz",
    1.0,
    100.0,
    NATURAL_FREQUENCY,
    description="Natural frequency of the cursor's follower; lags by 1 / (pi f).",
    start_only=True,
)
TORQUE_CUTOFF = Quantity(
    "torque_cutoff",
    "Hz",
    0.1,
    20.0,
    CUTOFF,
    description="Low-pass of the subject's torque.",
    start_only=True,
)
RIG = Quantity(
    "rig",
    default="",
    description=(
        "Name of the rig's driver node; empty takes the one that offers arm, start and stop."
    ),
    start_only=True,
)

PARAMETERS = (
    HOST,
    PORT,
    TOKEN,
    CERTIFICATE,
    KEY,
    LANGUAGE,
    PROTOCOL,
    COURSE,
    SUBJECT,
    VISIT,
    BODY_MASS,
    COURSE_RECORD,
    RIG_FILE,
    RIG_CALIBRATION_DAYS,
    SUBJECT_FILE,
    STATE_FILE,
    RESUME_WITHIN,
    RATE,
    CURSOR,
    TORQUE_CUTOFF,
    RIG,
)
