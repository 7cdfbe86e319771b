"""The demo's imperfect rig: what is hidden, recorded, compared and drawn; and the section live."""

import math
from datetime import datetime, timezone

import numpy as np
import pytest
from rich.console import Console

from ankle_bringup import demo_pictures, imperfect_rig
from ankle_bringup.demo_calibration import (
    CALIBRATED,
    Comparison,
    LastEstimate,
    compare,
    comparison_table,
    last_estimate,
    show_calibration,
)
from ankle_bringup.graph import load_graph
from ankle_bringup.imperfect_rig import draw_imperfect_rig
from ankle_bringup.regenerate import agreement
from ankle_bringup.simulated_recording import record_simulated_rig
from ankle_interfaces.topics import ANKLE_SAMPLES, IMPEDANCE_ESTIMATE, PERTURBATION_REFERENCE
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from ankle_physics.scenario import Scenario
from ankle_sim.start_setup import make_model
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.known_physics import load_known_physics
from impedance_estimator.offline.recorded_estimates import estimate_bag
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings
from session_recorder.bag_reader import BagReader

RATE = 1024.0
SECONDS = 4.0
STARTED = datetime(2026, 1, 1, tzinfo=timezone.utc)


def estimates(value, valid=1.0, time=0.0):
    """Return one row of estimates."""
    row = np.zeros(len(ESTIMATE_COLUMNS))
    for name, own in (
        ("t[s]", time),
        ("K[N.m/rad]", value),
        ("se_K[N.m/rad]", 3.0),
        ("G[N.m.s/rad]", 0.1 * value),
        ("valid[1]", valid),
        ("doubt[1]", 0.25),
    ):
        row[ESTIMATE_COLUMNS.index(name)] = own
    return row


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_seed_draws_one_rig_with_every_imperfection_within_its_range(seed):
    drawn, again = draw_imperfect_rig(seed), draw_imperfect_rig(seed)
    assert drawn.subject.content() == again.subject.content()
    assert drawn.rig.model.content() == again.rig.model.content()
    assert drawn.subject.content() != draw_imperfect_rig(seed + 1).subject.content()
    both = drawn.rig.twin(drawn.subject)
    for term, symbol, (least, most) in (
        ("footplate_inertia", "Ip", imperfect_rig.PLATE_INERTIA),
        ("servo_compliance", "k_a", imperfect_rig.SERVO_STIFFNESS),
        ("fixation_compliance", "k_s", imperfect_rig.STRAP_STIFFNESS),
        ("stiffness", "K", imperfect_rig.STIFFNESS),
        ("reflex", "G", imperfect_rig.REFLEX_GAIN),
        ("channel_skew", "skew", (0.001, 0.001)),
    ):
        assert least <= both.entry(term).values[symbol] <= most


def test_what_is_hidden_is_written_for_the_simulation(tmp_path):
    drawn = draw_imperfect_rig(1)
    files = drawn.save(tmp_path / "hidden", rises_at=30.0)
    model = make_model({name: str(files[name]) for name in ("rig", "model")})
    assert model.entry("stiffness").values["K"] == pytest.approx(drawn.stiffness)
    for entry in drawn.rig.model.entries:
        assert model.entry(entry.term.name).values == entry.values
    scenario = Scenario.load(files["scenario"])
    ends = {track.key: track.changes[-1] for track in scenario.tracks}
    assert ends["stiffness.K[N.m/rad]"].at == 30.0
    assert ends["stiffness.K[N.m/rad]"].value == pytest.approx(1.2 * drawn.stiffness)
    assert ends["reflex.G[N.m.s/rad]"].value == pytest.approx(1.4 * drawn.reflex_gain)


