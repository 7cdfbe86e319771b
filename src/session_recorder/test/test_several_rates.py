"""Files in which EMG, angle and torque have rates of their own: each keeps its times, or the line
to type is named.
"""

import numpy as np
import pytest
from laboratory_trial import DEG, RATE, TRIAL, text
from scipy.io import savemat
from several_rates import (
    EMG,
    EMG_MV,
    EMG_RATE,
    EMG_TABLE,
    EMG_TIME,
    MECHANICS,
    SEVERAL_RATES,
    below_one_another,
    edf_of_two_rates,
    mat_rate_of_each_structure,
    rows,
    sheets,
)

from session_recorder.bag_reader import BagReader
from session_recorder.errors import ImportRefused
from session_recorder.importing import import_recording, propose, read_table
from session_recorder.importing.sampling import resample_columns


def import_as_proposed(source, bag, **options):
    table = read_table(source)
    proposal = propose(table)
    stated = {
        "torque_sign": proposal.torque_sign,
        "rate": proposal.rate,
        "resample": proposal.resample,
        **options,
    }
    return import_recording(table, bag, proposal.columns, **stated)


@pytest.mark.parametrize("make", SEVERAL_RATES, ids=lambda make: make.__name__)
def test_emg_that_is_faster_keeps_its_rate_beside_angle_and_torque(make, tmp_path):
    make(tmp_path / "file")
    (source,) = tmp_path.iterdir()
    report = import_as_proposed(source, tmp_path / "bag")
    assert report.rates == pytest.approx({"/ankle/samples": RATE, "/emg/samples": EMG_RATE})
    assert report.intrinsic.inertia == pytest.approx(0.0137, rel=0.05)
    exact = 2e-3 if make is edf_of_two_rates else 1e-6
    reader = BagReader(tmp_path / "bag")
    names, data = reader.signal("/ankle/samples")
    np.testing.assert_allclose(data[:, 0], TRIAL["t"], atol=1e-9)
    for name in ("position", "torque"):
        column = next(k for k, held in enumerate(names) if held.startswith(name))
        atol = exact * np.ptp(TRIAL[name])
        np.testing.assert_allclose(data[:, column], TRIAL[name], atol=atol)
    names, data = reader.signal("/emg/samples")
    np.testing.assert_allclose(data[:, 0], EMG_TIME, atol=1e-9)
    np.testing.assert_allclose(data[:, names.index("SOL[V]")], EMG, atol=exact * np.ptp(EMG))


def test_angle_and_torque_of_different_rates_are_refused_with_the_line_that_joins_them(tmp_path):
    slow = slice(None, None, 2)
    header = "X[s],Ankle Angle (deg),X[s],Torque (Nm)"
    columns = [TRIAL["t"][slow], DEG[slow], TRIAL["t"], TRIAL["torque"]]
    (tmp_path / "a.csv").write_text(rows(header, columns))
    with pytest.raises(ImportRefused, match=r"different sampling rates.*add --resample 500"):
        import_as_proposed(tmp_path / "a.csv", tmp_path / "bag", resample=None)
    assert "--resample 500" in propose(read_table(tmp_path / "a.csv")).command("a.csv", "bag")
    report = import_as_proposed(tmp_path / "a.csv", tmp_path / "bag")
    assert report.rate == RATE
    names, data = BagReader(tmp_path / "bag").signal("/ankle/samples")
    position = data[:, names.index("position[rad]")]
    np.testing.assert_allclose(position[50:-50], TRIAL["position"][50 : len(data) - 50], atol=1e-3)


def test_a_rate_of_a_structure_is_not_that_of_another(tmp_path):
    mat_rate_of_each_structure(tmp_path / "a")
    table = read_table(tmp_path / "a.mat")
    assert table.rate is None
    assert table.rates == {"kin.angle_deg": 500.0, "kin.torque_Nm": 500.0, "emg.SOL_mV": 1000.0}
    held = {"angle_deg": DEG, "torque_Nm": TRIAL["torque"]}
    savemat(tmp_path / "b.mat", {**held, "info": {"fs": RATE}, "fs_camera": 100.0})
    table = read_table(tmp_path / "b.mat")
    assert (table.rate, table.rates) == (RATE, {})


def test_emg_whose_rate_contradicts_its_length_is_refused(tmp_path):
    kin = {"angle_deg": DEG, "torque_Nm": TRIAL["torque"], "fs": RATE}
    savemat(tmp_path / "a.mat", {"kin": kin, "emg": {"SOL_mV": 1e3 * EMG, "fs": 4 * RATE}})
    with pytest.raises(ImportRefused, match="is one of the rates wrong"):
        import_as_proposed(tmp_path / "a.mat", tmp_path / "bag")


