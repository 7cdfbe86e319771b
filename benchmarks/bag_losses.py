"""What a bag lacks, and what is left of one that is cut as a power cut leaves it."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import numpy as np

from ankle_interfaces.topics import ANKLE_SAMPLES
from session_recorder.bag_reader import BagReader
from session_recorder.errors import BagError

RATE = 2048.0
SAMPLES = f"/{ANKLE_SAMPLES.name}"
CUTS = 20  # places at which a bag is cut


def missing(times: np.ndarray, since: float) -> int:
    """Return how many samples are missing between times [s] later than a ROS time."""
    gaps = np.round(np.diff(times[times > since]) * RATE).astype(int) - 1
    return int(gaps[gaps > 0].sum())


def wrong_when_cut(bag: Path, random: np.random.Generator) -> list[str]:
    """Return what is wrong with copies of a bag that are cut at random places."""
    times = times_in(bag)
    shares = random.uniform(0.0, 1.0, CUTS)
    found = [(share, cut(bag, float(share), times)) for share in shares]
    return [f"cut at {share:.3f}: {problem}" for share, problem in found if problem]


def times_in(bag: Path) -> np.ndarray:
    """Return the times of the ankle's samples in a bag [s]."""
    return np.concatenate([block.time for block in BagReader(bag).blocks(SAMPLES)])


def cut(bag: Path, share: float, times: np.ndarray) -> str:
    """Cut a copy of a bag; return what is wrong with what is left, empty where nothing is."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / bag.name
        shutil.copytree(bag, copy)
        for part in copy.glob("*.mcap"):
            os.truncate(part, int(share * part.stat().st_size))
        try:
            left = [block.time for block in BagReader(copy).blocks(SAMPLES)]
        except BagError:
            return ""  # it says so
        kept = np.concatenate(left) if left else np.zeros(0)
        same = np.array_equal(kept, times[: len(kept)])
        return "" if same else "the samples that are left are not those that were written"
