"""A study: layout and pseudonyms, processing once, report."""

import contextlib
import json
import math
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from study_recordings import ankle, write_bag

from ankle_node.session_event import SessionEvent
from session_analysis.errors import AnalysisError
from session_analysis.study.layout import (
    Study,
    check_pseudonym,
    check_recording,
    check_stated,
    init_study,
)
from session_analysis.study.recording_results import Row, imported_bag, process, verdict_rows
from session_analysis.study.running import read_results, run_study, write_results
from session_analysis.study.study_report import write_study_report
from session_analysis.study.visit_values import visit_table
from session_analysis.visit_measures import measured_in_visit
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.message_definitions import typestore

ANKLE = Path(sys.executable).with_name("ankle")


def test_a_recording_gets_the_next_run_of_its_visit(study):
    first = study.next_entry("S07", 3)
    assert first.source.relative_to(study.folder).as_posix() == (
        "sub-S07/ses-03/sub-S07_ses-03_run-01_bag"
    )
    study.add(first, {"side": "left", "body_mass[kg]": 71.0})
    write_bag(first.source)
    second = study.next_entry("S07", 3)
    assert second.name == "sub-S07_ses-03_run-02"
    assert [entry.name for entry in study.entries()] == [first.name]
    assert study.entries()[0].stated()["body_mass[kg]"] == 71.0
    assert "software_version" in study.entries()[0].stated()
    assert (study.folder / "participants.tsv").read_text().splitlines() == [
        "participant_id",
        "sub-S07",
    ]
    with pytest.raises(AnalysisError, match="nothing is overwritten"):
        study.add(first, {})
    with pytest.raises(AnalysisError, match="not an empty folder"):
        init_study(study.folder)
    with pytest.raises(AnalysisError, match="ankle study init"):
        Study(study.folder / "nowhere")


@pytest.mark.parametrize("subject", ["anna", "van der Berg", "", "S/07", "S07-secret", "../S07"])
def test_names_of_persons_are_refused(subject):
    with pytest.raises(AnalysisError, match="pseudonym"):
        check_pseudonym(subject)


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ({"body_mass[kg]": 7000}, "body_mass"),
        ({"body_mass": 70}, r"unknown key 'body_mass'; known: .*body_mass\[kg\]"),
        ({"side": "both"}, "allowed: left, right"),
        ({"name": "Anna"}, "unknown key 'name'"),
        ({"posture": 3}, "allowed: a text"),
        ({"rate[Hz]": "fast"}, r"rate\[Hz\] = 'fast' is refused; allowed: a number"),
        ({"columns": ["Time"]}, "allowed: names with units"),
        ({"section": ["Rig", 2]}, "allowed: a text, or a list of texts"),
        (["left"], "expected keys and values"),
    ],
)
def test_sidecar_files_are_checked(stated, words):
    with pytest.raises(AnalysisError, match=words):
        check_stated(stated, "x.json")


def rows_of(subject, visit, K, run=1, torque=-3.0, error=1.0, doubt=0.1):
    values = {"K[N.m/rad]": K, "G[N.m.s/rad]": 8.0, "mean_torque[N.m]": torque}
    return [Row(subject, visit, run, name, value, error, doubt) for name, value in values.items()]


def test_the_report_states_changes_against_the_detectable_one(tmp_path):
    rows = [row for s, K in (("S1", (100.0, 140.0)), ("S2", (80.0, 81.0)), ("S3", (60.0, 61.0)))
            for visit, value in enumerate(K, 1) for row in rows_of(s, visit, value)]  # fmt: skip
    assert visit_table(rows, "K[N.m/rad]")[2].tolist() == [[100, 140], [80, 81], [60, 61]]
    path = tmp_path / "r.html"
    text = write_study_report(rows, {"sub-S9_ses-01_run-01": "no samples"}, path, "T").read_text()
    assert "K changed by +40 N·m/rad from visit 1 to visit 2" in text
    assert "sub-S9_ses-01_run-01: no samples" in text
    assert "ICC(2,1)" in text
    # The paper stands apart from the subjects' own visits.
    assert "<h2>Beside the paper</h2>" in text.partition("Subject S3")[2]
    assert (
        "<td>K [N·m/rad]</td><td>80.5 (60.5 to 120)</td><td>3</td><td>100 (0 to 200)</td>" in text
    )
    # Each trend is drawn on the band of the minimal detectable change, for K and G.
    assert text.count('"fillcolor":"#888888"') == 2 * 3
    # Two recordings of a subject tell no relation with the torque; none is drawn.
    assert "against the mean torque" not in text
    one = write_study_report(rows, {}, path, "T", "S2").read_text()
    assert "Subject S2" in one
    assert "Subject S1" not in one


