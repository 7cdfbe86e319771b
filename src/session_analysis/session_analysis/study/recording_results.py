"""Import, estimate and diagnose one recording of a study, once; results as rows of the table."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ankle_interfaces.topics import ANKLE_SAMPLES
from impedance_estimator.algorithms import DEFAULT
from impedance_estimator.known_physics import KnownPhysics
from impedance_estimator.offline.recorded_estimates import estimate_bag
from session_analysis.errors import AnalysisError
from session_analysis.estimate_answer import (
    QUANTITIES,
    Answer,
    answer,
    require_start,
    require_valid,
)
from session_analysis.estimate_report import write_estimates
from session_analysis.known_of_session import model_in_force
from session_analysis.study.layout import Entry, Study, software_version
from session_analysis.visit_measures import measured_in_visit
from session_recorder.bag_reader import BagReader
from session_recorder.errors import ImportRefused
from session_recorder.importing import import_recording, propose, read_table
from session_recorder.rig_of_bag import rig_of_bags

if TYPE_CHECKING:
    from ankle_physics.rig_file import RigFile

RESULTS_FILE = "results.json"
PERCENT = 100.0
IMPORT_EXAMPLE = '{"section": "2", "columns": {"position[deg]": "Angle"}, "torque_sign": "rig"}'
"""What a sidecar file says of a file of another system."""

_DIRECTION_OPTION = re.compile(r"--positive (\w+)")


@dataclass(frozen=True)
class Row:
    """Holds one number of the table of results.

    Attributes
    ----------
    subject, visit, run
        Whose, when.
    quantity
        With its unit, as ``K[N.m/rad]``.
    value, error
        The number and its standard error; NaN where there is none.
    doubt
        Share of the estimates behind it that are doubtful, 0 to 1; NaN where that has no meaning.
    """

    subject: str
    visit: int
    run: int
    quantity: str
    value: float
    error: float
    doubt: float


def process(folder: Path, entry: Entry, diagnosed: bool) -> list[Row]:
    """Return the rows of one recording.

    They are those of an earlier run where nothing has changed since.

    Parameters
    ----------
    folder
        Folder of the study.
    entry
        Subject, visit and run of the recording, and its file.
    diagnosed
        Whether the recording is diagnosed as well; takes a minute or more.

    Raises
    ------
    BagError, ImportRefused, AnalysisError, ValueError
        The recording cannot be read or imported, or nothing in it is valid.
    """
    study = Study(folder)
    derived = study.derived(entry)
    key = _fingerprint(entry, diagnosed)
    file = derived / RESULTS_FILE
    if file.exists():
        try:
            held = json.loads(file.read_text(encoding="utf-8"))
            if held["key"] == key:
                return [Row(**_numbers(row)) for row in held["rows"]]
        except (ValueError, KeyError, TypeError):
            pass  # a file that was cut off is made again
    derived.mkdir(parents=True, exist_ok=True)
    rows, known = _compute(entry, derived, diagnosed)
    part = file.with_suffix(".part")
    content = {"key": key, **known, "rows": [_plain(asdict(row)) for row in rows]}
    part.write_text(json.dumps(content), encoding="utf-8")
    part.replace(file)
    return rows


def _fingerprint(entry: Entry, diagnosed: bool) -> str:
    """Return what results depend on: the recording's files, what is stated, the software."""
    digest = hashlib.sha256(f"{software_version()} {DEFAULT} {diagnosed}".encode())
    files = [entry.source] if entry.source.is_file() else sorted(entry.source.iterdir())
    if entry.source.is_file():
        digest.update(b"with what was assumed")  # results without it are made again
    for path in [*files, entry.sidecar]:
        if path.is_file():
            about = path.stat()
            digest.update(f"{path.name} {about.st_size} {about.st_mtime_ns}".encode())
    return digest.hexdigest()


def _plain(row: dict[str, Any]) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}


def _numbers(row: dict[str, Any]) -> dict[str, Any]:
    return {k: math.nan if v is None else v for k, v in row.items()}


def _compute(entry: Entry, derived: Path, diagnosed: bool) -> tuple[list[Row], dict[str, Any]]:
    """Return the rows, and by keys what else is kept: what was measured, what was assumed."""
    stated = entry.stated()
    bag, assumed = entry.source, list[str]()
    if not bag.is_dir():
        bag, assumed = _import(entry, derived, stated)
    require_start(bag)
    rig = rig_of_bags([bag])
    model, about_model = model_in_force(BagReader(bag))
    known = None if rig is None and model is None else KnownPhysics(rig, model)
    result = estimate_bag(bag, derived / "estimates", known=known, overwrite=True)
    result.notes.extend([about_model] if about_model else [])
    if rig is not None:
        result.notes.append(f"the rig '{rig.title}', which the bag carries, is taken as known")
    settings = BagReader(derived / "estimates").custom_data.get("settings", "")
    found = answer(bag, result, DEFAULT, settings)
    write_estimates(found, derived)
    require_valid(found)
    rows = _estimate_rows(entry, found)
    measured = measured_in_visit(bag)
    rows += _relative_rows(entry, found, {**measured, **stated}, bag)
    if diagnosed:
        rows += _diagnosis_rows(entry, bag, derived / "diagnosis", rig)
    return rows, {"measured": measured, "assumed": assumed}


def as_sidecar_keys(sentence: str, sidecar: str) -> str:
    """Return a sentence that advises an option of 'ankle import' with the key of a sidecar file.

    Parameters
    ----------
    sentence
        As an importer says it.
    sidecar
        Name of the file that states how a recording of the study is read.
    """
    return _DIRECTION_OPTION.sub(rf'"positive": "\1" to {sidecar}', sentence)