def test_resampling_to_a_lower_rate_lets_nothing_fold_down():
    t = np.arange(20_000) / 2048.0
    fast = np.sin(2 * np.pi * 900.0 * t)
    slow = np.sin(2 * np.pi * 10.0 * t)
    grid, made, _ = resample_columns(t, {"fast": fast, "slow": slow}, 1024.0)
    assert np.abs(made["fast"][100:-100]).max() < 1e-3
    np.testing.assert_allclose(
        made["slow"][100:-100], np.sin(20 * np.pi * grid[100:-100]), atol=1e-3
    )


def test_a_file_with_a_rate_and_no_time_is_resampled_as_well(tmp_path):
    (tmp_path / "a.csv").write_text(
        text([DEG, TRIAL["torque"]], header=["Angle (deg),Torque (Nm)"])
    )
    columns = {"position[deg]": "Angle (deg)", "torque[N.m]": "Torque (Nm)"}
    report = import_recording(
        tmp_path / "a.csv", tmp_path / "bag", columns, torque_sign="rig", rate=RATE, resample=1000.0
    )
    assert (report.rate, report.samples) == (1000.0, 9999)


def test_times_of_one_clock_beside_each_other_are_one(tmp_path):
    header = "Clock (s),Time (s),Ankle Angle (deg),Torque (Nm)"
    columns = [TRIAL["t"] + 40_000, TRIAL["t"], DEG, TRIAL["torque"]]
    (tmp_path / "a.csv").write_text(rows(header, columns))
    assert read_table(tmp_path / "a.csv").times == {}


def titled(title, table):
    return [title, table[0]], table[1]


def test_tables_of_different_rates_are_joined_by_their_titles(tmp_path):
    other = ["Time (s),EMG TA (mV)", [EMG_TIME, 2 * EMG_MV]]
    below_one_another(
        tmp_path / "a", titled("Rig", MECHANICS), titled("EMG 1", EMG_TABLE), titled("EMG 2", other)
    )
    table = read_table(tmp_path / "a.csv", ("Rig", "3"))
    assert table.names == [
        *("Time (s)", "Ankle Angle (deg)", "Torque (Nm)", "EMG 2/Time (s)", "EMG TA (mV)")
    ]
    line = propose(table).command("a.csv", "bag")
    assert "--section Rig --section 'EMG 2'" in line
    assert "'TA[mV]=EMG TA (mV)'" in line
    assert read_table(tmp_path / "a.csv", "Rig").names == table.names[:3]


@pytest.mark.parametrize("unit", ["s", "ms"])
def test_tables_of_equal_times_are_one_table(unit, tmp_path):
    t, angle, torque = MECHANICS[1]
    times = 1e3 * t if unit == "ms" else t
    below_one_another(
        tmp_path / "a",
        titled("Angle", ("Time (s),Ankle Angle (deg)", [t, angle])),
        titled("Torque", (f"Time ({unit}),Torque (Nm)", [times, torque])),
    )
    assert read_table(tmp_path / "a.csv").times == {}
    report = import_as_proposed(tmp_path / "a.csv", tmp_path / "bag")
    assert (report.rate, report.samples) == (RATE, len(angle))
    assert BagReader(tmp_path / "bag").custom_data["imported_table"] == "Angle and Torque"


EMG_WITHOUT_TIMES = ["EMG SOL (mV)", [EMG_MV]]
EMG_OF_ANOTHER_TRIAL = [EMG_TABLE[0], [column[:15_00] for column in EMG_TABLE[1]]]
EMG_WITHOUT_COMMON_TIME = [EMG_TABLE[0], [EMG_TIME + 100.0, EMG_MV]]


@pytest.mark.parametrize(
    ("tables", "reason"),
    [
        (
            {"EMG": EMG_WITHOUT_TIMES},
            "'EMG' has neither a time column nor a sampling rate; write one above",
        ),
        (
            {"EMG": EMG_OF_ANOTHER_TRIAL},
            "it lasts from 0 to 1.499 s, and 'Rig' from 0 to 9.998 s: is it of anoth",
        ),
        ({"EMG": EMG_WITHOUT_COMMON_TIME}, "no time is common to both"),
        ({"EMG": EMG_TABLE, "EMG 2": EMG_WITHOUT_COMMON_TIME}, "other tables have SOL as well"),
    ],
)
def test_a_table_that_cannot_be_joined_is_left_out_with_the_reason(tables, reason, tmp_path):
    sheets(tmp_path / "a", Rig=MECHANICS, **tables)
    report = import_as_proposed(tmp_path / "a.xlsx", tmp_path / "bag")
    assert list(report.rates) == ["/ankle/samples"]
    assert any(
        note.startswith("'EMG' is left out: ") and reason in note for note in report.warnings
    )
    if tables["EMG"] is EMG_WITHOUT_TIMES:
        with pytest.raises(ImportRefused, match="neither a time column nor a sampling rate"):
            read_table(tmp_path / "a.xlsx", ("Rig", "EMG"))
