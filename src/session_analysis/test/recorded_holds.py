"""Bags of sessions with holds, as the recorder leaves them, without samples: events, estimates,
responses of the EMG, what the estimates are made with, and the health of the nodes.
"""

import numpy as np

from ankle_interfaces.block import Block
from ankle_interfaces.topics import DIAGNOSTICS
from ankle_node.session_event import TOPIC as EVENT_TOPIC
from ankle_node.session_event import SessionEvent
from emg_driver.muscles import RESPONSE_COLUMNS, RESPONSE_TOPIC
from impedance_estimator.estimator import ESTIMATE_COLUMNS, ESTIMATE_TOPIC
from impedance_estimator.offline.recorded_estimates import PROVENANCE_TOPIC
from session_analysis.recorded_session import LAG_KEY
from session_recorder.message_definitions import typestore

TEXT = "std_msgs/msg/String"


def provenance(model="null", rig="null", algorithm="simultaneous", memory=20.0):
    """What an estimator states; model and rig are null or a title."""
    calibration = ", ".join(
        f"{key}: {title if title == 'null' else f'{{title: {title}, sha256: {title}00}}'}"
        for key, title in (("model", model), ("rig", rig))
    )
    return f"{{algorithm: {algorithm}, {calibration}, settings: {{memory: {memory}}}}}"


def write_text(writer, topic, time, text):
    """At this time [s] of the recorder."""
    store = typestore()
    message = store.types[TEXT](data=text)
    writer.write(topic, round(time * 1e9), bytes(store.serialize_cdr(message, TEXT)))


def _state_lag(writer, time, lag):
    store = typestore()
    pair = store.types["diagnostic_msgs/msg/KeyValue"](key=LAG_KEY, value=f"{1e3 * lag:.1f}")
    status = store.types["diagnostic_msgs/msg/DiagnosticStatus"](
        level=0, name="emg_processor", message="", hardware_id="", values=[pair]
    )
    stamp = store.types["builtin_interfaces/msg/Time"](sec=int(time), nanosec=0)
    header = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
    array = store.types[DIAGNOSTICS.message](header=header, status=[status])
    message = bytes(store.serialize_cdr(array, DIAGNOSTICS.message))
    writer.write(DIAGNOSTICS.name, round(time * 1e9), message)


def _estimates(start, doubt):
    time = np.arange(start, start + 60.0, 1 / 16)
    rows = np.zeros((len(time), len(ESTIMATE_COLUMNS)))
    rows[:, 0] = time
    for name, value in (("K[N.m/rad]", 80.0), ("G[N.m.s/rad]", 5.0), ("valid[1]", 1.0)):
        rows[:, ESTIMATE_COLUMNS.index(name)] = value
    rows[: len(time) // 4, ESTIMATE_COLUMNS.index("doubt[1]")] = doubt
    return rows


def _responses(start):
    time = np.linspace(start + 0.1, start + 59.9, 200)
    rows = np.full((len(time), len(RESPONSE_COLUMNS)), 1e-6)
    rows[:, 0], rows[:, 1] = time, np.where(np.arange(len(time)) % 2, -1.0, 1.0)
    return rows


def write_session(
    writer, stated, holds=(100.0, 200.0), doubt=0.0, lag=None, length=60.0, delay=0.0
):
    """A hold of this length from each of these times on [s].

    `stated` are times and lines of provenance; a quarter of the estimates has this doubt; `lag` [s]
    is what the EMG processing says in the holds. Everything is recorded by `delay` [s] later.
    """
    for topic in (ESTIMATE_TOPIC, RESPONSE_TOPIC):
        writer.add_topic(topic)
    for topic, kind in (
        (EVENT_TOPIC, TEXT), (PROVENANCE_TOPIC, TEXT), (DIAGNOSTICS.name, DIAGNOSTICS.message)
    ):  # fmt: skip
        writer.add_topic(topic, kind)
    for time, line in stated:
        write_text(writer, PROVENANCE_TOPIC, time + delay, line)
    for number, start in enumerate(holds, 1):
        details = {"hold": number, "torque_target[N.m]": 0.0}
        line = SessionEvent("hold started", start, details).line()
        write_text(writer, EVENT_TOPIC, start + delay, line)
        writer.write_block(ESTIMATE_TOPIC, Block(ESTIMATE_COLUMNS, _estimates(start, doubt)))
        writer.write_block(RESPONSE_TOPIC, Block(RESPONSE_COLUMNS, _responses(start)))
        if lag is not None:
            _state_lag(writer, start + delay + 30.0, lag)
        end = start + length
        write_text(writer, EVENT_TOPIC, end + delay, SessionEvent("hold ended", end).line())