def test_a_recording_holds_the_whole_signal_and_what_the_rig_makes_of_it(tmp_path):
    drawn, shares = draw_imperfect_rig(1), []
    signal = PulseStep(Settings(rate=RATE, duration=SECONDS, seed=3))
    record_simulated_rig(tmp_path / "bag", drawn.rig, Model.of({}), signal, STARTED, shares.append)
    reader = BagReader(tmp_path / "bag")
    names, samples = reader.signal(ANKLE_SAMPLES.absolute)
    _, reference = reader.signal(PERTURBATION_REFERENCE.absolute)
    assert len(samples) == len(reference) == SECONDS * RATE
    np.testing.assert_array_equal(samples[:, 0], reference[:, 0])
    assert samples[0, 0] == pytest.approx(STARTED.timestamp())
    assert shares[-1] == 1.0
    # The plate alone: its inertia explains the torque, a torque sensor's cycle later.
    torque = samples[:, names.index("torque[N.m]")]
    moved = drawn.rig.model.entry("footplate_inertia").values["Ip"] * reference[:, 3]
    assert np.ptp(torque) > 0.5 * np.ptp(moved)


def test_the_last_valid_estimate_is_the_one_that_is_compared():
    rows = np.array([estimates(50.0), estimates(60.0), estimates(70.0, valid=0.0)])
    assert last_estimate(ESTIMATE_COLUMNS, rows, "K[N.m/rad]") == LastEstimate(60.0, 3.0, 0.25)
    none = last_estimate(ESTIMATE_COLUMNS, rows[2:], "K[N.m/rad]")
    assert math.isnan(none.value)
    assert not Comparison("K", "N.m/rad", 60.0, LastEstimate(1.0, 1.0, 1.0), none).holds


def test_the_table_shows_value_error_and_doubt_beside_the_truth():
    better = LastEstimate(61.0, 1.5, 0.0)
    worse = LastEstimate(45.0, 9.0, 1.0)
    compared = Comparison("K", "N.m/rad", 60.0, worse, better)
    assert compared.holds
    assert not Comparison("K", "N.m/rad", 60.0, better, worse).holds
    console = Console(width=140, record=True)
    console.print(comparison_table([compared]))
    text = console.export_text()
    assert "45 ± 9 (-25 %), doubt 1.00" in text
    assert "61 ± 1.5 (+2 %), doubt 0.00" in text


def test_the_picture_is_drawn_also_where_nothing_is_valid(tmp_path):
    rows = np.array([estimates(50.0, time=t) for t in range(5)])
    none = np.array([estimates(np.nan, 0.0, t) for t in range(5)])
    truth = np.column_stack([np.arange(5.0), np.full(5, 55.0), np.full(5, 6.0)])
    path = tmp_path / "calibration.png"
    demo_pictures.calibrated_run(ESTIMATE_COLUMNS, none, rows, truth, path)
    assert path.read_bytes()[:4] == b"\x89PNG"


def test_the_second_estimator_publishes_beside_the_first_one():
    nodes = {node.name: node for node in load_graph("simulated_calibrated").nodes}
    remapped = nodes["calibrated_estimator"].remappings
    assert remapped[IMPEDANCE_ESTIMATE.name] == CALIBRATED
    assert not nodes["impedance_estimator"].remappings


@pytest.mark.slow
@pytest.mark.live
def test_calibration_brings_the_live_estimates_to_the_truth(tmp_path):
    out = tmp_path / "section"
    compared = show_calibration(out, 2, Console(quiet=True))
    for one in compared:
        assert one.holds
        assert one.calibrated.standard_error < one.without.standard_error
    assert compared == compare(out / "live")
    assert (out / "calibration.png").stat().st_size
    assert RigFile.load(out / "rig.yaml").bag == "plate_empty"
    # The calibrated run was live: the same files give the same numbers from the bag.
    columns, live = BagReader(out / "live").signal(f"/{CALIBRATED}")
    known = load_known_physics(str(out / "subject.yaml"), str(out / "rig.yaml"))
    again = estimate_bag(out / "live", known=known).rows
    found = agreement(columns, live, again)
    assert found.largest <= 1e-9
    assert (found.only_first, found.only_second) == (0, 0)
