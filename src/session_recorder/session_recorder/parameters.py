"""Parameters of the recorder and the replayer."""

from ankle_node.parameters import Parameter

OUT = Parameter(
    "out", "", "", "Directory of the new bag; empty makes session_DATE_TIME here.", fixed=True
)
RECORDED = Parameter(
    "topics",
    "",
    "",
    "Topics to record, joined by commas; empty records every topic of the graph.",
    fixed=True,
)
FREE_DISK = Parameter(
    "min_free_disk",
    200.0,
    "MB",
    "Recording ends in good order below this; 200 MB is about ten minutes of the laboratory's "
    "topics.",
    0.0,
    1e6,
)

BAG = Parameter(
    "bag", "", "", "The bag to replay: a rosbag2 directory or an .mcap file.", fixed=True
)
REPLAYED = Parameter(
    "topics",
    "",
    "",
    "Topics joined by commas; empty replays the recorded inputs, 'all' everything.",
    fixed=True,
)
RATE = Parameter(
    "rate",
    1.0,
    "1",
    "Bag seconds per second; 0 is as fast as the readers follow.",
    0.0,
    1e6,
    fixed=True,
)
READERS = Parameter(
    "wait_for_readers",
    1,
    "1",
    "Nodes that must read a replayed topic before the start.",
    0,
    100,
    fixed=True,
)
TIMEOUT = Parameter(
    "wait_timeout", 30.0, "s", "How long to wait for them.", 0.0, 3600.0, fixed=True
)
PATIENCE = Parameter(
    "reader_timeout",
    30.0,
    "s",
    "How long a reader may take for one block before the replay gives up.",
    0.1,
    3600.0,
    fixed=True,
)

RECORDER = (OUT, RECORDED, FREE_DISK)
REPLAYER = (BAG, REPLAYED, RATE, READERS, TIMEOUT, PATIENCE)
