"""A study as BIDS: motion (position, velocity, torque, command) and EMG of every recording."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import edfio
import numpy as np

from ankle_interfaces.continuity import sampling_rate
from ankle_interfaces.topics import ANKLE_SAMPLES, EMG_SAMPLES
from session_analysis.errors import AnalysisError
from session_analysis.study.layout import Entry, Study, software_version
from session_analysis.study.recording_results import imported_bag
from session_recorder.bag_metadata import METADATA_FILE
from session_recorder.bag_reader import BagReader

BIDS_VERSION = "1.11.0"
"""The first version of the specification that has EMG."""
TASK = "anklePerturbation"
TRACKING = "rig"
_KINDS = {"position": "ORNT", "velocity": "ANGVEL", "torque": "MISC"}


def left_out(study: Study) -> dict[str, str]:
    """Return files that an export leaves out, because 'ankle study run' could not import them.

    Parameters
    ----------
    study
        The study that is exported.

    Returns
    -------
    dict[str, str]
        Why, by the name of the recording.
    """
    failures = study.failures()
    return {
        entry.name: failures[entry.name]
        for entry in study.entries()
        if entry.name in failures and not (_bag_of(study, entry) / METADATA_FILE).exists()
    }


def export_bids(
    study: Study, out: Path, progress: Callable[[str, float], None] | None = None
) -> list[Path]:
    """Write every recording of a study as BIDS; files from elsewhere as 'ankle study run' imported
    them, without those that it could not import (`left_out`).

    Parameters
    ----------
    study
        The study that is exported.
    out
        A new or empty folder.
    progress
        Called with the recording and the fraction done.

    Returns
    -------
    list[Path]
        The data files.

    Raises
    ------
    AnalysisError
        `out` holds something, the study has no recording, or a file is not imported yet.
    BagError
        A bag cannot be read.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise AnalysisError(f"{out} is not an empty folder; nothing is overwritten")
    absent = left_out(study)
    entries = [entry for entry in study.entries() if entry.name not in absent]
    if not entries:
        raise AnalysisError(f"{study.folder} has no recording that can be exported")
    bags = {entry.name: _bag_of(study, entry) for entry in entries}
    for entry in entries:
        if not (bags[entry.name] / METADATA_FILE).exists() and not entry.source.is_dir():
            raise AnalysisError(
                f"{entry.source} is not imported yet: 'ankle study run {study.folder}' imports it"
            )
    out.mkdir(parents=True, exist_ok=True)
    about = {
        "Name": study.name,
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
        "GeneratedBy": [{"Name": "ankle", "Version": software_version()}],
    }
    _json(out / "dataset_description.json", about)
    subjects = sorted({entry.subject for entry in entries})
    lines = ["participant_id", *(f"sub-{subject}" for subject in subjects)]
    (out / "participants.tsv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    written = []
    for done, entry in enumerate(entries, 1):
        folder = out / f"sub-{entry.subject}" / f"ses-{entry.visit:02d}"
        written += _export(entry, BagReader(bags[entry.name]), folder)
        if progress:
            progress(entry.name, done / len(entries))
    return written


def _json(path: Path, content: dict[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def _bag_of(study: Study, entry: Entry) -> Path:
    return entry.source if entry.source.is_dir() else imported_bag(study.derived(entry))


def _export(entry: Entry, bag: BagReader, folder: Path) -> list[Path]:
    stem = f"sub-{entry.subject}_ses-{entry.visit:02d}_task-{TASK}"
    written = []
    if ANKLE_SAMPLES.absolute in bag.topics:
        written.append(_motion(bag, entry, folder / "motion", stem))
    if EMG_SAMPLES.absolute in bag.topics:
        written.append(_emg(bag, entry, folder / "emg", stem))
    return written


def _motion(bag: BagReader, entry: Entry, folder: Path, stem: str) -> Path:
    columns, data = bag.signal(ANKLE_SAMPLES.absolute)
    rate = sampling_rate(data[:, 0])
    folder.mkdir(parents=True, exist_ok=True)
    name = f"{stem}_tracksys-{TRACKING}_run-{entry.run:02d}"
    path = folder / f"{name}_motion.tsv"
    np.savetxt(path, data, delimiter="\t", fmt="%.9g")
    lines = ["name\tcomponent\ttype\ttracked_point\tunits\tsampling_frequency"]
    for column in columns:
        quantity, _, unit = column.rstrip("]").partition("[")
        kind = "LATENCY" if quantity == "t" else _KINDS.get(quantity, "MISC")
        units = unit.replace("N.m", "N m")
        lines.append(f"{quantity}\tn/a\t{kind}\tankle\t{units}\t{rate:g}")
    (folder / f"{name}_channels.tsv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    about = {
        "TaskName": TASK,
        "SamplingFrequency": rate,
        "TrackingSystemName": TRACKING,
        "MotionChannelCount": len(columns),
        "RotationRule": "positive in dorsiflexion",
        **entry.stated(),
    }
    _json(folder / f"{name}_motion.json", about)
    return path


def _without_gaps(data: np.ndarray, rate: float) -> tuple[np.ndarray, list[dict[str, float]]]:
    """Return samples on an even grid, shape (n, m), zero where a value is absent, and where these
    stretches begin and how long they last [s], counted from the first sample.
    """
    place = np.round((data[:, 0] - data[0, 0]) * rate).astype(int)
    whole = np.full((int(place.max()) + 1, data.shape[1]), np.nan)
    whole[place[place >= 0]] = data[place >= 0]
    whole[:, 0] = data[0, 0] + np.arange(len(whole)) / rate
    bad = ~np.isfinite(whole).all(axis=1)
    edges = np.flatnonzero(np.diff(bad.astype(int), prepend=0, append=0))
    absent = [
        {"onset": float(begin / rate), "duration": float((end - begin) / rate)}
        for begin, end in edges.reshape(-1, 2)
    ]
    return np.nan_to_num(whole), absent


def _emg(bag: BagReader, entry: Entry, folder: Path, stem: str) -> Path:
    columns, data = bag.signal(EMG_SAMPLES.absolute)
    rate = sampling_rate(data[:, 0])
    data, absent = _without_gaps(data, rate)
    folder.mkdir(parents=True, exist_ok=True)
    name = f"{stem}_run-{entry.run:02d}"
    path = folder / f"{name}_emg.bdf"
    signals = []
    for column, values in zip(columns[1:], data[:, 1:].T, strict=True):
        microvolts = 1e6 * values
        most = max(1.0, float(np.max(np.abs(microvolts))))
        label = column.partition("[")[0]
        signals.append(
            edfio.BdfSignal(
                microvolts, rate, label=label, physical_dimension="uV", physical_range=(-most, most)
            )
        )
    edfio.Bdf(signals).write(path)
    lines = ["name\ttype\tunits", *(f"{c.partition('[')[0]}\tEMG\tuV" for c in columns[1:])]
    (folder / f"{name}_channels.tsv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    about: dict[str, Any] = {
        "TaskName": TASK,
        "SamplingFrequency": rate,
        "EMGReference": "bipolar",
        # Required by the specification; a recording states neither.
        "PowerLineFrequency": "n/a",
        "SoftwareFilters": "n/a",
        # A BDF file has neither a time of each sample nor a mark for those that are absent.
        "StartTime": float(data[0, 0]),
        "AbsentSamples": absent,
    }
    placement = entry.stated().get("electrode_placement")
    _json(folder / f"{name}_emg.json", {**about, "EMGPlacementScheme": placement or "n/a"})
    return path
