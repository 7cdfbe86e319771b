"""A recording's movement through the simulation."""

from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.base_model import fit_base
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.rows import Rows
from model_discrepancy.recording.motion import motion_of
from model_discrepancy.recording.recording import Recording
from model_discrepancy.report.fitted_model import fitted_model
from model_discrepancy.tools.resimulation import (
    resimulate,
    resimulate_bag,
    simulated_torque,
)
from model_discrepancy.tools.written_bag import write_bag
from simulation_study.planted_trials import simulate_trial

# What the movement makes in the trial below; its subject is drawn by the seed.
MAXWELL = {"maxwell_relaxation": {"k": 60.0, "T": 0.08}}


@pytest.fixture(scope="module")
def recording() -> Recording:
    return simulate_trial(MAXWELL, seed=5, duration=30.0, rate=1024.0)


@pytest.fixture(scope="module")
def models(recording: Recording) -> tuple[Model, Model]:
    motion = motion_of(recording)
    fitter = Fitter.of(motion)
    base = fit_base(fitter)
    fitter.whiten_by(base.plain)
    return fitted_model(base, "base"), fitted_model(
        fitter.fit((*base.terms, "maxwell_relaxation"), base.values), "augmented"
    )


def test_the_model_with_the_planted_physics_makes_more_of_the_recorded_torque(
    recording: Recording, models: tuple[Model, Model], tmp_path: Path
) -> None:
    base, augmented = models
    result = resimulate(recording, base, augmented)
    assert result.vaf["augmented"] > result.vaf["base"] + 1.0
    # SNR of the torque is 24 dB; slow voluntary torque comes on top.
    assert result.vaf["augmented"] > 90.0
    result.save(tmp_path)
    again = Recording.from_bag(tmp_path / "augmented_bag")
    np.testing.assert_array_equal(again.torque, result.torque["augmented"])
    np.testing.assert_array_equal(again.position, recording.position)
    assert (tmp_path / "resimulation.png").stat().st_size > 10_000


@pytest.mark.parametrize("skew", [-0.004, 0.004])
def test_torque_that_is_read_at_another_time_than_the_position_is_simulated_there(
    recording: Recording, skew: float
) -> None:
    motion = motion_of(recording)
    values = {
        "inertia": {"I": 0.012},
        "viscosity": {"B": 0.8},
        "stiffness": {"K": 90.0, "x0": float(motion.position.mean())},
    }
    aligned = simulated_torque(Model.of(values), motion)
    apart = simulated_torque(Model.of({**values, "channel_skew": {"skew": skew}}), motion)
    rows = Rows(len(aligned), motion.rate)
    shift = np.exp(-2j * np.pi * rows.frequency * skew)
    expected = rows.plain(rows.spectrum(aligned) * shift)[rows.used]
    made = rows.plain(rows.spectrum(apart))[rows.used]
    assert np.std(made - expected) < 0.01 * np.std(expected)
    assert np.std(made - rows.plain(rows.spectrum(aligned))[rows.used]) > 0.05 * np.std(expected)


def test_a_folder_without_models_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DiagnosisError, match=r"holds no base\.yaml"):
        resimulate_bag(tmp_path / "bag", tmp_path, tmp_path / "out")


def test_a_model_with_a_term_that_the_library_lacks_names_the_option(tmp_path: Path) -> None:
    Model.of().save(tmp_path / "base.yaml")
    text = (tmp_path / "base.yaml").read_text()
    (tmp_path / "model.yaml").write_text(text.replace("viscosity", "own_cable"))
    with pytest.raises(DiagnosisError, match=r"the term 'own_cable', which the library .*--terms"):
        resimulate_bag(tmp_path / "bag", tmp_path, tmp_path / "out")


def test_a_position_that_the_diagnosis_corrects_is_corrected_here_too(
    recording: Recording, models: tuple[Model, Model]
) -> None:
    base, augmented = models
    plain = resimulate(replace(recording, reference=recording.position), base, augmented)
    wrong = replace(recording, position=1.1 * recording.position, reference=recording.position)
    again = resimulate(wrong, base, augmented)
    assert again.vaf["augmented"] == pytest.approx(plain.vaf["augmented"], abs=0.3)


def test_the_zeros_of_a_rig_that_the_diagnosis_knew_are_taken_off_here_too(
    recording: Recording, models: tuple[Model, Model], tmp_path: Path
) -> None:
    base, augmented = models
    curved = Model.of(
        {e.term.name: dict(e.values) for e in augmented.entries}
        | {"hardening_stiffness": {"k3": 2e5, "xc": float(np.mean(recording.position))}}
    )
    rig = RigFile("plate B", datetime(2026, 11, 20, tzinfo=timezone.utc), zero_position=0.1)
    moved = replace(recording, position=recording.position + 0.1)
    folder = tmp_path / "diagnosis"
    folder.mkdir()
    for model, file in ((base, "base.yaml"), (curved, "model.yaml")):
        model.save(folder / file)
    write_bag(moved, moved.torque, tmp_path / "bag")
    without = resimulate_bag(tmp_path / "bag", folder, tmp_path / "without")
    rig.save(folder / "rig.yaml")
    with_it = resimulate_bag(tmp_path / "bag", folder, tmp_path / "with")
    expected = resimulate(recording, base, curved)
    assert with_it.vaf["augmented"] == pytest.approx(expected.vaf["augmented"], abs=0.05)
    assert abs(without.vaf["augmented"] - expected.vaf["augmented"]) > 1.0