def test_a_change_within_the_errors_of_its_estimates_is_said_to_be_so(tmp_path):
    def sentences(error, doubt):
        rows = [row for s in ("S1", "S2", "S3") for visit in (1, 2)
                for row in rows_of(s, visit, 80.0 + visit)]  # fmt: skip
        rows += rows_of("S4", 1, 80.0) + rows_of("S4", 2, 110.0, error=error, doubt=doubt)
        text = write_study_report(rows, {}, tmp_path / "r.html", "T", "S4").read_text()
        return text.partition("K changed by +30 N·m/rad")[2].partition("</li>")[0]

    assert ", more than the minimal detectable change" in sentences(1.0, 0.0)
    assert "errors explain" not in sentences(1.0, 0.0)
    assert "doubtful" not in sentences(1.0, 0.0)
    assert "but not more than their errors explain (39.2 N·m/rad)" in sentences(20.0, 0.0)
    assert sentences(1.0, 0.9).endswith("; the estimates are doubtful")


def test_two_visits_of_a_single_subject_state_no_detectable_change(tmp_path):
    rows = rows_of("S1", 1, 80.0) + rows_of("S1", 2, 110.0)
    text = write_study_report(rows, {}, tmp_path / "r.html", "T").read_text()
    assert "K changed by +30 N·m/rad from visit 1 to visit 2, and what change is det" in text
    assert "more than the minimal detectable change of" not in text


def test_results_come_back_from_the_table(study):
    rows = rows_of("S1", 1, 100.0)
    write_results(rows, study.results)
    assert read_results(study.results) == rows
    columns = ["subject", "visit", "run", "quantity", "value", "error", "doubt"]
    assert pq.read_table(study.results).column_names == columns
    with pytest.raises(AnalysisError, match="ankle study run"):
        read_results(study.folder / "nothing.parquet")


@pytest.mark.parametrize("reader", ["pandas", "duckdb"])
def test_tools_of_others_open_the_table(study, reader):
    library = pytest.importorskip(reader, reason=f"{reader} is not installed")
    rows = [*rows_of("S1", 1, 100.0), *rows_of("S1", 2, 110.0), *rows_of("S2", 1, math.nan)]
    write_results(rows, study.results)
    if reader == "pandas":
        table = library.read_parquet(study.results)
        K = table[table.quantity == "K[N.m/rad]"].pivot_table("value", "subject", "visit")
        assert K.loc["S1"].tolist() == [100.0, 110.0]
        assert (table.value.isna() == [math.isnan(row.value) for row in rows]).all()
        return
    found = library.sql(
        f"select visit, value, error from '{study.results}' "
        "where subject = 'S1' and quantity = 'K[N.m/rad]' order by visit"
    )
    assert found.fetchall() == [(1, 100.0, 1.0), (2, 110.0, 1.0)]


def test_a_recording_is_processed_once_and_again_when_it_changed(study):
    entry = study.next_entry("S07", 1)
    study.add(entry, {"body_mass[kg]": 70.0, "mvc_plantarflexion[N.m]": 100.0})
    time, position, torque = ankle()
    source = entry.source.with_name(f"{entry.name}.csv")
    header = "Time (s),Ankle Angle (deg),Torque (Nm)"
    table = np.column_stack([time, np.degrees(position), -torque])
    np.savetxt(source, table, delimiter=",", header=header, comments="")
    (entry,) = study.entries()
    rows = {row.quantity: row for row in process(study.folder, entry, False)}
    assert rows["K[N.m/rad]"].value == pytest.approx(90.0, rel=0.05)
    assert rows["K_of_mvc[%/rad]"].value == pytest.approx(rows["K[N.m/rad]"].value)
    assert rows["K_by_mass[N.m/rad/kg]"].value == pytest.approx(rows["K[N.m/rad]"].value / 70)
    assert rows["missing_samples[1]"].value == 0
    results = study.derived(entry) / "results.json"
    before = results.stat().st_mtime_ns
    again = {row.quantity: row for row in process(study.folder, entry, False)}
    assert again["K[N.m/rad]"] == rows["K[N.m/rad]"]
    assert results.stat().st_mtime_ns == before
    entry.sidecar.write_text(json.dumps({"body_mass[kg]": 140.0}))
    changed = {row.quantity: row for row in process(study.folder, entry, False)}
    assert changed["K_by_mass[N.m/rad/kg]"].value == pytest.approx(
        rows["K_by_mass[N.m/rad/kg]"].value / 2
    )


