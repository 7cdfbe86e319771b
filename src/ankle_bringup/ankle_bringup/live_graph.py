"""Look into a running graph without the `ros2` command: topics, messages, parameters."""

from __future__ import annotations

import importlib
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
import yaml
from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ankle_bringup.errors import RunError
from ankle_bringup.namespace import absolute_namespace
from ankle_interfaces.block import MESSAGE_TYPE, Block, unpack
from ankle_interfaces.topics import TOPICS
from ankle_interfaces.yaml_text import YamlError, parse_yaml
from ankle_node.domain import stay_on_this_host
from ankle_node.node import BLOCK_QOS, LATEST_QOS
from ankle_node.qos import reader_qos
from session_recorder.ros_qos import to_record

# Discovery between processes of one host takes a few tenths of a second.
DISCOVERY_SECONDS = 1.5
ANSWER_SECONDS = 5.0


@contextmanager
def observer(
    name: str = "ankle_observer", own_signals: bool = False, namespace: str = ""
) -> Iterator[Node]:
    """Make a node that only reads.

    Discovery stays on this host unless the environment says otherwise.

    Parameters
    ----------
    name
        Beginning of the node's name.
    own_signals
        Whether the caller handles signals: rclpy would end the node at the first one.
    namespace
        Of the laboratory that it looks at. Names of nodes without a slash in front are those of
        this laboratory.

    Raises
    ------
    GraphError
        No name of a namespace that ROS accepts.
    """
    namespace = absolute_namespace(namespace)
    stay_on_this_host()
    rclpy.init(
        signal_handler_options=SignalHandlerOptions.NO if own_signals else SignalHandlerOptions.ALL
    )
    node = rclpy.create_node(f"{name}_{os.getpid()}", namespace=namespace)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def topics(node: Node) -> list[tuple[str, str, int, int]]:
    """List every topic of the graph: name, type, number of publishers, of subscribers."""
    time.sleep(DISCOVERY_SECONDS)
    found = node.get_topic_names_and_types()
    return [
        (name, ", ".join(types), node.count_publishers(name), node.count_subscribers(name))
        for name, types in sorted(found)
    ]


def echo(node: Node, topic: str, show: Callable[[str], None], count: int, seconds: float) -> int:
    """Show messages of a topic as they come: blocks as tables, all others as YAML.

    Parameters
    ----------
    node
        The node that reads.
    topic
        Name of the topic, resolved as the node's names are.
    show
        Called with the text of each message.
    count
        End after so many messages; 0 never ends by number.
    seconds
        End when nothing has come for so long.

    Returns
    -------
    int
        The number of messages shown.

    Raises
    ------
    RunError
        Nobody publishes the topic.
    """
    topic = node.resolve_topic_name(topic)
    deadline = time.monotonic() + ANSWER_SECONDS
    while not (types := dict(node.get_topic_names_and_types()).get(topic)):
        if time.monotonic() > deadline:
            known = ", ".join(name for name, _ in sorted(node.get_topic_names_and_types()))
            raise RunError(f"nobody publishes '{topic}'; topics: {known}")
        time.sleep(0.1)
    shown = 0
    last = time.monotonic()

    def receive(message: Any) -> None:
        nonlocal shown, last
        if count and shown >= count:
            return
        shown += 1
        last = time.monotonic()
        show(
            block_text(unpack(message))
            if types[0] == MESSAGE_TYPE
            else yaml.safe_dump(_plain(message), sort_keys=False)
        )

    node.create_subscription(
        _message_class(types[0]),
        topic,
        receive,
        _matching_qos(node, topic),
        raw=types[0] == MESSAGE_TYPE,
    )
    while not (count and shown >= count) and time.monotonic() - last < seconds:
        rclpy.spin_once(node, timeout_sec=0.1)
    return shown


def _matching_qos(node: Node, topic: str) -> QoSProfile:
    """Return the profile with which a reader receives a topic, also what was said before it came
    where the topic is latched.

    A topic without a publisher is read as the laboratory defines it.
    """
    offers = [one.qos_profile for one in node.get_publishers_info_by_topic(topic)]
    if offers:
        return to_record(offers)
    return next((reader_qos(one) for one in TOPICS if one.among([topic])), BLOCK_QOS)


