"""A node's process from its start to its end, which a signal or the node itself brings about."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Sequence
from types import FrameType
from typing import TYPE_CHECKING

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from ankle_interfaces.error_report import USERS_ERROR, report_error
from ankle_node.block_executor import BlockExecutor
from ankle_node.domain import stay_on_this_host
from ankle_node.node_with_parameters import NodeWithParameters
from ankle_node.unblocked_output import NO_LOG_FILES, unblocked_output

if TYPE_CHECKING:
    from ankle_node.node import AnkleNode

STOP_POLL_PERIOD = 0.1
"""[s] Longest time from a signal to the stop of a node that nothing else wakes."""


class StopSignal:
    """Receives SIGINT and SIGTERM: while the node is made they interrupt whatever it does (a
    compilation takes half a minute), afterwards they are noted, so that the node ends in good
    order.
    """

    def __init__(self) -> None:
        self.starting = True
        # No lock and so no event: a second signal in the middle of the first one's handler would
        # wait for ever for what this thread holds.
        self._received = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._receive)

    @property
    def received(self) -> bool:
        """Tell whether the process was asked to stop."""
        return self._received

    def _receive(self, number: int, frame: FrameType | None) -> None:
        self._received = True
        if self.starting:
            self.starting = False
            raise KeyboardInterrupt


def run(make: Callable[[], AnkleNode], arguments: Sequence[str] | None = None) -> int:
    """Start rclpy, spin the node until the process is asked to stop, and clean up.

    Discovery stays on this host unless the environment says otherwise.

    Parameters
    ----------
    make
        Function that makes the node.
    arguments
        Command line; that of the process where None.

    Returns
    -------
    int
        Exit code: 0 after a stop by signal or by the node itself, `USERS_ERROR` or `PROGRAM_ERROR`
        of `ankle_interfaces.error_report` after an error, which is one line on stderr.
    """
    stay_on_this_host()
    with unblocked_output():
        return _run(make, [*(sys.argv if arguments is None else arguments), *NO_LOG_FILES])


def _run(make: Callable[[], AnkleNode], arguments: list[str]) -> int:
    try:
        other = remove_ros_args(arguments)[1:]
    except RuntimeError as error:  # rclpy's own class for it is private
        return _fail(error)
    if other:
        return _fail(f"argument '{other[0]}' is unknown; parameters and names follow --ros-args")
    # rclpy's own handlers would close the context at once, with the last blocks still on their way.
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    node: AnkleNode | None = None
    try:
        stop = StopSignal()
        NodeWithParameters.arguments = arguments
        node = make()
        stop.starting = False
        executor = BlockExecutor()
        executor.add_node(node)
        while rclpy.ok() and not stop.received:
            executor.spin_once(timeout_sec=STOP_POLL_PERIOD)
        node.process_waiting(executor)
        node.hand_over()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except Exception as error:
        return report_error(error)
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _fail(reason: object) -> int:
    """Write why the node ends, as one line on stderr; return the exit code."""
    print(f"error: {reason}", file=sys.stderr, flush=True)
    return USERS_ERROR