@pytest.mark.live
@pytest.mark.untimed
def test_a_study_is_run_and_a_bad_recording_does_not_end_it(study):
    for visit in (1, 2):
        entry = study.next_entry("S07", visit)
        study.add(entry, {})
        if visit == 1:
            write_bag(entry.source)
        else:
            entry.source.with_name(f"{entry.name}.csv").write_text("nothing\n")
    rows, failures = run_study(study, 1, diagnosed=False)
    assert {row.visit for row in rows} == {1}
    assert "holds no rows of numbers" in failures["sub-S07_ses-02_run-01"]
    assert len(read_results(study.results)) == len(rows)
    with pytest.raises(AnalysisError, match="no recording"):
        run_study(init_study(study.folder.parent / "empty"), 1)


def until(condition, what, seconds=10.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.05)


CLOSING_LIMIT = 60.0
"""[s] A process of the cluster that was asked to end has ended by then, on a busy computer, too."""


@contextlib.contextmanager
def running(*command):
    """A program that is asked to end at the end, and killed where it does not."""
    process = subprocess.Popen([sys.executable, "-m", *map(str, command)])
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(CLOSING_LIMIT)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@contextlib.contextmanager
def dask_cluster(folder, workers):
    """The programs that a laboratory starts for a Dask cluster; gives the scheduler's address.

    The workers end before the scheduler. They have no nanny: a nanny's limit of 5 s for closing
    a worker cannot be set, and a busy computer does not keep it.
    """
    file = folder / "scheduler.json"
    scheduler = ("distributed.cli.dask_scheduler", "--port", 0, "--no-dashboard")
    worker = ("distributed.cli.dask_worker", "--no-nanny", "--nthreads", 1, "--no-dashboard")
    with contextlib.ExitStack() as started:
        started.enter_context(running(*scheduler, "--scheduler-file", file))
        until(file.exists, "the scheduler started", 120.0)
        for number in range(workers):
            where = ("--local-directory", folder / f"worker_{number}")
            started.enter_context(running(*worker, "--scheduler-file", file, *where))
        yield json.loads(file.read_text())["address"]


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.timeout(900)
def test_a_dask_cluster_computes_what_this_machine_does(study, tmp_path):
    from dask.distributed import Client, get_task_stream  # a second, in every process of the tests

    for visit in (1, 2):
        entry = study.next_entry("S07", visit)
        study.add(entry, {})
        write_bag(entry.source)
    with dask_cluster(tmp_path, 2) as address, Client(address, timeout="60s") as client:
        client.wait_for_workers(2, timeout=120)
        command = [ANKLE, "study", "run", study.folder, "--no-diagnose", "--scheduler", address]
        with get_task_stream(client) as tasks:
            subprocess.run(command, check=True, timeout=600.0)
    assert len({task["worker"] for task in tasks.data}) == 2
    computed = read_results(study.results)
    assert {row.visit for row in computed} == {1, 2}
    for folder in (study.folder / "derivatives").iterdir():
        if folder.is_dir():
            shutil.rmtree(folder)
    here, failures = run_study(study, 1, diagnosed=False)
    assert failures == {}
    assert [repr(row) for row in here] == [repr(row) for row in computed]