def block_text(block: Block) -> str:
    """Return a block as a table with one row a sample."""
    lines = ["  ".join(f"{name:>18}" for name in block.columns)]
    for row in block.data:
        lines.append("  ".join([f"{row[0]:18.6f}", *(f"{value:18.9g}" for value in row[1:])]))
    return "\n".join(lines)


def _message_class(type_name: str) -> type:
    package, _, name = type_name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def _plain(value: Any) -> Any:
    if hasattr(value, "get_fields_and_field_types"):
        return {
            field: _plain(getattr(value, field)) for field in value.get_fields_and_field_types()
        }
    if isinstance(value, bytes):
        return value[0] if len(value) == 1 else value.hex(" ")
    if isinstance(value, (bool, int, float, str)):
        return value
    return [_plain(item) for item in value]


def describe_parameters(node: Node, name: str) -> list[tuple[ParameterDescriptor, Any]]:
    """Return descriptor and present value of every parameter of a running node.

    Raises
    ------
    RunError
        No such node, or no answer in time.
    """
    names = sorted(
        _ask(node, name, ListParameters, "list_parameters", ListParameters.Request()).result.names
    )
    described = _ask(
        node,
        name,
        DescribeParameters,
        "describe_parameters",
        DescribeParameters.Request(names=names),
    ).descriptors
    values = _ask(
        node, name, GetParameters, "get_parameters", GetParameters.Request(names=names)
    ).values
    return [
        (descriptor, parameter_value_to_python(value))
        for descriptor, value in zip(described, values, strict=True)
    ]


def set_parameter(node: Node, name: str, parameter: str, text: str) -> None:
    """Set a parameter of a running node; the value is written as YAML.

    Raises
    ------
    RunError
        Not YAML, refused (the message is the node's own), no such node, or no answer in time.
    """
    try:
        value = parse_yaml(text)
    except YamlError as error:
        raise RunError(f"{parameter} = {text}: {error}") from None
    message = Parameter(parameter, value=value).to_parameter_msg()
    result = _ask(
        node, name, SetParameters, "set_parameters", SetParameters.Request(parameters=[message])
    ).results[0]
    if not result.successful:
        raise RunError(f"{name}: {result.reason}")


def _ask(node: Node, name: str, kind: Any, service: str, request: Any) -> Any:
    client = node.create_client(kind, f"{name.rstrip('/')}/{service}")
    if not client.wait_for_service(timeout_sec=ANSWER_SECONDS):
        known = ", ".join(
            sorted(
                f"{namespace.rstrip('/')}/{other}"
                for other, namespace in node.get_node_names_and_namespaces()
                if other != node.get_name()
            )
        )
        raise RunError(f"no node '{name}' answers; running: {known or 'none'}")
    future = client.call_async(request)
    rclpy.spin_until_future_complete(node, future, timeout_sec=ANSWER_SECONDS)
    if future.result() is None:
        raise RunError(f"'{name}' did not answer within {ANSWER_SECONDS:g} s")
    return future.result()


def trigger(node: Node, name: str, command: str) -> tuple[bool, str]:
    """Call a std_srvs/Trigger service of a running node.

    The result is whether it was carried out, and the node's sentence.

    Raises
    ------
    RunError
        No such node, or no answer in time.
    """
    answer = _ask(node, name, Trigger, command, Trigger.Request())
    return bool(answer.success), str(answer.message)


def latched(
    node: Node, topic: str, seconds: float, wanted: Callable[[str], bool] = lambda text: True
) -> str | None:
    """Return the last text on a latched topic; None where no text that is wanted comes in time."""
    heard: list[str] = []

    def hear(message: Any) -> None:
        if wanted(str(message.data)):
            heard.append(str(message.data))

    node.create_subscription(String, topic, hear, LATEST_QOS)
    deadline = time.monotonic() + seconds
    while not heard and time.monotonic() < deadline:
        rclpy.spin_once(node, timeout_sec=0.1)
    return heard[-1] if heard else None
