"""The measures of the visit's check list, as a recording holds them in its session events."""

from __future__ import annotations

from pathlib import Path

from ankle_node.session_event import TOPIC as EVENT_TOPIC
from ankle_node.session_event import SessionEventError, parse
from session_recorder.bag_reader import BagReader
from session_recorder.message_definitions import typestore

CHECK_DONE = "check done"
CONTRACTIONS = ("mvc_plantarflexion", "mvc_dorsiflexion")


def measured_in_visit(path: Path | str) -> dict[str, float]:
    """Return the largest voluntary torques [N.m], by the keys of a recording's sidecar file.

    Parameters
    ----------
    path
        Of the bag. Where a check was repeated, its last result holds; one that was skipped or
        failed is absent.

    Raises
    ------
    BagError
        No such bag.
    """
    bag = BagReader(path)
    if EVENT_TOPIC not in bag.topics:
        return {}
    store = typestore()
    found: dict[str, float] = {}
    for _, _, message in bag.messages([EVENT_TOPIC]):
        try:
            event = parse(store.deserialize_cdr(message, "std_msgs/msg/String").data)  # type: ignore[attr-defined]
        except SessionEventError:
            continue
        torque = event.details.get("torque[N.m]")
        name = event.details.get("check")
        if event.event == CHECK_DONE and name in CONTRACTIONS and isinstance(torque, (int, float)):
            found[f"{name}[N.m]"] = abs(float(torque))
    return found
