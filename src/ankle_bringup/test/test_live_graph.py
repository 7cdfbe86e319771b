"""What `ankle params` and `ankle echo` say of a running graph."""

import pytest
import rclpy
from std_msgs.msg import String

from ankle_bringup.errors import RunError
from ankle_bringup.live_graph import describe_parameters, echo, observer

pytestmark = pytest.mark.live


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
