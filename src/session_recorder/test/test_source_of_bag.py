"""What a bag says of its file: enough to know it again, and no name, maybe a person's."""

import hashlib

import numpy as np
import openpyxl
import pytest
from synthetic_ankle import synthetic

from session_recorder.bag_reader import BagReader
from session_recorder.importing import import_recording
from session_recorder.importing.source_of_bag import default_bag, without_name

STEM = "S07_Jansen"
NAMES = ("time", "position", f"{STEM} torque")
STATED = {"t[s]": "time", "position[rad]": "position", "torque[N.m]": NAMES[2]}


def rows():
    truth = synthetic(seconds=10.0)
    return np.column_stack([truth["time"], truth["position"], truth["torque"]])


@pytest.fixture(params=["csv", "xlsx"])
def source(request, tmp_path):
    path = tmp_path / "files" / f"{STEM}.{request.param}"
    path.parent.mkdir()
    if request.param == "csv":
        np.savetxt(path, rows(), delimiter=",", header=",".join(NAMES), comments="")
    else:
        book = openpyxl.Workbook()
        book.active.title = STEM  # as a spreadsheet calls the sheet of a text file
        for row in [NAMES, *rows().tolist()]:
            book.active.append(row)
        book.save(path)
    return path


def held_in(folder):
    """All names and contents of a folder, in small letters, and the texts that a reader gives."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    names = " ".join(str(path.relative_to(folder.parent)) for path in files).encode()
    reader = BagReader(folder)
    texts = repr(reader.custom_data).encode()
    return b" ".join([names, texts, *(path.read_bytes() for path in files)]).lower()


def test_a_bag_holds_no_part_of_its_files_name(source, tmp_path):
    bag = tmp_path / default_bag(source, keep_name=False)
    import_recording(source, bag, STATED, torque_sign="rig")
    content = held_in(bag)
    for part in (STEM, *STEM.split("_")):
        assert part.lower().encode() not in content
    known = BagReader(bag).custom_data
    assert known["source_sha256"] == hashlib.sha256(source.read_bytes()).hexdigest()
    assert known["source_format"] == source.suffix
    assert known["source_size[B]"] == str(source.stat().st_size)


def test_the_name_is_kept_where_that_is_asked(source, tmp_path):
    assert default_bag(source, keep_name=True).name == STEM
    import_recording(source, tmp_path / "bag", STATED, torque_sign="rig", keep_source_name=True)
    known = BagReader(tmp_path / "bag").custom_data
    assert known["imported_from"] == source.name
    assert STEM in known["stated_columns"]


@pytest.mark.parametrize(
    ("text", "name", "left"),
    [
        ("s07_jansen_torque", "S07_Jansen.csv", "(source)_torque"),
        ("torque", "torque.csv", "torque"),
        ("a gap of 2 samples", "a.csv", "a gap of 2 samples"),
        ("position", "sit.csv", "position"),
    ],
)
def test_only_the_name_is_taken_out_of_a_text(text, name, left, tmp_path):
    assert without_name(text, tmp_path / name) == left
