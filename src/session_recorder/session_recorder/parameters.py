"""Parameters of the recorder and the replayer."""

from ankle_interfaces.quantity import Quantity

OUT = Quantity(
    "out",
    default="",
    description="Directory of the new bag; empty makes session_DATE_TIME here.",
    start_only=True,
)
RECORDED = Quantity(
    "topics",
    default="",
    description="Topics to record, joined by commas; empty records every topic of the graph.",
    start_only=True,
)
FREE_DISK = Quantity(
    "min_free_disk",
    "MB",
    0.0,
    1e6,
    200.0,
    description=(
        "Recording ends in good order below this; 200 MB is about ten minutes of the laboratory's "
        "topics."
    ),
)

RIG = Quantity(
    "rig",
    default="",
    description="The calibrated rig in force (rig.yaml), which the bag carries. Empty: none.",
    start_only=True,
)

BAG = Quantity(
    "bag",
    default="",
    description="The bag to replay: a rosbag2 directory or an .mcap file.",
    start_only=True,
)
REPLAYED = Quantity(
    "topics",
    default="",
    description="Topics joined by commas; empty replays the recorded inputs, 'all' everything.",
    start_only=True,
)
RATE = Quantity(
    "rate",
    "1",
    0.0,
    1e6,
    1.0,
    description="Bag seconds per second; 0 is as fast as the readers follow.",
    start_only=True,
)
READERS = Quantity(
    "wait_for_readers",
    "1",
    0,
    100,
    1,
    description="Nodes that must read a replayed topic before the start.",
    start_only=True,
)
TIMEOUT = Quantity(
    "wait_timeout",
    "s",
    0.0,
    3600.0,
    30.0,
    description="Longest wait for the readers.",
    start_only=True,
)
PATIENCE = Quantity(
    "reader_timeout",
    "s",
    0.1,
    3600.0,
    30.0,
    description="Longest time that a reader may take for one block; then the replay gives up.",
    start_only=True,
)

RECORDER = (OUT, RECORDED, FREE_DISK, RIG)
REPLAYER = (BAG, REPLAYED, RATE, READERS, TIMEOUT, PATIENCE)
