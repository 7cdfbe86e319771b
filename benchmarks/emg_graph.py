"""The graph with EMG as seven processes: lost samples, time of the EMG against that of the samples
it was made with, load.

    .venv/bin/python benchmarks/emg_graph.py --seconds 60      # the figures of docs/performance.md
    .venv/bin/python benchmarks/emg_graph.py --seconds 600     # a session

Generator, simulated ankle with a simulated subject, an outlet of Lab Streaming Layer whose clock
drifts by 50 ppm, bridge, processor, estimator and recorder. The recorder also takes the EMG as the
simulated ankle made it; the same samples are found again in what came through the bridge by their
values, and their two times are compared.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from graph import processor_seconds

from ankle_bringup.graph import load_graph
from ankle_bringup.processes import Processes
from ankle_node.domain import take_free_domain
from session_recorder.bag_reader import BagReader

SIMULATED, BRIDGED_TOPIC = "/emg/simulated", "/emg/samples"
VOLTAGE_TOLERANCE = (
    1e-10  # V; the amplifier sends microvolts as 32-bit numbers, good to 1e-11 V here
)


def time_errors(sent: np.ndarray, received: np.ndarray) -> tuple[np.ndarray, int]:
    """Received less sent time [s] of every sample received, and how many of those sent between them
    are missing.

    Parameters
    ----------
    sent, received
        T [s] and EMG [V], shape (n, 5), in the order of time.
    """
    wanted = received[np.isfinite(received).all(axis=1)]
    # Three muscles together: one value alone comes again within ten minutes.
    key = {
        values: index
        for index, values in enumerate(
            map(tuple, np.round(sent[:, 1:4] / VOLTAGE_TOLERANCE).tolist())
        )
    }
    found = np.array(
        [
            key.get(values, -1)
            for values in map(tuple, np.round(wanted[:, 1:4] / VOLTAGE_TOLERANCE).tolist())
        ]
    )
    ok = found >= 0
    pairs = found[ok]
    between = sent[pairs.min() : pairs.max() + 1] if len(pairs) else sent[:0]
    inside = (
        received[(received[:, 0] >= wanted[ok][0, 0]) & (received[:, 0] <= wanted[ok][-1, 0])]
        if len(pairs)
        else received[:0]
    )
    return wanted[ok, 0] - sent[pairs, 0], len(between) - len(inside)


def main() -> int:
    """Run, print a table, exit with 1 where a sample was lost or time was off by more than 1 ms."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--seconds", type=float, default=60.0)
    seconds = options.parse_args().seconds
    take_free_domain()
    stream = f"benchmark {os.getpid()}"
    with tempfile.TemporaryDirectory() as folder:
        settings = [
            f"record.out={folder}/bag",
            f"perturbation_generator.duration={seconds}",
            f"emg_outlet.stream_name={stream}",
            f"emg_bridge.stream_name={stream}",
        ]
        graph = load_graph("simulated_emg").with_settings(settings)
        with Processes(graph, Path(folder) / "logs") as processes:
            pids, began, reported = processes.pids, time.monotonic(), time.monotonic()
            load: dict[str, float] = {}
            while not processes.ended("perturbation_generator"):
                time.sleep(0.2)
                load.update(
                    {
                        name: processor_seconds(pid)
                        for name, pid in pids.items()
                        if name in processes.names
                    }
                )
                if time.monotonic() - reported > 10.0:
                    reported = time.monotonic()
                    print(
                        f"{reported - began:5.0f} s since the start, of {seconds:.0f} s and the "
                        "start of seven nodes",
                        file=sys.stderr,
                        flush=True,
                    )
            time.sleep(3.0)
            processes.stop()
        bag = BagReader(f"{folder}/bag")
        counts = {
            topic: len(bag.signal(topic)[1])
            for topic in ("/perturbation/reference", "/ankle/samples", SIMULATED)
        }
        sent, received = bag.signal(SIMULATED)[1], bag.signal(BRIDGED_TOPIC)[1]
        responses, events = (
            bag.topics["/emg/responses"].count,
            bag.topics["/session/event"].count if "/session/event" in bag.topics else 0,
        )
        said = bag.custom_data.get("warnings", "")
    errors, lost = time_errors(sent, received)
    later = errors[len(errors) // 10 :]
    rows = [
        (
            "samples: reference / ankle / EMG as made",
            " / ".join(str(count) for count in counts.values()),
        ),
        (
            "EMG samples through the bridge",
            f"{len(received)} (it looks at a stream for 2 s first and gives these out as well)",
        ),
        ("EMG samples lost on the way", f"{lost}"),
        ("responses, events", f"{responses}, {events}"),
        (
            "time through the bridge less time as made",
            f"median {1e3 * np.median(errors):.3f} ms, worst {1e3 * np.abs(errors).max():.3f} ms",
        ),
        ("the same after the first tenth of the run", f"worst {1e3 * np.abs(later).max():.3f} ms"),
        (
            "its mean in each tenth of the run [ms]",
            ", ".join(f"{1e3 * part.mean():.2f}" for part in np.array_split(errors, 10)),
        ),
        ("what 50 ppm would have made of it", f"{1e3 * 50e-6 * seconds:.1f} ms"),
        ("said by the recorder", said or "nothing"),
    ]
    rows += [
        (f"load of {name}", f"{100 * spent / seconds:.1f} % of a core, its start included")
        for name, spent in load.items()
    ]
    for what, value in rows:
        print(f"{what:44s} {value}")
    return 1 if lost or len(set(counts.values())) > 1 or np.abs(later).max() > 1e-3 else 0


if __name__ == "__main__":
    sys.exit(main())
