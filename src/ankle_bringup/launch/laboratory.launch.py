"""`ros2 launch ankle_bringup laboratory.launch.py graph:=simulated`: the graph that `ankle up` runs
too.
"""

import tempfile
from pathlib import Path

from ament_index_python.packages import (
    PackageNotFoundError,
    get_package_prefix,
    get_package_share_directory,
)
from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    LogInfo,
    OpaqueFunction,
    SetEnvironmentVariable,
)
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node

from ankle_bringup.graph import load_graph
from ankle_bringup.recorded_estimator import set_as_recorded


def nodes_of(context):
    """Return the nodes of the chosen graph."""
    settings = [
        text for text in LaunchConfiguration("settings").perform(context).split(";") if text.strip()
    ]
    options = ["emulator"] if LaunchConfiguration("emulator").perform(context) == "true" else []
    graph = (
        load_graph(LaunchConfiguration("graph").perform(context))
        .with_options(options)
        .in_namespace(LaunchConfiguration("namespace").perform(context))
    )
    params_file = LaunchConfiguration("params_file").perform(context)
    if params_file:
        graph = graph.with_parameter_file(params_file)
    graph = graph.with_settings(settings)
    graph, sentences = set_as_recorded(graph, Path(tempfile.mkdtemp(prefix="ankle_")))
    return [
        *(LogInfo(msg=sentence) for sentence in sentences),
        *state_publisher(graph.namespace),
        *(process(node) for node in graph.nodes),
    ]


def process(node):
    """Return one node of the graph as a process."""
    return Node(
        package=node.package,
        executable=node.executable,
        name=node.name,
        namespace=node.namespace,
        parameters=[node.parameters] if node.parameters else [],
        remappings=list(node.remappings.items()),
        output="screen",
    )


def state_publisher(namespace):
    """Return robot_state_publisher with the ankle's description, where it is installed."""
    try:
        get_package_prefix("robot_state_publisher")
    except PackageNotFoundError:
        return []
    path = Path(get_package_share_directory("ankle_bringup")) / "description" / "ankle.urdf"
    prefix = f"{namespace.strip('/')}/" if namespace.strip("/") else ""
    return [
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            namespace=namespace,
            parameters=[{"robot_description": path.read_text(), "frame_prefix": prefix}],
            output="screen",
        )
    ]


def generate_launch_description():
    """Return what `ros2 launch` asks for."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "graph",
                default_value="simulated",
                description="a graph of ankle_bringup, or the path of a YAML file",
            ),
            DeclareLaunchArgument(
                "settings",
                default_value="",
                description="node.parameter=value, several separated by ';'",
            ),
            DeclareLaunchArgument(
                "emulator",
                default_value="false",
                choices=["true", "false"],
                description="with graph:=rig: emulate the rig",
            ),
            DeclareLaunchArgument(
                "namespace",
                default_value="",
                description="namespace of all nodes and topics: a laboratory of its own",
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value="",
                description="ROS parameter file, laid over the graph's parameters",
            ),
            SetEnvironmentVariable(
                "ROS_AUTOMATIC_DISCOVERY_RANGE",
                EnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", default_value="LOCALHOST"),
            ),
            OpaqueFunction(function=nodes_of),
        ]
    )
