"""Scripted parameters: courses in time, and files that are refused."""

import numpy as np
import pytest
import yaml

from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.scenario import Scenario
from ankle_physics.virtual_rig import VirtualRig, simulate

TEXT = """
scenario: all kinds
changes:
  - at[s]: 1
    stiffness.K[N.m/rad]: 50
  - at[s]: 2
    over[s]: 2
    stiffness.K[N.m/rad]: 150
  - at[s]: 3
    stiffness.K[N.m/rad]: 20
  - at[s]: 5
    stiffness.K[N.m/rad]:
      mean: 100
      amplitude: 30
      frequency[Hz]: 0.5
"""


def test_jump_interrupted_ramp_and_sinusoid():
    (track,) = Scenario.from_content(yaml.safe_load(TEXT)).tracks
    time = np.array([0.0, 0.999, 1.0, 2.0, 2.5, 2.999, 3.0, 4.9, 5.0, 5.5, 6.5])
    expected = [77, 77, 50, 50, 75, 99.95, 20, 20, 100, 130, 70]
    assert track.values(time, before=77.0) == pytest.approx(expected)
    pieces = np.concatenate([track.values(time[k : k + 1], 77.0) for k in range(len(time))])
    assert pieces == pytest.approx(expected)


def test_a_ramp_starts_where_the_change_before_it_has_got():
    (track,) = Scenario.from_content(
        {
            "changes": [
                {"at[s]": 0, "over[s]": 10, "reflex.G[N.m.s/rad]": 20},
                {"at[s]": 5, "over[s]": 1, "reflex.G[N.m.s/rad]": 0},
            ]
        }
    ).tracks
    assert track.values(np.array([5.0, 5.5, 6.0]), before=0.0) == pytest.approx([10.0, 5.0, 0.0])


def test_the_torque_jumps_at_the_time_written():
    scenario = Scenario.from_content({"changes": [{"at[s]": 0.25, "stiffness.K[N.m/rad]": 150}]})
    reference = np.tile([0.02, 0.0, 0.0], (1024, 1))
    recording = simulate(reference, 2048.0, Model.of({"stiffness": {"K": 50.0}}), scenario=scenario)
    before = recording.time < 0.25
    assert recording.parts["stiffness"][before] == pytest.approx(1.0)
    assert recording.parts["stiffness"][~before] == pytest.approx(3.0)
    assert recording.truth["stiffness.K[N.m/rad]"][~before] == pytest.approx(150.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"stiffness.K[N.m/rad]": 50}, r"change 1: lacks its time 'at\[s\]'"),
        ({"at[s]": -1, "stiffness.K[N.m/rad]": 50}, r"at\[s\] = -1 s is outside 0"),
        (
            {"at[s]": 0, "stiffness.K[N.m/rad]": 5000},
            r"stiffness.K\[N.m/rad\] = 5000 N.m/rad is outside 0 to 1000 N.m/rad",
        ),
        (
            {"at[s]": 0, "stiffness.K[N.m/deg]": 5},
            "cannot be scripted; parameters of 'stiffness' that can: stiffness.K",
        ),
        ({"at[s]": 0, "reflex.delay[s]": 0.05}, "cannot be scripted"),
        ({"at[s]": 0, "spring.K[N.m/rad]": 5}, "unknown key 'spring.K"),
        ({"at[s]": 0, "stiffness.K[N.m/rad]": "stiff"}, "= stiff N.m/rad"),
        (
            {"at[s]": 0, "stiffness.K[N.m/rad]": {"mean": 10, "amplitude": 20, "frequency[Hz]": 1}},
            "amplitude = 20 N.m/rad is outside 0 to 10",
        ),
        ({"at[s]": 0, "stiffness.K[N.m/rad]": {"mean": 10}}, "a sinusoid has"),
    ],
)
def test_bad_changes_are_named_with_their_file(tmp_path, change, words):
    path = tmp_path / "script.yaml"
    path.write_text(yaml.safe_dump({"scenario": "bad", "changes": [change]}))
    with pytest.raises(ModelError, match=words) as error:
        Scenario.load(path)
    assert str(path) in str(error.value)


def test_times_out_of_order_and_missing_terms_are_refused():
    with pytest.raises(ModelError, match=r"change 2: .* does not come after its change at 3 s"):
        Scenario.from_content(
            {
                "changes": [
                    {"at[s]": 3, "reflex.G[N.m.s/rad]": 1},
                    {"at[s]": 2, "reflex.G[N.m.s/rad]": 2},
                ]
            }
        )
    scenario = Scenario.from_content({"changes": [{"at[s]": 0, "voluntary_torque.level[N.m]": -5}]})
    with pytest.raises(ModelError, match="no term 'voluntary_torque'"):
        VirtualRig(Model.of(), scenario=scenario)


def test_a_scripted_parameter_cannot_be_set_by_hand():
    scenario = Scenario.from_content({"changes": [{"at[s]": 3, "reflex.G[N.m.s/rad]": 1}]})
    with pytest.raises(ModelError, match="scripted"):
        VirtualRig(scenario=scenario).set("reflex", "G", 3.0)
