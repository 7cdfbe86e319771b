"""Recorded human trials, as bags or as files."""

import numpy as np
import pytest

from ankle_interfaces.block import Block
from ankle_interfaces.topics import ANKLE_SAMPLES
from model_discrepancy.errors import DiagnosisError
from session_recorder.bag_writer import BagWriter
from simulation_study.human_trials import load_trial, trial_paths


def test_a_trial_reads_alike_from_a_bag_and_from_a_file(tmp_path):
    time = np.arange(2000) / 1000.0
    position, torque = np.random.default_rng(1).normal(size=(2, len(time)))
    np.savez(tmp_path / "mcgill_1.npz", time=time, position=position, torque=-torque)
    names = ("t[s]", "position[rad]", "torque[N.m]")
    with BagWriter(tmp_path / "trial_1") as writer:
        writer.add_topic(ANKLE_SAMPLES.absolute)
        samples = Block(names, np.column_stack([time, position, torque]))
        writer.write_block(ANKLE_SAMPLES.absolute, samples)
    file, bag = (load_trial(path) for path in trial_paths(tmp_path))
    assert file.rate == bag.rate == 1000.0
    np.testing.assert_allclose(bag.position, file.position)
    np.testing.assert_allclose(bag.torque, file.torque)


def test_a_folder_without_trials_is_refused(tmp_path):
    with pytest.raises(DiagnosisError, match=r"no bag trial_\* and no mcgill_\*\.npz in"):
        trial_paths(tmp_path)
