"""The recording of a running laboratory from which a rig or a session is calibrated."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rclpy.node import Node

GENERATOR = "perturbation_generator"
LABORATORY = "'ankle up rig_to_calibrate', whose generator waits for the calibration"
RECORDED_AFTER = 3.0
"""[s] Time for which the recording goes on after the last movement: the reference is sent up to 1 s
ahead, and a request takes some tenths of a second."""
STATE_SECONDS = 3.0
"""[s] Time for a rig's state to arrive, which is kept for whoever asks: twice a discovery."""
RECORDER_SECONDS = 60.0
"""[s] Time for a recorder to start: 2 s, and half a minute on a busy computer."""
RIG_SECONDS = 5.0
"""[s] Time for a running rig to be found, and again to send samples: discovery takes some tenths of
a second, and more on a busy computer."""


def require_running(namespace: str, moving: bool = False) -> None:
    """Refuse to record where no rig runs, or where it sends nothing though it should move.

    A simulated rig sends samples only once it is moved, so that without `moving` it is enough that
    somebody would send them.

    Parameters
    ----------
    namespace
        Of the laboratory.
    moving
        Whether samples have to come.

    Raises
    ------
    RunError
        No rig runs, or it sends nothing.
    """
    import time

    from ankle_bringup.errors import RunError
    from ankle_bringup.live_graph import echo, observer
    from ankle_interfaces.topics import ANKLE_SAMPLES

    with observer(own_signals=True, namespace=namespace) as node:
        topic = node.resolve_topic_name(ANKLE_SAMPLES.name)
        deadline = time.monotonic() + RIG_SECONDS
        while not node.count_publishers(topic):
            if time.monotonic() > deadline:
                raise RunError(
                    f"no rig runs: nobody publishes '{topic}' within {RIG_SECONDS:g} s; start one "
                    "('ankle up rig'; to calibrate it, 'ankle up rig_to_calibrate'), or name its "
                    "--namespace"
                )
            time.sleep(0.1)
        if moving and not echo(node, topic, lambda text: None, 1, RIG_SECONDS):
            raise RunError(
                f"no samples come on '{topic}' within {RIG_SECONDS:g} s: the rig has to run, with "
                "its perturbation"
            )


@contextmanager
def recorded_into(bag: Path, whole: bool = False) -> Iterator[None]:
    """Remove the bag of this recording where it holds no samples, however the recording ended.

    Parameters
    ----------
    bag
        Place of the new bag.
    whole
        Whether a part of the recording is of no use, and is removed as well.

    Raises
    ------
    RunError
        The recording ended well and holds no samples.
    """
    import shutil

    from ankle_bringup.errors import RunError

    empty, ended_well = False, False
    try:
        yield
        ended_well = True
    finally:
        empty = bag.exists() and not _holds_samples(bag)
        if empty or (whole and not ended_well and bag.exists()):
            shutil.rmtree(bag)
    if empty:
        raise RunError(f"no samples came while {bag} was recorded, so that it is removed again")


def _holds_samples(bag: Path) -> bool:
    """Tell whether a bag holds samples, or something that cannot be read and may be samples."""
    from ankle_interfaces.topics import ANKLE_SAMPLES
    from session_recorder.bag_reader import BagReader
    from session_recorder.errors import BagError

    try:
        topics = BagReader(bag).topics
    except BagError:
        return any(file.is_file() and file.stat().st_size for file in bag.rglob("*"))
    return any(
        topic.count for name, topic in topics.items() if name.endswith(ANKLE_SAMPLES.absolute)
    )


def record_rig(bag: Path, amplitude: float, namespace: str) -> None:
    """Record the movements that calibrate a rig, of a running laboratory whose generator waits.

    Where the recording ends before its time, the plate goes back to rest: in the worst case it ends
    a slow sweep of 5 s, and comes back in another 5 s.

    Parameters
    ----------
    bag
        Place of the new bag.
    amplitude
        Largest distance of the plate from rest [rad].
    namespace
        Of the laboratory.

    Raises
    ------
    RunError
        The rig is not started or stops meanwhile, no generator waits for the request or it refuses
        the amplitude, or as `record_session`.
    """
    import rclpy

    from ankle_bringup.errors import RunError
    from ankle_bringup.live_graph import observer, set_parameter, trigger
    from perturbation_generator.rig_calibration import DURATION

    with observer(own_signals=True, namespace=namespace) as node:
        states = rig_states(node)
        require_state(states, node)
        _await_rest(node)
        try:
            set_parameter(node, GENERATOR, "amplitude", f"{amplitude:g}")
        except RunError as error:
            raise RunError(f"{error}; start a laboratory with {LABORATORY}") from None

        def move() -> None:
            done, sentence = trigger(node, GENERATOR, "perturb")
            if not done:
                raise RunError(f"{GENERATOR}: {sentence}; start a laboratory with {LABORATORY}")

        def follow() -> None:
            rclpy.spin_once(node, timeout_sec=0.0)
            require_state(states)

        what = "the plate moves, keep away from it"
        try:
            record_session(bag, DURATION + RECORDED_AFTER, namespace, what, move, follow)
        except BaseException:
            # The reason why it ended counts, whether the generator still answers or not.
            with suppress(RunError):
                trigger(node, GENERATOR, "rest")
            raise


