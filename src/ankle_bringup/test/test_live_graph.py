"""What `ankle params` and `ankle echo` say of a running graph."""

import gc
import threading
import time
from contextlib import closing

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String
from std_srvs.srv import Trigger
from typer.testing import CliRunner

from ankle_bringup import live_graph
from ankle_bringup.command_line import app
from ankle_bringup.errors import RunError
from ankle_bringup.live_graph import describe_parameters, echo, observer
from ankle_bringup.live_monitor import MONITORED, LiveMonitor
from ankle_interfaces.topics import IMPEDANCE_PROVENANCE, RIG_STATE, SESSION_EVENT
from ankle_node.qos import publisher_qos

pytestmark = pytest.mark.live


class Namespaces(list):
    """Namespaces in which a rig was stopped, and `say`, which publishes the state of the rig."""


@pytest.fixture
def stopped():
    """The namespaces in which a rig was stopped; there is one in `left`, in a context of its own
    as another process has it.
    """
    namespaces = Namespaces()

    def stop(request, response):
        namespaces.append(driver.get_namespace())
        response.success, response.message = True, "the plate is at rest"
        return response

    context = rclpy.Context()
    rclpy.init(context=context)
    driver = rclpy.create_node("ankle_actuator_driver", context=context, namespace="left")
    driver.create_service(Trigger, "~/stop", stop)
    state = driver.create_publisher(String, RIG_STATE.name, publisher_qos(RIG_STATE))
    state.publish(String(data="stopping: stopped by the operator"))
    namespaces.say = lambda text: state.publish(String(data=text))
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(driver)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()
    yield namespaces
    executor.shutdown()
    spinning.join(10.0)
    driver.destroy_node()
    rclpy.shutdown(context=context)


@pytest.fixture
def events():
    """A node that publishes events, in a context of its own as another process has it."""
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("speaker", context=context)
    node.create_publisher(String, SESSION_EVENT.name, publisher_qos(SESSION_EVENT))
    yield
    node.destroy_node()
    rclpy.shutdown(context=context)


def test_the_rig_of_a_namespace_is_stopped_by_naming_it(stopped):
    done = CliRunner().invoke(app, ["rig", "stop", "--namespace", "left"])
    assert done.exit_code == 0, done.exception
    assert "the plate is at rest" in done.output
    elsewhere = CliRunner().invoke(app, ["rig", "stop", "--namespace", "/right"])
    assert "running: /left/ankle_actuator_driver" in str(elsewhere.exception)
    assert stopped == ["/left"]


def test_a_stop_that_finds_a_fault_names_its_reason_and_the_next_step(stopped):
    stopped.say("fault: heartbeat lost")
    done = CliRunner().invoke(app, ["rig", "stop", "--namespace", "left"])
    assert done.exit_code != 0
    assert "(heartbeat lost)" in str(done.exception)
    assert "ankle rig reset-fault --namespace left" in str(done.exception)


def test_every_verb_of_a_running_laboratory_knows_namespace():
    parts = ("arm", "start", "stop", "disarm", "reset-fault", "state")
    words = [("rig", part) for part in parts] + [("calibrate", "rig"), ("calibrate", "session")]
    for verb in [*words, ("up",), ("record",), ("replay",)]:
        assert "--namespace" in CliRunner().invoke(app, [*verb, "--help"]).output, verb


@pytest.fixture
def looking():
    """A node that looks at the graph; another one, `sleeper`, is in the namespace `left`."""
    with observer() as node:
        sleeper = rclpy.create_node("sleeper", namespace="left")
        sleeper.create_publisher(String, "text", 1)
        yield node
        sleeper.destroy_node()


def test_a_node_of_another_namespace_is_named_as_it_has_to_be_typed(looking):
    with pytest.raises(RunError, match="no node 'sleeper' answers; running: /left/sleeper"):
        describe_parameters(looking, "sleeper")


def test_a_topic_is_found_with_and_without_a_slash(looking):
    for name in ("left/text", "/left/text"):
        assert echo(looking, name, print, count=0, seconds=0.2) == 0
    with pytest.raises(RunError, match="nobody publishes '/text'"):
        echo(looking, "text", print, count=0, seconds=0.2)


@pytest.mark.parametrize("topic", [RIG_STATE, IMPEDANCE_PROVENANCE])
def test_what_a_latched_topic_said_before_is_shown(topic):
    with observer() as node:
        speaker = rclpy.create_node("speaker")
        publisher = speaker.create_publisher(String, topic.name, publisher_qos(topic))
        publisher.publish(String(data="said before anybody listened"))
        shown = []
        assert echo(node, topic.absolute, shown.append, count=1, seconds=20.0) == 1
        assert shown == ["data: said before anybody listened\n"]
        speaker.destroy_node()


def test_a_silent_topic_of_events_says_that_earlier_ones_are_not_sent_again(events):
    done = CliRunner().invoke(app, ["echo", SESSION_EVENT.absolute, "--seconds", "0.2"])
    assert "events of before are not sent again" in str(done.exception)


def test_a_topic_of_a_laboratory_with_a_namespace_is_looked_for_there(monkeypatch):
    monkeypatch.setattr(live_graph, "ANSWER_SECONDS", 0.2)
    asked = ["echo", SESSION_EVENT.absolute, "--namespace", "left"]
    done = CliRunner().invoke(app, asked)
    assert f"nobody publishes '/left{SESSION_EVENT.absolute}'" in str(done.exception)


def test_a_monitor_that_is_closed_is_no_reader_any_more():
    """Whether or not Python has collected it: its subscriptions refer to it and to each other."""
    gc.collect()
    gc.disable()
    try:
        with observer("first") as node, closing(LiveMonitor(node)) as monitor:
            monitor.spin(0.5)
        with observer("second") as node:
            time.sleep(1.5)
            assert [node.count_subscribers(topic) for topic in MONITORED] == [0, 0, 0, 0]
    finally:
        gc.enable()
