"""Where the recordings of a study lie, and what is stated about each: in the spirit of BIDS.

STUDY/
  study.yaml                                     name, version of this layout
  participants.tsv                               pseudonyms
  sub-S07/ses-03/sub-S07_ses-03_run-01_bag/      the recording
  sub-S07/ses-03/sub-S07_ses-03_run-01.json      what is stated about it
  derivatives/sub-S07_ses-03_run-01/             its estimates and diagnosis
  derivatives/results.parquet                    all results in one table
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import yaml

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity
from ankle_interfaces.yaml_text import YamlError, parse_yaml, read_text
from session_analysis.errors import AnalysisError
from session_recorder.importing.statement import DIRECTIONS, TORQUE_SIGNS
from session_recorder.importing.tables import READERS

LAYOUT_VERSION = 1
STUDY_FILE = "study.yaml"
PARTICIPANTS_FILE = "participants.tsv"
DERIVATIVES = "derivatives"
PSEUDONYM = re.compile(r"^(?=.*\d)[A-Za-z0-9]{1,12}$")
"""Letters and digits with at least one digit: the name of a human has none."""
_RECORDING = re.compile(r"^sub-(?P<subject>[A-Za-z0-9]+)_ses-(?P<visit>\d+)_run-(?P<run>\d+)")
NUMBERS = (
    Quantity("knee_angle", "deg", 0.0, 180.0, 60.0, description="Flexion of the knee."),
    Quantity("body_mass", "kg", 10.0, 300.0, 75.0, description="Body mass."),
    Quantity("mvc_plantarflexion", "N.m", 0.0, 400.0, 100.0,
             description="Largest voluntary torque in plantarflexion."),
    Quantity("mvc_dorsiflexion", "N.m", 0.0, 200.0, 40.0,
             description="Largest voluntary torque in dorsiflexion."),
)  # fmt: skip
"""Numbers of a sidecar file, by the key ``symbol[unit]``."""
CHOICES = {
    "side": ("left", "right"),
    "torque_sign": tuple(TORQUE_SIGNS),
    "positive": tuple(DIRECTIONS),
}
TEXTS = (
    "posture", "electrode_placement", "rig_calibration", "subject_calibration",
    "software_version", "task", "recorded", "remarks",
)  # fmt: skip
IMPORT_KEYS = ("section", "columns", "rate[Hz]", "resample[Hz]", "neutral")
"""Keys that say how a file of another system is imported."""


@dataclass(frozen=True)
class Entry:
    """Describes one recording of a study.

    Attributes
    ----------
    subject
        Pseudonym.
    visit, run
        Counted from 1.
    source
        The bag, or a file of another system that `ankle import` reads.
    sidecar
        The file that states what is known about it; it need not exist.
    """

    subject: str
    visit: int
    run: int
    source: Path
    sidecar: Path

    @property
    def name(self) -> str:
        """Return the name, as ``sub-S07_ses-03_run-01``."""
        return recording_name(self.subject, self.visit, self.run)

    def stated(self) -> dict[str, Any]:
        """Return what the sidecar states; empty where there is none.

        Raises
        ------
        AnalysisError
            It is not readable, or says something that is not allowed.
        """
        return read_stated(self.sidecar) if self.sidecar.exists() else {}


def read_stated(sidecar: Path) -> dict[str, Any]:
    """Return what a sidecar file states.

    Raises
    ------
    AnalysisError
        It is not readable, or says something that is not allowed.
    """
    try:
        stated = json.loads(sidecar.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise AnalysisError(f"{sidecar} is not readable as JSON: {error}") from None
    check_stated(stated, sidecar)
    return dict(stated)


def recording_name(subject: str, visit: int, run: int) -> str:
    """Return the name of a recording, as ``sub-S07_ses-03_run-01``."""
    return f"sub-{subject}_ses-{visit:02d}_run-{run:02d}"


def software_version() -> str:
    """Return the version of this software, as sidecar files state it."""
    try:
        return version("session_analysis")
    except PackageNotFoundError:
        return "0.1.0"


def check_pseudonym(subject: str) -> str:
    """Refuse what may be a person's name.

    Raises
    ------
    AnalysisError
        Not letters and digits with at least one digit.
    """
    if not PSEUDONYM.match(subject):
        raise AnalysisError(
            f"subject '{subject}' is refused; allowed: a pseudonym of up to 12 letters and digits "
            "with at least one digit, as S07. Names of persons do not belong in recordings"
        )
    return subject


def check_recording(path: Path) -> None:
    """Refuse what is neither a bag nor a file that can be imported.

    Raises
    ------
    AnalysisError
        Nothing is there, or it is something else.
    """
    if not path.exists():
        raise AnalysisError(f"{path}: no such file or folder")
    if path.is_dir() and not (any(path.glob("*.mcap")) or (path / "metadata.yaml").exists()):
        raise AnalysisError(f"{path} is no bag: it holds no .mcap file")
    if path.is_file() and path.suffix.lower() not in READERS:
        raise AnalysisError(
            f"{path}: '{path.suffix}' is not read; expected a bag, or one of {', '.join(READERS)}"
        )


def check_stated(stated: object, where: Path | str) -> None:
    """Check the content of a sidecar file.

    Raises
    ------
    AnalysisError
        An unknown key, or a value that is out of range or of another kind.
    """
    if not isinstance(stated, Mapping):
        raise AnalysisError(f"{where}: expected keys and values, got {type(stated).__name__}")
    numbers = {f"{quantity.symbol}[{quantity.unit}]": quantity for quantity in NUMBERS}
    known = [*numbers, *CHOICES, *TEXTS, *IMPORT_KEYS]
    for key, value in stated.items():
        if key in numbers:
            try:
                numbers[key].check(value)
            except (QuantityError, ValueError) as error:
                raise AnalysisError(f"{where}: {error}") from None
        elif key in CHOICES:
            if value not in CHOICES[key]:
                raise AnalysisError(
                    f"{where}: {key} = {value!r} is refused; allowed: {', '.join(CHOICES[key])}"
                )
        elif key in TEXTS:
            if not isinstance(value, str):
                raise AnalysisError(f"{where}: {key} = {value!r} is refused; allowed: a text")
        elif key == "section":
            texts = value if isinstance(value, list) and value else [value]
            if not all(isinstance(text, str) for text in texts):
                raise AnalysisError(
                    f"{where}: section = {value!r} is refused; allowed: a text, or a list of texts"
                )
        elif key == "columns":
            if not isinstance(value, Mapping):
                raise AnalysisError(
                    f"{where}: columns = {value!r} is refused; allowed: names with units and the "
                    'file\'s columns, as {"position[deg]": "Ankle angle"}'
                )
        elif key in IMPORT_KEYS:
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                raise AnalysisError(f"{where}: {key} = {value!r} is refused; allowed: a number")
        else:
            raise AnalysisError(f"{where}: unknown key '{key}'; known: {', '.join(known)}")


class Study:
    """Describes a study's folder.

    Parameters
    ----------
    folder
        A folder that `init_study` has made.

    Raises
    ------
    AnalysisError
        It is no study.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        path = self.folder / STUDY_FILE
        try:
            about = parse_yaml(read_text(path))
        except OSError:
            raise AnalysisError(
                f"{self.folder} is no study: it has no {STUDY_FILE}; make one with 'ankle study "
                f"init {self.folder}'"
            ) from None
        except YamlError as error:
            raise AnalysisError(f"{path} is not readable: {' '.join(str(error).split())}") from None
        if not isinstance(about, dict) or about.get("layout") != LAYOUT_VERSION:
            raise AnalysisError(f"{path}: expected 'layout: {LAYOUT_VERSION}'")
        self.name = str(about.get("study", self.folder.resolve().name))

    @property
    def results(self) -> Path:
        """Return the table of all results."""
        return self.folder / DERIVATIVES / "results.parquet"

    @property
    def failures_file(self) -> Path:
        """Return the list of recordings without a result."""
        return self.folder / DERIVATIVES / "failures.txt"

    def failures(self) -> dict[str, str]:
        """Return why a recording gave no result when the study was run last, by its name."""
        if not self.failures_file.exists():
            return {}
        lines = self.failures_file.read_text(encoding="utf-8").splitlines()
        return dict(line.partition(": ")[::2] for line in lines)

    def derived(self, entry: Entry) -> Path:
        """Return the folder of what was computed from a recording."""
        return self.folder / DERIVATIVES / entry.name

    def entries(self) -> list[Entry]:
        """Return all recordings, by subject, visit and run."""
        found = {}
        for path in sorted(self.folder.glob("sub-*/ses-*/sub-*")):
            match = _RECORDING.match(path.name)
            is_source = path.is_dir() or path.suffix.lower() in READERS
            if match is None or not is_source:
                continue
            subject, visit, run = match["subject"], int(match["visit"]), int(match["run"])
            sidecar = path.parent / f"{recording_name(subject, visit, run)}.json"
            entry = Entry(subject, visit, run, path, sidecar)
            # A bag stands before the file that it was imported from.
            if entry.name not in found or path.is_dir():
                found[entry.name] = entry
        return sorted(found.values(), key=lambda one: (one.subject, one.visit, one.run))

    def next_entry(self, subject: str, visit: int) -> Entry:
        """Return where the next recording of a visit belongs; nothing is written.

        Raises
        ------
        AnalysisError
            A subject that may be a name, or is another's but for capital letters, or a visit
            below 1.
        """
        check_pseudonym(subject)
        if visit < 1:
            raise AnalysisError(f"visit {visit} is refused; allowed: 1 and more")
        for other in {entry.subject for entry in self.entries()} - {subject}:
            if other.lower() == subject.lower():
                raise AnalysisError(
                    f"subject '{subject}' is refused: the study has '{other}', which differs by "
                    "the size of letters alone"
                )
        folder = self.folder / f"sub-{subject}" / f"ses-{visit:02d}"
        runs = [
            int(match["run"])
            for path in folder.glob("sub-*")
            if (match := _RECORDING.match(path.name)) is not None
        ]
        name = recording_name(subject, visit, max(runs, default=0) + 1)
        return Entry(
            subject,
            visit,
            max(runs, default=0) + 1,
            folder / f"{name}_bag",
            folder / f"{name}.json",
        )

    def add(self, entry: Entry, stated: Mapping[str, Any]) -> None:
        """Make room for a recording, write its sidecar, and list its subject.

        Raises
        ------
        AnalysisError
            See `check_stated`; or something is there already.
        """
        check_stated(stated, entry.sidecar)
        if entry.sidecar.exists() or entry.source.exists():
            raise AnalysisError(f"{entry.source} is there already; nothing is overwritten")
        entry.sidecar.parent.mkdir(parents=True, exist_ok=True)
        content = {"software_version": software_version(), **stated}
        entry.sidecar.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
        path = self.folder / PARTICIPANTS_FILE
        listed = path.read_text(encoding="utf-8").splitlines()
        if f"sub-{entry.subject}" not in listed:
            path.write_text("\n".join([*listed, f"sub-{entry.subject}"]) + "\n", encoding="utf-8")


def init_study(folder: Path | str, name: str = "") -> Study:
    """Make a new study.

    Raises
    ------
    AnalysisError
        The folder holds something already.
    """
    path = Path(folder)
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise AnalysisError(f"{path} is not an empty folder; nothing is overwritten")
    path.mkdir(parents=True, exist_ok=True)
    about = {"study": name or path.resolve().name, "layout": LAYOUT_VERSION}
    (path / STUDY_FILE).write_text(yaml.safe_dump(about, sort_keys=False), encoding="utf-8")
    (path / PARTICIPANTS_FILE).write_text("participant_id\n", encoding="utf-8")
    return Study(path)