def members_of(group):
    """Processes of a process group that still run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            _, _, rest = stat.read_text().rpartition(")")
            state, _, of_group = rest.split()[:3]
            if int(of_group) == group and state != "Z":
                found.append(int(stat.parent.name))
    return found


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.timeout(600)
def test_a_killed_run_goes_on_where_it_was(study):
    for visit in (1, 2, 3):
        entry = study.next_entry("S07", visit)
        study.add(entry, {})
        write_bag(entry.source)
    command = [ANKLE, "study", "run", study.folder, "--no-diagnose", "--workers", "1"]
    process = subprocess.Popen(command, start_new_session=True)
    first = study.folder / "derivatives" / "sub-S07_ses-01_run-01" / "results.json"
    deadline = time.monotonic() + 300.0
    while not first.exists():
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.05)
    process.kill()
    process.wait()
    # Its workers have ended with it: nothing computes on unseen.
    until(lambda: not members_of(process.pid), "the workers ended")
    assert not study.results.exists()
    before = first.stat().st_mtime_ns
    subprocess.run(command, check=True)
    rows = read_results(study.results)
    assert {row.visit for row in rows} == {1, 2, 3}
    assert (study.folder / "derivatives" / "failures.txt").read_text() == ""
    assert first.stat().st_mtime_ns == before


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_recording_of_a_study_is_diagnosed(study):
    entry = study.next_entry("S07", 1)
    study.add(entry, {})
    write_bag(entry.source)
    rows = {row.quantity: row for row in process(study.folder, study.entries()[0], True)}
    assert rows["diagnosis_augmented_vaf_holdout[%]"].value > 90.0
    assert (study.derived(entry) / "diagnosis" / "report.html").exists()


def test_what_is_no_recording_is_not_added(tmp_path):
    (tmp_path / "notes.docx").write_text("x")
    (tmp_path / "empty").mkdir()
    for name, words in (("notes.docx", "'.docx' is not read"), ("empty", "is no bag"), ("x", "no")):
        with pytest.raises(AnalysisError, match=words):
            check_recording(tmp_path / name)


def test_a_pseudonym_that_differs_by_capitals_alone_is_refused(study):
    entry = study.next_entry("S07", 1)
    study.add(entry, {})
    write_bag(entry.source)
    with pytest.raises(AnalysisError, match="the study has 'S07'"):
        study.next_entry("s07", 2)
    assert study.next_entry("S07", 2).visit == 2


def test_a_diagnosis_becomes_rows_with_their_units(study):
    entry = study.next_entry("S08", 1)
    verdict = {
        "effects": [{"name": "backlash", "probability": 0.7}],
        "fit": {"ceiling_vaf": 97.4, "gap_closed": 0.96, "note": "text"},
    }
    assert {row.quantity: row.value for row in verdict_rows(entry, verdict)} == {
        "effect:backlash[1]": 0.7,
        "diagnosis_ceiling_vaf[%]": 97.4,
        "diagnosis_gap_closed[1]": 0.96,
    }


def test_the_largest_torque_of_the_check_list_is_in_the_recording(tmp_path):
    store = typestore()

    def event(name, time, **details):
        line = SessionEvent(name, time, details).line()
        text = store.types["std_msgs/msg/String"](data=line)
        return bytes(store.serialize_cdr(text, "std_msgs/msg/String"))

    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/session/event", "std_msgs/msg/String")
        for time, (name, torque) in enumerate((("done", -80.0), ("failed", 3.0), ("done", -92.5))):
            details = {"check": "mvc_plantarflexion", "torque[N.m]": torque}
            message = event(f"check {name}", float(time), **details)
            writer.write("/session/event", 1_000_000_000 * (1 + time), message)
    assert measured_in_visit(tmp_path / "bag") == {"mvc_plantarflexion[N.m]": 92.5}


def test_a_table_of_several_is_read_once_the_sidecar_names_it(study):
    entry = study.next_entry("S07", 1)
    study.add(entry, {})
    source = entry.source.with_name(f"{entry.name}.csv")
    rows = [f"{a:.3f},{p:.8f},{m:.6f}" for a, p, m in zip(*ankle(), strict=True)]
    head = "Time (s),Angle (rad),Torque (Nm)"
    lines = ["Trial 1", head, *rows[:5000], "", "Trial 2", head, *rows]
    source.write_text("\n".join(lines))
    (held,) = study.entries()
    with pytest.raises(AnalysisError, match=rf"stand in {entry.name}\.json, as .*section"):
        process(study.folder, held, False)
    held.sidecar.write_text(json.dumps({"section": "Trial 2"}))
    assert {row.quantity for row in process(study.folder, held, False)} > {"K[N.m/rad]"}
    bag = BagReader(imported_bag(study.derived(held)))
    assert bag.custom_data["imported_table"] == "Trial 2"
