"""The real graph: four processes over DDS, their topics, their bag, and estimates made again from
it.
"""

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from ankle_bringup.graph import load_graph
from ankle_bringup.processes import Processes
from ankle_bringup.regenerate import agreement, regenerate_by_replay
from impedance_estimator.offline.recorded_estimates import estimate_bag
from impedance_estimator.simultaneous.settings import SimultaneousSettings
from session_recorder.bag_reader import BagReader

pytestmark = pytest.mark.live

SECONDS = 12.0
SAMPLES = round(SECONDS * 2048)
# topic: type, columns, messages a second (docs/ros2.md)
TOPICS = {
    "/perturbation/reference": (
        "Float64MultiArray",
        "t[s],position[rad],velocity[rad/s],acceleration[rad/s^2]",
        64,
    ),
    "/ankle/samples": ("Float64MultiArray", "t[s],position[rad],velocity[rad/s],torque[N.m]", 64),
    "/joint_states": ("JointState", None, 64),
    "/ankle/truth": ("Float64MultiArray", "t[s],K[N.m/rad],G[N.m.s/rad],voluntary_torque[N.m]", 64),
    "/impedance/estimate": (
        "Float64MultiArray",
        "t[s],K[N.m/rad],B[N.m.s/rad],I[kg.m^2],G[N.m.s/rad],vaf_intrinsic[%],vaf_total[%],valid[1],",
        64,
    ),
    "/impedance/reflex_irf": ("Float64MultiArray", "lag[s],h[N.m/rad]", 2),
    "/diagnostics": ("DiagnosticArray", None, 4),
}


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """A recorded session of the simulated laboratory."""
    folder = tmp_path_factory.mktemp("laboratory")
    # A short settling time, so that there are estimates to compare within the test's few seconds.
    settings = [
        f"record.out={folder / 'bag'}",
        f"perturbation_generator.duration={SECONDS}",
        "impedance_estimator.settling_time=3.0",
    ]
    with Processes(
        load_graph("simulated_recorded").with_settings(settings), folder / "logs"
    ) as processes:
        processes.wait_for_end("perturbation_generator", 180.0)
        codes = processes.stop()
    assert codes == dict.fromkeys(codes, 0)
    return folder


@pytest.mark.timeout(240)
def test_topics_types_columns_and_rates_are_as_designed(session):
    bag = BagReader(session / "bag")
    assert bag.complete
    for topic, (kind, columns, rate) in TOPICS.items():
        assert bag.topics[topic].type.endswith(f"/{kind}")
        assert bag.topics[topic].count >= 0.8 * rate * SECONDS
        if columns is not None:
            assert ",".join(next(iter(bag.blocks(topic))).columns).startswith(columns)


def test_no_sample_is_lost_and_time_is_regular(session):
    bag = BagReader(session / "bag")
    for topic in ("/perturbation/reference", "/ankle/samples"):
        _, data = bag.signal(topic)
        assert len(data) == SAMPLES
        assert np.abs(np.diff(data[:, 0]) * 2048 - 1.0).max() < 1e-2
        assert np.isfinite(data).all()


def test_the_bag_opens_with_other_tools(session):
    bag = BagReader(session / "bag")
    with open(next((session / "bag").glob("*.mcap")), "rb") as stream:
        decoded = [
            (c.topic, m.log_time)
            for _, c, m, _ in make_reader(
                stream, decoder_factories=[DecoderFactory()]
            ).iter_decoded_messages()
        ]
    assert len(decoded) == bag.count
    with AnyReader([session / "bag"]) as reader:
        assert reader.message_count == bag.count
        connection = next(c for c in reader.connections if c.topic == "/ankle/samples")
        first = next(reader.messages([connection]))[2]
        message = reader.deserialize(first, connection.msgtype)
        assert message.layout.dim[1].label == TOPICS["/ankle/samples"][1]


@pytest.mark.timeout(240)
def test_replay_and_file_give_the_estimates_of_the_live_run(session):
    settings = ("impedance_estimator.settling_time=3.0",)
    regenerate_by_replay(
        session / "bag", session / "replayed", session / "logs", settings, patience=180.0
    )
    estimate_bag(
        session / "bag", session / "estimated", settings=SimultaneousSettings(settling_time=3.0)
    )
    columns, live = BagReader(session / "bag").signal("/impedance/estimate")
    assert (live[:, columns.index("valid[1]")] == 1.0).any()
    for other in ("replayed", "estimated"):
        _, again = BagReader(session / other).signal("/impedance/estimate")
        found = agreement(columns, live, again)
        assert (found.only_first, found.only_second) == (0, 0)
        assert found.largest <= 1e-9
