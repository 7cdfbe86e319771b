"""What `ankle params` and `ankle echo` say of a running graph."""

import threading

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String
from std_srvs.srv import Trigger
from typer.testing import CliRunner

from ankle_bringup.command_line import app
from ankle_bringup.errors import RunError
from ankle_bringup.live_graph import describe_parameters, echo, observer

pytestmark = pytest.mark.live


@pytest.fixture
def stopped():
    """The namespaces in which a rig was stopped; there is one in `left`, in a context of its own
    as another process has it.
    """
    namespaces = []

    def stop(request, response):
        namespaces.append(driver.get_namespace())
        response.success, response.message = True, "the plate is at rest"
        return response

    context = rclpy.Context()
    rclpy.init(context=context)
    driver = rclpy.create_node("ankle_actuator_driver", context=context, namespace="left")
    driver.create_service(Trigger, "~/stop", stop)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(driver)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()
    yield namespaces
    executor.shutdown()
    spinning.join(10.0)
    driver.destroy_node()
    rclpy.shutdown(context=context)


def test_the_rig_of_a_namespace_is_stopped_by_naming_it(stopped):
    done = CliRunner().invoke(app, ["rig", "stop", "--namespace", "left"])
    assert done.exit_code == 0, done.exception
    assert "the plate is at rest" in done.output
    elsewhere = CliRunner().invoke(app, ["rig", "stop", "--namespace", "/right"])
    assert "running: /left/ankle_actuator_driver" in str(elsewhere.exception)
    assert stopped == ["/left"]


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
