"""Cases: their mix, their bags, their faults."""

import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from ankle_interfaces.block import unpack
from blind_rig import effects, faults
from blind_rig.bag import Contents, fingerprint, write_bag
from blind_rig.cases import Plan, make_case, plan_cases
from blind_rig.trial import Recording
from simulation_study.blind.acceptance import ANSWERS


def test_mix_of_kinds_and_every_effect_dealt() -> None:
    plans = plan_cases(100, 5)
    counts = Counter(plan.kind for plan in plans)
    assert 20 <= counts["null"] <= 25
    assert 10 <= counts["unknown"] <= 15
    assert counts["broken"] == 10
    dealt = Counter(
        name for plan in plans if plan.kind in ("known", "pair") for name in plan.hidden
    )
    assert set(dealt) == {effect.name for effect in effects.KNOWN_EFFECTS}
    assert max(dealt.values()) - min(dealt.values()) <= 1
    for plan in plans:
        if plan.kind == "pair":
            assert len({effects.EFFECTS_BY_NAME[name].place for name in plan.hidden}) == 2


def test_plans_depend_on_the_seed_and_on_nothing_else() -> None:
    assert plan_cases(30, 1) == plan_cases(30, 1)
    assert plan_cases(30, 1) != plan_cases(30, 2)
    with pytest.raises(ValueError, match="0 cases"):
        plan_cases(0, 1)


def test_every_known_effect_has_an_answer_and_no_unknown_one() -> None:
    assert set(ANSWERS) == {effect.name for effect in effects.KNOWN_EFFECTS}
    setup_paths = [path for answer in ANSWERS.values() for path in answer.parameters]
    from blind_rig.anatomy import Setup

    for path in [
        *setup_paths,
        *(effect.magnitude for effect in effects.EFFECTS_BY_NAME.values()),
        *(p for e in effects.EFFECTS_BY_NAME.values() for p in e.shape),
    ]:
        Setup().get(path)


def test_compared_parameters_exist_in_the_library() -> None:
    """A renamed parameter would never be compared; the text is read, nothing is imported."""
    terms = Path(__file__).resolve().parents[2] / "ankle_physics" / "ankle_physics" / "terms"
    for answer in ANSWERS.values():
        for term, key, _ in answer.parameters.values():
            symbol, unit = key.rstrip("]").split("[")
            assert re.search(
                rf'Parameter\(\s*"{symbol}",\s*"{re.escape(unit)}"',
                (terms / f"{term}.py").read_text(),
            ), f"{term} has no {key}"


def _streams(bag: Path) -> dict[str, np.ndarray]:
    (file,) = bag.glob("*.mcap")
    streams: dict[str, list[np.ndarray]] = {}
    columns: dict[str, tuple[str, ...]] = {}
    with file.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            assert schema.name == "std_msgs/msg/Float64MultiArray"
            block = unpack(message.data)
            assert columns.setdefault(channel.topic, block.columns) == block.columns
            streams.setdefault(channel.topic, []).append(block.data)
    return {
        f"{topic}|{','.join(columns[topic])}": np.vstack(parts) for topic, parts in streams.items()
    }


def test_null_case_makes_a_bag_with_the_designs_topics_and_nothing_that_tells(
    tmp_path: Path,
) -> None:
    truth = make_case(Plan("case_007", "null", (), (), 8), tmp_path / "case_007")
    streams = _streams(tmp_path / "case_007")
    samples = next(v for k, v in streams.items() if k.startswith("/ankle/samples"))
    names = next(k for k in streams if k.startswith("/ankle/samples"))
    expected = (
        "t[s],position[rad],velocity[rad/s],torque[N.m]"
        if truth["bag"]["velocity"]
        else "t[s],position[rad],torque[N.m]"
    )
    assert names == f"/ankle/samples|{expected}"
    assert (
        "/perturbation/reference|t[s],position[rad],velocity[rad/s],acceleration[rad/s^2]"
        in streams
    ) == truth["bag"]["reference"]
    assert ("/emg/samples|t[s],SOL[V],TA[V],GL[V],GM[V]" in streams) == truth["bag"]["emg"]
    assert np.diff(samples[:, 0]) == pytest.approx(1 / truth["rate[Hz]"], abs=1e-6)
    assert 60 <= samples[-1, 0] - samples[0, 0] <= 120
    written = (tmp_path / "case_007" / "metadata.yaml").read_text() + "".join(
        p.name for p in (tmp_path / "case_007").iterdir()
    )
    assert not any(word in written for word in ("effect", "seed", "blind", "known"))
    assert truth["fingerprint"] == fingerprint(tmp_path / "case_007")
    assert truth["effects"] == []


def _recording() -> Recording:
    generator = np.random.default_rng(0)
    t = np.arange(20000) / 1000
    x = 0.02 * np.sin(2 * np.pi * 1.3 * t) + 0.01 * np.sin(2 * np.pi * 7.1 * t)
    torque = 100 * x + 4 + 0.05 * generator.standard_normal(len(t))
    return Recording(
        t, x + 0.1, np.gradient(x, t), torque, np.column_stack([x, x, x]), np.zeros((len(t), 4))
    )


@pytest.mark.parametrize("fault", faults.FAULTS)
def test_fault_breaks_the_recording_visibly(fault: str) -> None:
    whole = _recording()
    harmed = faults.broken(whole, fault, np.random.default_rng(1))
    assert len(harmed.time) == len(harmed.torque) == len(harmed.position)
    n = len(harmed.time)
    slope = np.polyfit(harmed.position - harmed.position.mean(), harmed.torque, 1)[0]
    signs = {
        "torque_sign": -100.0,
        "position_sign": -100.0,
        "torque_in_millinewtonmetres": 1e5,
        "position_in_degrees": 100 * np.pi / 180,
    }
    if fault in signs:
        assert slope == pytest.approx(signs[fault], rel=0.05)
    elif fault == "torque_dead":
        assert harmed.torque[-n // 3 :].std() < 2e-3
    elif fault == "torque_saturated":
        assert (
            np.mean((harmed.torque == harmed.torque.max()) | (harmed.torque == harmed.torque.min()))
            > 0.08
        )
    elif fault == "encoder_stuck":
        assert np.mean(np.diff(harmed.position) == 0) > 0.02
    else:
        lags = np.arange(-100, 101)
        middle = slice(200, n - 200)
        match = [
            np.corrcoef(harmed.position[middle], harmed.torque[200 + lag : n - 200 + lag])[0, 1]
            for lag in lags
        ]
        assert 0.02 < abs(lags[int(np.argmax(match))]) / 1000 < 0.07


def test_bag_changes_show_in_the_fingerprint(tmp_path: Path) -> None:
    recording = _recording()
    write_bag(tmp_path / "bag", recording, 1000.0, Contents(True, True, False))
    before = fingerprint(tmp_path / "bag")
    file = next((tmp_path / "bag").glob("*.mcap"))
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(bytes(content))
    assert fingerprint(tmp_path / "bag") != before
