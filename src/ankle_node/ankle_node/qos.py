"""Quality of service of each kind of delivery in `ankle_interfaces.topics`."""

from __future__ import annotations

from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy

from ankle_interfaces.topics import Delivery, Topic


def _reliable(
    depth: int, durability: QoSDurabilityPolicy = QoSDurabilityPolicy.VOLATILE
) -> QoSProfile:
    return QoSProfile(
        history=QoSHistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=QoSReliabilityPolicy.RELIABLE,
        durability=durability,
    )


BLOCK_QOS = _reliable(512)
"""Profile of a reader of blocks: it keeps eight seconds of blocks at 64 Hz. A publisher that was
held up for some seconds (a process that was stopped, a computer that slept) sends all that is due
within a tenth of a second, faster than a busy reader empties its queue: three seconds are 192
blocks. A full queue of ``ankle/samples`` takes 0.6 MB."""
PUBLISHED_BLOCKS_QOS = _reliable(2048)
"""Profile of a publisher of blocks: it keeps half a minute, for readers that ask again for what was
dropped on the way. A recorder of a graph that replays at a hundred times real time lost blocks with
64."""
EVENT_QOS = _reliable(100)
"""A session has a few hundred events in all; a slow recorder may be a hundred behind."""
LATEST_QOS = _reliable(1, QoSDurabilityPolicy.TRANSIENT_LOCAL)
"""The last message only, for readers that connect later, too."""
PLOT_QOS = _reliable(10)
"""The depth that ROS tools use."""

_OF_READERS = {
    Delivery.BLOCKS: BLOCK_QOS,
    Delivery.EVENTS: EVENT_QOS,
    Delivery.LATEST: LATEST_QOS,
    Delivery.PLOT: PLOT_QOS,
}


def reader_qos(topic: Topic) -> QoSProfile:
    """Return the profile of a subscription to a topic."""
    return _OF_READERS[topic.delivery]


def publisher_qos(topic: Topic) -> QoSProfile:
    """Return the profile of a publisher of a topic."""
    return PUBLISHED_BLOCKS_QOS if topic.delivery is Delivery.BLOCKS else reader_qos(topic)
