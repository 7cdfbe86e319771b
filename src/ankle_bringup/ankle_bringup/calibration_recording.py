"""The recording of a running laboratory from which a rig or a session is calibrated."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

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
                    "('ankle up rig'), or name its --namespace"
                )
            time.sleep(0.1)
        if moving and not echo(node, topic, lambda text: None, 1, RIG_SECONDS):
            raise RunError(
                f"no samples come on '{topic}' within {RIG_SECONDS:g} s: the rig has to run, with "
                "its perturbation"
            )


@contextmanager
def recorded_into(bag: Path) -> Iterator[None]:
    """Remove the bag of this recording where it holds no samples, however the recording ended.

    Parameters
    ----------
    bag
        Place of the new bag.

    Raises
    ------
    RunError
        The recording ended well and holds no samples.
    """
    import shutil

    from ankle_bringup.errors import RunError

    empty = False
    try:
        yield
    finally:
        empty = bag.exists() and not _holds_samples(bag)
        if empty:
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


def record_session(bag: Path, seconds: float, namespace: str) -> None:
    """Record the running graph, counted from when the recorder is ready.

    Parameters
    ----------
    bag
        Place of the new bag.
    seconds
        Length of the recording [s].
    namespace
        Of the laboratory.

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
            progress(f"recording {seconds:g} s of the running session") as show,
        ):
            started = time.monotonic()
            while not bag.exists():
                processes.ended("")
                if time.monotonic() - started > RECORDER_SECONDS:
                    raise RunError(f"no recording has begun within {RECORDER_SECONDS:g} s")
                time.sleep(0.1)
            began = time.monotonic()
            while (passed := time.monotonic() - began) < seconds:
                processes.ended("")
                show(passed / seconds)
                time.sleep(0.25)
    except KeyboardInterrupt:
        lasted = 0.0 if began is None else time.monotonic() - began
        raise RunError(
            f"the recording was ended after {lasted:.0f} s of {seconds:g} s; nothing is calibrated"
        ) from None
