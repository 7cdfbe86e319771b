"""Files that others write, damaged at random: read, or refused in one sentence; never anything
else. The default run has over a thousand cases, the slow one a million.
"""

import csv
import json
import re
import subprocess
import sys
import time

import edfio
import numpy as np
import pytest
from scipy.io import savemat

from ankle_interfaces.block import Block, pack
from ankle_interfaces.errors import BlockError
from session_recorder.bag_metadata import read_metadata
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError, ImportRefused
from session_recorder.importing import propose, read_table, reading_process
from session_recorder.loss import LossAccount, account_of_bag

MAX_TIME = 20.0
"""[s] Longest time of one case on a crowded machine; what takes longer hangs."""
DAMAGED_VALUES = [
    "",
    "nan",
    "-",
    "1e999",
    "0x1f",
    "1,5",
    "1.5;2",
    '"',
    "\\0",
    "°",
    "Time (s)",
    "#",
    "_1",
    "--",
]


def table(n=60):
    t = np.arange(n) / 1000
    return np.column_stack([t, np.sin(40 * t), np.cos(30 * t)])


def as_csv(path, random):
    rows = [["Time (s)", "Angle (deg)", "Torque (Nm)"], *table().tolist()]
    for _ in range(int(random.integers(0, 6))):
        row = rows[int(random.integers(len(rows)))]
        row[int(random.integers(3))] = str(random.choice(DAMAGED_VALUES))
    with path.with_suffix(".csv").open("w", newline="") as stream:
        csv.writer(stream, delimiter=str(random.choice([",", ";", "\t", " "]))).writerows(rows)
    return path.with_suffix(".csv")


def as_npz(path, random):
    np.savez(path.with_suffix(".npz"), time=table()[:, 0], angle=table()[:, 1:])
    return path.with_suffix(".npz")


def as_mat(path, random):
    savemat(path.with_suffix(".mat"), {"trial": {"time": table()[:, 0], "torque": table()[:, 1]}})
    return path.with_suffix(".mat")


def as_edf(path, random):
    edfio.Edf([edfio.EdfSignal(np.tile(table()[:, 1], 10), 600, label="SOL")]).write(
        path.with_suffix(".edf")
    )
    return path.with_suffix(".edf")


def damage(content, random):
    """Bytes flipped, cut out, doubled or put in."""
    data = bytearray(content)
    for _ in range(int(random.integers(1, 8))):
        at = int(random.integers(0, max(1, len(data))))
        size = int(random.integers(1, 40))
        what = int(random.integers(4))
        if what == 0 and data:
            data[at % len(data)] = int(random.integers(256))
        elif what == 1:
            del data[at : at + size]
        elif what == 2:
            data[at:at] = data[at : at + size]
        else:
            data[at:at] = bytes(random.integers(0, 256, size, dtype=np.uint8))
    return bytes(data)


def read_or_refuse(path):
    begin = time.monotonic()
    try:
        found = read_table(path)
        propose(found)
        for name, values in found.columns.items():
            assert values.ndim == 1, name
            assert values.dtype == float
    except ImportRefused:
        pass
    assert time.monotonic() - begin < MAX_TIME


def damaged_files(folder, seed, cases, makers=(as_csv, as_npz, as_mat, as_edf)):
    random = np.random.default_rng(seed)
    for case in range(cases):
        make = makers[case % len(makers)]
        path = make(folder / "file", random)
        if case % 3:
            path.write_bytes(damage(path.read_bytes(), random))
        read_or_refuse(path)


def damaged_blocks(seed, cases):
    """Messages of a topic of blocks: counted or refused, and no number is invented."""
    random = np.random.default_rng(seed)
    names = ("t[s]", "torque[N.m]")
    account, whole = LossAccount(), 0
    for case in range(cases):
        time_ = 10.0 + case * 0.032 + np.arange(32) / 1000
        message = pack(Block(names, np.column_stack([time_, np.sin(time_)])))
        if random.uniform() < 0.7:
            message = damage(message, random)
        else:
            whole += 1
        try:
            account.add("/ankle/samples", message, case)
        except BlockError:
            pytest.fail("a damaged block must not end the recording")
    return account, whole


