"""QoS between the graph (rclpy) and a bag (rosbags)."""

from __future__ import annotations

from collections.abc import Collection

from rclpy.duration import Duration
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

from session_recorder.bag_metadata import INFINITE_DURATION

# Of a latched topic whose depth the graph did not state: one second of blocks.
LATCHED_DEPTH = 64
# A minute of blocks. KEEP_ALL instead of a deep KEEP_LAST lost messages of a graph replayed at full
# speed.
RECORD_DEPTH = 5000
# Room for what the middleware has not handed over yet. Blocks need only `flow_control.WINDOW`;
# other topics are not counted one by one, but go along with the blocks, one to a block or fewer.
REPLAY_DEPTH = 1000


def from_ros(profile: QoSProfile) -> Qos:
    """Return a publisher's profile, as the graph states it, in the form that a bag stores."""
    return Qos(
        QosHistory(int(profile.history)),
        profile.depth,
        QosReliability(int(profile.reliability)),
        QosDurability(int(profile.durability)),
        _time(profile.deadline),
        _time(profile.lifespan),
        QosLiveliness(int(profile.liveliness)),
        _time(profile.liveliness_lease_duration),
        bool(profile.avoid_ros_namespace_conventions),
    )


def _time(duration: Duration) -> QosTime:
    seconds, rest = divmod(duration.nanoseconds, 1_000_000_000)
    return INFINITE_DURATION if duration.nanoseconds in (0, 2**63 - 1) else QosTime(seconds, rest)


def to_record(offered: Collection[QoSProfile]) -> QoSProfile:
    """Return the QoS with which a subscription matches every publisher of these profiles.

    Nothing is overwritten with it.

    As rosbag2 does: reliable or latched only where every publisher is.
    """
    reliable = all(profile.reliability == QoSReliabilityPolicy.RELIABLE for profile in offered)
    latched = bool(offered) and all(
        profile.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL for profile in offered
    )
    return QoSProfile(
        history=QoSHistoryPolicy.KEEP_LAST,
        depth=RECORD_DEPTH,
        reliability=QoSReliabilityPolicy.RELIABLE if reliable else QoSReliabilityPolicy.BEST_EFFORT,
        durability=QoSDurabilityPolicy.TRANSIENT_LOCAL if latched else QoSDurabilityPolicy.VOLATILE,
    )


def to_replay(recorded: Collection[Qos]) -> QoSProfile:
    """Return the QoS that a replay offers.

    It has the recorded publishers' reliability and durability, and room for what is on its way.

    A latched topic keeps its recorded depth, because it is kept for readers that come late.
    """
    reliable = all(profile.reliability != QosReliability.BEST_EFFORT for profile in recorded)
    latched = bool(recorded) and all(
        profile.durability == QosDurability.TRANSIENT_LOCAL for profile in recorded
    )
    depth = max((profile.depth for profile in recorded), default=0)
    return QoSProfile(
        history=QoSHistoryPolicy.KEEP_LAST,
        depth=(depth or LATCHED_DEPTH) if latched else max(depth, REPLAY_DEPTH),
        reliability=QoSReliabilityPolicy.RELIABLE if reliable else QoSReliabilityPolicy.BEST_EFFORT,
        durability=QoSDurabilityPolicy.TRANSIENT_LOCAL if latched else QoSDurabilityPolicy.VOLATILE,
    )