def _await_rest(node: Node) -> None:
    """End the movements that another calibration has left, and wait until the plate is at rest."""
    import time

    from ankle_bringup.errors import RunError
    from ankle_bringup.live_graph import trigger
    from ankle_bringup.terminal import working

    try:
        done, sentence = trigger(node, GENERATOR, "rest")
    except RunError as error:
        raise RunError(f"{error}; start a laboratory with {LABORATORY}") from None
    if not done:
        raise RunError(f"{GENERATOR}: {sentence}; start a laboratory with {LABORATORY}")
    if (seconds := float(sentence)) > 0.0:
        with working(f"the movements of an earlier calibration end: {seconds:.0f} s"):
            time.sleep(seconds)


def rig_states(node: Node) -> list[str]:
    """Return the states of the rig, a list that grows while the node receives.

    Parameters
    ----------
    node
        Receives them.
    """
    from std_msgs.msg import String

    from ankle_interfaces.topics import RIG_STATE
    from ankle_node.node import LATEST_QOS

    states: list[str] = []

    def receive(message: Any) -> None:
        states.append(str(message.data))

    node.create_subscription(String, RIG_STATE.name, receive, LATEST_QOS)
    return states


def await_state(states: list[str], node: Node) -> None:
    """Wait for the first state of a rig, where one states it.

    Parameters
    ----------
    states, node
        As of `rig_states`.
    """
    import time

    import rclpy

    deadline = time.monotonic() + STATE_SECONDS
    while not states and time.monotonic() < deadline:
        rclpy.spin_once(node, timeout_sec=0.1)


def require_state(states: list[str], node: Node | None = None) -> None:
    """Refuse a rig that says that it does not follow the reference.

    Parameters
    ----------
    states
        Of the rig, as `rig_states` gives them.
    node
        Where the first state may still be on its way; None: it is not waited for.

    Raises
    ------
    RunError
        Names the state of the rig.
    """
    from ankle_bringup.errors import RunError

    if node is not None:
        await_state(states, node)
    if states and not states[-1].startswith("running"):
        raise RunError(
            f"the rig does not follow the perturbation, its state is '{states[-1]}': arm and start "
            "it ('ankle rig arm', 'ankle rig start'), or calibrate on the operator's page"
        )


def record_session(
    bag: Path,
    seconds: float,
    namespace: str,
    what: str = "recording the running session",
    begun: Callable[[], None] = lambda: None,
    follow: Callable[[], None] = lambda: None,
) -> None:
    """Record the running graph, counted from when the recorder is ready.

    Parameters
    ----------
    bag
        Place of the new bag.
    seconds
        Length of the recording [s].
    namespace
        Of the laboratory.
    what
        Words at the progress.
    begun, follow
        Called once the recorder is ready, and a few times a second from then on; what they raise
        ends the recording.

    Raises
    ------
    RunError
        No recording begins, it is interrupted, or the recorder ends.
    """
    import tempfile
    import time

    from ankle_bringup.errors import RunError
    from ankle_bringup.graph import Graph, NodeDescription
    from ankle_bringup.processes import Processes
    from ankle_bringup.terminal import progress
    from ankle_bringup.up import ending_by_signal

    recorder = NodeDescription(
        "session_recorder",
        "record",
        "calibration_recorder",
        {"out": str(bag)},
    )
    began = None
    try:
        with (
            ending_by_signal(),
            tempfile.TemporaryDirectory() as logs,
            Processes(
                Graph("a recorder", (recorder,)).in_namespace(namespace), Path(logs)
            ) as processes,
            progress(f"{what}, {seconds:g} s") as show,
        ):
            started = time.monotonic()
            while not bag.exists():
                processes.ended("")
                if time.monotonic() - started > RECORDER_SECONDS:
                    raise RunError(f"no recording has begun within {RECORDER_SECONDS:g} s")
                time.sleep(0.1)
            began = time.monotonic()
            begun()
            while (passed := time.monotonic() - began) < seconds:
                processes.ended("")
                follow()
                show(passed / seconds)
                time.sleep(0.25)
    except KeyboardInterrupt:
        lasted = 0.0 if began is None else time.monotonic() - began
        raise RunError(
            f"the recording was ended after {lasted:.0f} s of {seconds:g} s; nothing is calibrated"
        ) from None