def damaged_bags(folder, seed, cases):
    random = np.random.default_rng(seed)
    with BagWriter(folder / "good", overwrite=True) as writer:
        writer.add_topic("/ankle/samples")
        for number in range(40):
            t = number * 0.032 + np.arange(32) / 1000
            block = Block(("t[s]", "torque[N.m]"), np.column_stack([t, t]))
            writer.write_block("/ankle/samples", block)
            if number % 10 == 9:
                writer.flush()
    mcap = next((folder / "good").glob("*.mcap")).read_bytes()
    meta = (folder / "good" / "metadata.yaml").read_bytes()
    bag = folder / "bad"
    bag.mkdir(exist_ok=True)
    for case in range(cases):
        (bag / "good_0.mcap").write_bytes(damage(mcap, random) if case % 2 else mcap)
        (bag / "metadata.yaml").write_bytes(meta if case % 2 else damage(meta, random))
        try:
            held = account_of_bag(BagReader(bag))
        except BagError:
            continue
        samples = sum(one.samples for one in held.topics.values())
        assert samples <= 40 * 32
        # What is not there is reported.
        assert samples == 40 * 32 or held.sentences(), case


def test_damaged_files_are_read_or_refused(tmp_path):
    # A MATLAB file is read in a process of its own, which takes over a second; `make bad-input` and
    # its small share in the tests read more of them in copies of one process.
    for seed, (make, cases) in enumerate([(as_mat, 3), (as_csv, 80), (as_npz, 80), (as_edf, 80)]):
        damaged_files(tmp_path, seed, cases, [make])


def test_damaged_blocks_do_not_end_a_recording():
    account, whole = damaged_blocks(2, 1000)
    held = account.topics["/ankle/samples"]
    assert held.samples >= 32 * whole * 0.9
    assert json.dumps(account.figures())


def test_damaged_bags_are_read_or_refused_and_what_is_missing_is_reported(tmp_path):
    damaged_bags(tmp_path, 3, 300)


@pytest.mark.slow
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("part", range(10))
def test_a_million_damaged_files_blocks_and_bags(tmp_path, part):
    damaged_files(tmp_path, 100 + part, 4000)
    damaged_bags(tmp_path, 200 + part, 3000)
    for piece in range(31):
        damaged_blocks(1000 * part + piece, 3000)


def test_a_c3d_file_that_its_library_does_not_survive_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(reading_process, "LONGEST_READING", 5)
    path = tmp_path / "cut.c3d"
    path.write_bytes(b"\x02\x50" + bytes(600))
    with pytest.raises(ImportRefused, match=r"cut\.c3d is not a readable"):
        read_table(path)


def test_a_matlab_file_that_crashes_its_library_is_refused(tmp_path, monkeypatch):
    """The reader's process ends by a signal, as SciPy's does on some damaged files."""
    path = tmp_path / "crash.mat"
    path.write_bytes(b"MATLAB 5.0 MAT-file" + bytes(600))
    crash = [sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"]
    start = subprocess.run
    monkeypatch.setattr(
        reading_process.subprocess, "run", lambda _, **options: start(crash, **options)
    )
    with pytest.raises(ImportRefused, match=r"crash\.mat .* crashed \(SIGSEGV\)"):
        read_table(path)


def metadata_of_a_bag(folder):
    """Write a bag with one block of 32 samples, and return the path of its description."""
    with BagWriter(folder) as writer:
        writer.add_topic("/ankle/samples")
        time = 1e9 + np.arange(32) / 1000
        block = Block(("t[s]", "torque[N.m]"), np.column_stack([time, time]))
        writer.write_block("/ankle/samples", block)
    return folder / "metadata.yaml"


def test_a_type_that_the_metadata_state_wrongly_is_reported_and_read_by_the_file(tmp_path):
    metadata = metadata_of_a_bag(tmp_path / "bag")
    metadata.write_text(metadata.read_text().replace("std_msgs/msg/Float64M", "std_msgs/msg/M"))
    account = account_of_bag(BagReader(tmp_path / "bag"))
    assert account.topics["/ankle/samples"].samples == 32
    assert any("which counts" in sentence for sentence in account.sentences())


@pytest.mark.parametrize("damaged", ["Z1000000", ".inf"])
@pytest.mark.parametrize("entry", ["nanoseconds_since_epoch", "nanoseconds", "message_count"])
def test_a_number_that_is_none_is_named_where_the_metadata_state_it(tmp_path, entry, damaged):
    metadata = metadata_of_a_bag(tmp_path / "bag")
    metadata.write_text(re.sub(rf"\b{entry}: \d+", f"{entry}: {damaged}", metadata.read_text()))
    with pytest.raises(BagError, match=f"'{entry}' is '.+' and no whole number"):
        read_metadata(tmp_path / "bag")
