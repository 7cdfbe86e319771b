"""A study written as BIDS: what is exported, and what is left out."""

import json

import edfio
import numpy as np
import pytest
from study_recordings import RATE, ankle, write_bag

from ankle_interfaces.block import Block
from session_analysis.errors import AnalysisError
from session_analysis.study.bids_export import export_bids, left_out
from session_analysis.study.layout import init_study
from session_analysis.study.running import run_study
from session_recorder.bag_writer import BagWriter


def test_bids_has_motion_and_emg_with_their_descriptions(study, tmp_path):
    entry = study.next_entry("S07", 1)
    study.add(entry, {"side": "left", "electrode_placement": "SENIAM"})
    write_bag(entry.source, emg=True)
    written = export_bids(study, tmp_path / "bids")
    motion, emg = written
    assert motion.name == "sub-S07_ses-01_task-anklePerturbation_tracksys-rig_run-01_motion.tsv"
    np.testing.assert_allclose(np.loadtxt(motion)[:, 1], ankle()[1], atol=1e-8)
    about = json.loads(motion.with_suffix(".json").read_text())
    assert about["SamplingFrequency"] == RATE
    assert about["side"] == "left"
    assert (
        len(
            motion.with_name(motion.name.replace("_motion.tsv", "_channels.tsv"))
            .read_text()
            .splitlines()
        )
        == 4
    )
    signal = edfio.read_bdf(emg).signals[0]
    assert signal.label == "SOL"
    np.testing.assert_allclose(signal.data[:1000], 20 * np.sin(100 * ankle()[0][:1000]), atol=1e-4)
    assert json.loads((tmp_path / "bids" / "dataset_description.json").read_text())["BIDSVersion"]


def test_a_gap_of_emg_keeps_its_place_in_a_file_without_times(study, tmp_path):
    entry = study.next_entry("S07", 1)
    study.add(entry, {})
    time = np.delete(np.arange(8000) / 1000, slice(3000, 5000))
    volts = np.where(np.abs(time - 2.0) < 0.01, np.nan, 2e-5 * np.sin(100 * time))
    with BagWriter(entry.source) as writer:
        writer.add_topic("/emg/samples")
        rows = np.column_stack([10 + time, volts])
        for first in range(0, len(rows), 32):
            block = Block(("t[s]", "SOL[V]"), rows[first : first + 32])
            writer.write_block("/emg/samples", block)
    (emg,) = export_bids(study, tmp_path / "bids")
    values = edfio.read_bdf(emg).signals[0].data
    np.testing.assert_allclose(values[6000:8000], 20 * np.sin(100 * time[4000:6000]), atol=1e-3)
    about = json.loads(emg.with_name(emg.name.replace(".bdf", ".json")).read_text())
    assert about["StartTime"] == 10.0
    first, second = about["AbsentSamples"]
    assert first == {"onset": 1.991, "duration": pytest.approx(0.019, abs=0.0015)}
    assert second == {"onset": 3.0, "duration": 2.0}


def test_a_file_that_could_not_be_imported_does_not_keep_the_others_from_export(study, tmp_path):
    good, bad = study.next_entry("S07", 1), study.next_entry("S08", 1)
    study.add(good, {})
    write_bag(good.source)
    study.add(bad, {})
    bad.source.with_name(f"{bad.name}.csv").write_text("no,numbers\n")
    rows, failures = run_study(study, 1, None, False)
    assert {row.subject for row in rows} == {"S07"}
    assert "Refused" not in failures[bad.name]
    assert left_out(study) == study.failures()
    (motion,) = export_bids(study, tmp_path / "bids")
    assert motion.name.startswith("sub-S07")


def test_bids_has_imported_files_or_says_that_they_are_missing(study, tmp_path):
    entry = study.next_entry("S08", 1)
    study.add(entry, {})
    entry.source.with_name(f"{entry.name}.csv").write_text("Time (s),Ankle Angle (deg)\n")
    with pytest.raises(AnalysisError, match="not imported yet: 'ankle study run"):
        export_bids(study, tmp_path / "bids")
    assert not (tmp_path / "bids").exists()
    write_bag(study.derived(entry) / "imported")
    (motion,) = export_bids(study, tmp_path / "bids")
    assert motion.name.startswith("sub-S08_ses-01")
    with pytest.raises(AnalysisError, match="no recording"):
        export_bids(init_study(tmp_path / "empty"), tmp_path / "nothing")