def imported_bag(derived: Path) -> Path:
    """Return where the bag of a recording stands that was imported from a file."""
    return derived / "imported"


def _import(entry: Entry, derived: Path, stated: dict[str, Any]) -> tuple[Path, list[str]]:
    try:
        return _imported(entry, derived, stated)
    except ImportRefused as error:
        raise AnalysisError(
            f"{error}. In a study, options of 'ankle import' stand in {entry.sidecar.name}, as "
            f"{IMPORT_EXAMPLE}"
        ) from None


def _imported(entry: Entry, derived: Path, stated: dict[str, Any]) -> tuple[Path, list[str]]:
    """Return the bag of a file of another system, by what is stated or else by what is likely, and
    what had to be assumed.
    """
    assumed: list[str] = []
    columns, sign = stated.get("columns"), stated.get("torque_sign")
    table = read_table(entry.source, stated.get("section", ()), tuple((columns or {}).values()))
    table.rate = stated.get("rate[Hz]") or table.rate
    resample = stated.get("resample[Hz]")
    neutral, positive = stated.get("neutral"), stated.get("positive")
    if columns is None:
        proposal = propose(table)
        columns, sign = proposal.columns, sign or proposal.torque_sign
        resample = resample or proposal.resample
        neutral = proposal.neutral if neutral is None else neutral
        positive = positive or proposal.positive
        taken = ", ".join(f"{name} = {column}" for name, column in columns.items())
        assumed = [f"the columns are {taken}; torque sign: {sign or 'no torque'}"]
        assumed += [as_sidecar_keys(doubt, entry.sidecar.name) for doubt in proposal.doubts]
    report = import_recording(
        table,
        imported_bag(derived),
        columns,
        torque_sign=sign,
        rate=None if any(name.startswith("t[") for name in columns) else table.rate,
        resample=resample,
        neutral=neutral,
        positive=positive,
        overwrite=True,
    )
    return report.bag, assumed


def _estimate_rows(entry: Entry, found: Answer) -> list[Row]:
    valid = max(1, int(found.valid.sum()))
    doubt = float(found.doubtful.sum()) / valid
    who = (entry.subject, entry.visit, entry.run)
    rows = [Row(*who, quantity, *found.median(quantity), doubt) for quantity in QUANTITIES]
    nan = math.nan
    rows.append(Row(*who, "valid[%]", PERCENT * float(found.valid.mean()), nan, nan))
    rows.append(Row(*who, "missing_samples[1]", float(found.losses.missing), nan, nan))
    if found.opinion is not None:
        vaf = float(np.mean(found.opinion.held_out_vaf))
        rows.append(Row(*who, "held_out_vaf[%]", vaf, nan, nan))
    return rows


def _relative_rows(entry: Entry, found: Answer, stated: dict[str, Any], bag: Path) -> list[Row]:
    """Return K and G in per cent of the largest voluntary torque and by body mass, and the mean
    torque that they were measured at.
    """
    who = (entry.subject, entry.visit, entry.run)
    columns, data = BagReader(bag).signal(ANKLE_SAMPLES.absolute)
    torque = data[:, columns.index("torque[N.m]")]
    rows = [Row(*who, "mean_torque[N.m]", float(np.nanmean(torque)), math.nan, math.nan)]
    doubt = float(found.doubtful.sum()) / max(1, int(found.valid.sum()))
    for name, per in (("K", "1/rad"), ("G", "s/rad")):
        quantity = f"{name}[N.m/rad]" if name == "K" else f"{name}[N.m.s/rad]"
        value, error = found.median(quantity)
        strongest = stated.get("mvc_plantarflexion[N.m]")
        mass = stated.get("body_mass[kg]")
        if strongest:
            scale = PERCENT / float(strongest)
            label = f"{name}_of_mvc[%{'/rad' if per == '1/rad' else '.s/rad'}]"
            rows.append(Row(*who, label, scale * value, scale * error, doubt))
        if mass:
            label = f"{name}_by_mass[{quantity.split('[')[1][:-1]}/kg]"
            rows.append(Row(*who, label, value / float(mass), error / float(mass), doubt))
    return rows


def _diagnosis_rows(entry: Entry, bag: Path, out: Path, rig: RigFile | None) -> list[Row]:
    from model_discrepancy.diagnose import diagnose

    verdict = diagnose(bag, out, rig=rig).verdict
    return verdict_rows(entry, json.loads(json.dumps(verdict, default=vars)))


def verdict_rows(entry: Entry, verdict: Mapping[str, Any]) -> list[Row]:
    """Return the rows of a diagnosis: the probability of each effect, and how well models fit.

    Parameters
    ----------
    entry
        The recording.
    verdict
        Content of ``verdict.json``.

    Returns
    -------
    list[Row]
        VAF in per cent, every other measure of the fit as a share from 0 to 1.
    """
    who = (entry.subject, entry.visit, entry.run)
    rows = []
    for effect in verdict.get("effects", []):
        probability = float(effect.get("probability", math.nan))
        rows.append(Row(*who, f"effect:{effect['name']}[1]", probability, math.nan, math.nan))
    for name, value in (verdict.get("fit") or {}).items():
        if isinstance(value, (int, float)):
            unit = "%" if "vaf" in name else "1"
            rows.append(Row(*who, f"diagnosis_{name}[{unit}]", float(value), math.nan, math.nan))
    return rows
