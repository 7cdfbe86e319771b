"""The verdict follows from what the named effects close and from what is still predictable."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from model_discrepancy.criticism import criticism
from model_discrepancy.criticism.judgement import Scores, judge
from model_discrepancy.criticism.remainder import Remainder
from model_discrepancy.fit import preceding_torque
from model_discrepancy.report.conclusion import standing_of
from model_discrepancy.report.verdict import Standing
from model_discrepancy.search.found import Effect, Found, Trial

SCORES = Scores(base=80.0, augmented=94.0, ceiling=96.0)
# Names that gain no more torque than leakage lets the movement predict.
LIKE_LEAKAGE = Scores(base=93.5, augmented=94.0, ceiling=94.2)


USUAL_VARIABILITY = SimpleNamespace(unusual=[], unexplainable=[], unsteady=[])


def found(
    score,
    effects=("a term",),
    contradicted=False,
    at_bounds=False,
    stands_in=False,
    base_stands_in=False,
):
    """A search whose model leaves `score` of the whitened error of the base model."""
    return SimpleNamespace(
        effects=list(effects),
        cut=1.0 - score,
        shape_corrected=False,
        contradicted=contradicted,
        ends_at_bounds=at_bounds,
        immaterial=False,
        reflex_stands_in=stands_in,
        base_reflex_stands_in=base_stands_in,
    )


def remainder(share, judged, torque_share=0.02, held=True):
    return Remainder(
        share=share,
        worst=share,
        by_input={"velocity": share},
        plain_share=share,
        torque_share=torque_share,
        by_chance=0.03,
        judged=judged,
        held=held,
    )


@pytest.mark.parametrize(
    ("score", "left", "judged", "expected"),
    [
        (0.5, 0.02, True, "explained"),  # no more than by chance
        (0.5, 0.3, True, "unexplained"),
        (0.2, 0.14, True, "explained"),  # 97 % are closed, the rest is little beyond chance
        (0.3, 0.3, True, "unexplained"),  # 89 %
        (0.1, 0.6, True, "unexplained"),  # 94 % are closed, and most of the rest is predictable
        (0.5, 0.08, False, "explained"),  # torque that moved the plate
        (0.5, 0.3, False, "explained"),
        (0.1, 0.45, False, "unexplained"),  # much more than any servo lets through
    ],
)
def test_an_effect_explains_what_it_closes(score, left, judged, expected):
    left = remainder(left, judged, held=judged)
    assert judge(found(score), left, [], USUAL_VARIABILITY, SCORES)[0] == expected


@pytest.mark.parametrize(
    ("base", "judged", "expected"),
    [
        (93.5, False, "no_mismatch"),  # names took off as much without a mismatch
        (93.5, True, "explained"),  # no torque moves the plate
        (90.0, False, "explained"),  # more torque than any leakage lets the movement predict
    ],
)
def test_names_that_leakage_may_have_made_are_no_mismatch(base, judged, expected):
    left = remainder(0.02, judged, torque_share=2e-3, held=False)
    scores = replace(LIKE_LEAKAGE, base=base)
    assert judge(found(0.7), left, [], USUAL_VARIABILITY, scores)[0] == expected


@pytest.mark.parametrize(
    ("predictable", "left", "score", "expected"),
    [
        (0.97, 0.02, 0.42, "explained"),  # nearly all was predictable, and nothing is any more
        (0.60, 0.02, 0.42, "no_mismatch"),  # torque that moved the plate makes as much of it so
        (0.97, 0.12, 0.42, "no_mismatch"),  # the name does not take it away
        (0.97, 0.02, 0.65, "no_mismatch"),
    ],
)
def test_a_name_that_takes_away_all_that_was_predictable_is_no_leakage(
    predictable, left, score, expected
):
    """Voluntary torque hides what a name predicts of the plain torque."""
    rest = remainder(left, False, torque_share=0.0, held=False)
    scores = replace(LIKE_LEAKAGE, base=LIKE_LEAKAGE.augmented, predictable=predictable)
    assert judge(found(score), rest, [], USUAL_VARIABILITY, scores)[0] == expected


def test_too_little_torque_is_no_mismatch_whatever_predicts_it():
    small = remainder(0.3, False, torque_share=8e-4, held=False)
    assert judge(found(0.5), small, [], USUAL_VARIABILITY, SCORES)[0] == "explained"
    assert judge(found(1.0, effects=()), small, [], USUAL_VARIABILITY, SCORES)[0] == "no_mismatch"


@pytest.mark.parametrize(
    ("left", "judged", "held", "expected"),
    [
        (0.2, False, True, "explained"),
        (0.3, False, True, "unexplained"),
        (0.3, True, False, "unexplained"),
        (0.35, False, False, "explained"),  # torque may have moved the plate
        (0.5, False, False, "unexplained"),
    ],
)
def test_right_names_leave_little_of_the_residual_predictable_however_little_torque(
    left, judged, held, expected
):
    left = remainder(left, judged, torque_share=6e-4, held=held)
    names = found(0.05, effects=("a term", "another"))
    assert judge(names, left, [], USUAL_VARIABILITY, SCORES)[0] == expected


@pytest.mark.parametrize(
    ("score", "effects", "torque_share", "expected"),
    [
        (1.0, (), 0.02, "unexplained"),
        (1.0, (), 0.006, "no_mismatch"),  # as leakage left it without a mismatch
        (0.95, ("a term",), 0.02, "unexplained"),
        (0.5, ("a term",), 0.02, "explained"),  # three quarters are closed
    ],
)
def test_no_leakage_makes_so_much_torque_predictable(score, effects, torque_share, expected):
    left = remainder(0.3, False, torque_share, held=False)
    assert judge(found(score, effects), left, [], USUAL_VARIABILITY, SCORES)[0] == expected


def test_a_residual_that_stays_predictable_is_not_explained_however_little_torque_it_is():
    small = remainder(0.3, True, torque_share=8e-4)
    assert (
        judge(found(0.4), small, [], USUAL_VARIABILITY, SCORES)[0] == "unexplained"
    )  # 83 % are closed
    two = found(0.1, effects=("a term", "another"))
    small = remainder(0.2, True, torque_share=8e-4)
    assert judge(two, small, [], USUAL_VARIABILITY, SCORES)[0] == "explained"
    moved = remainder(0.3, True, torque_share=8e-4, held=False)
    two = found(0.4, effects=("a term", "another"))
    assert judge(two, moved, [], USUAL_VARIABILITY, SCORES)[0] == "explained"
    small = remainder(0.08, True, torque_share=8e-4)
    assert judge(found(1.0, effects=()), small, [], USUAL_VARIABILITY, SCORES)[0] == "no_mismatch"


@pytest.mark.parametrize(
    ("left", "held", "expected"),
    [
        (0.14, True, "unexplained"),
        (0.08, True, "no_mismatch"),
        (0.12, True, "no_mismatch"),  # 0.03 of it by chance
        (0.4, False, "no_mismatch"),  # torque may have moved the plate
    ],
)
def test_without_names_more_of_the_residual_than_ever_without_a_mismatch_is_one(
    left, held, expected
):
    left = remainder(left, True, torque_share=4e-4, held=held)
    assert judge(found(1.0, effects=()), left, [], USUAL_VARIABILITY, SCORES)[0] == expected


@pytest.mark.parametrize(
    ("torque_share", "joint_change", "cut", "expected"),
    [
        (1e-5, 0.004, 0.07, "no_mismatch"),
        (1e-5, 0.004, 0.12, "explained"),  # far more of the residual
        (2e-3, 0.004, 0.07, "explained"),  # torque that matters
        (1e-5, 0.3, 0.07, "explained"),  # a joint of another stiffness
    ],
)
def test_names_that_change_nothing_that_matters_are_no_mismatch(
    torque_share, joint_change, cut, expected
):
    scores = Scores(base=98.2, augmented=98.203, ceiling=99.0)
    trial = SimpleNamespace(torque_share=torque_share, joint_change=joint_change)
    found_so = found(1.0 - cut)
    found_so.immaterial = Found.immaterial.fget(
        SimpleNamespace(effects=[SimpleNamespace(trial=trial)])
    )
    nothing = remainder(0.0, True, torque_share=0.0)
    assert judge(found_so, nothing, [], USUAL_VARIABILITY, scores)[0] == expected


def test_a_reflex_at_the_bound_of_its_range_is_a_mismatch_where_nothing_else_is():
    """A late reflex: the paper's takes its place, with the longest delay that it may have."""
    nothing = remainder(0.0, True)
    for effects, score in (((), 1.0), (("a term",), 0.99)):
        found_so = found(score, effects, stands_in=True)
        assert judge(found_so, nothing, [], USUAL_VARIABILITY, SCORES)[0] == "unexplained"
        found_so = found(score, effects)
        assert judge(found_so, nothing, [], USUAL_VARIABILITY, SCORES)[0] == "no_mismatch"
    for where in ({"stands_in": True}, {"base_stands_in": True}):
        named = found(0.2, **where)
        assert judge(named, nothing, [], USUAL_VARIABILITY, SCORES)[0] == "explained"


@pytest.mark.parametrize(("stands_in", "expected"), [(False, "no_mismatch"), (True, "unexplained")])
def test_names_are_not_dropped_for_a_base_model_whose_reflex_stands_in(stands_in, expected):
    for score, left, scores in (
        (0.99, remainder(0.0, True), SCORES),  # they take off next to nothing
        # Torque may have moved the plate.
        (0.7, remainder(0.02, False, held=False), LIKE_LEAKAGE),
    ):
        named = found(score, base_stands_in=stands_in)
        assert judge(named, left, [], USUAL_VARIABILITY, scores)[0] == expected


def test_a_stiffness_that_changes_in_time_is_a_mismatch_where_nothing_else_is():
    nothing = remainder(0.0, True)
    stiffens = SimpleNamespace(unusual=[], unexplainable=[], unsteady=["the stiffness changes"])
    assert judge(found(1.0, ()), nothing, [], USUAL_VARIABILITY, SCORES)[0] == "no_mismatch"
    assert judge(found(1.0, ()), nothing, [], stiffens, SCORES)[0] == "unexplained"
    assert judge(found(0.2), nothing, [], stiffens, SCORES)[0] == "explained"
    # Torque that moves the plate makes a stiffness that varies.
    moved = remainder(0.0, False, held=False)
    assert judge(found(1.0, ()), moved, [], stiffens, SCORES)[0] == "no_mismatch"
    # Names that take off next to nothing do not explain it.
    assert judge(found(0.96), nothing, [], stiffens, SCORES)[0] == "unexplained"


@pytest.mark.parametrize(
    ("share", "judged", "names", "expected"),
    [
        (0.16, True, 1, "unexplained"),
        (0.14, True, 1, "explained"),  # less than five times what chance predicts
        (0.16, False, 1, "explained"),  # torque may have moved the plate
        (0.16, True, 2, "explained"),
    ],
)
def test_one_name_that_leaves_much_predictable_stands_in_for_another(
    share, judged, names, expected
):
    left = remainder(share, judged, torque_share=4e-4)
    closed = found(0.05, effects=["a term", "another"][:names])
    assert judge(closed, left, [], USUAL_VARIABILITY, SCORES)[0] == expected


def test_names_that_end_at_the_bounds_of_their_ranges_explain_nothing():
    little = remainder(0.02, True)
    assert judge(found(0.3), little, [], USUAL_VARIABILITY, SCORES)[0] == "explained"
    bounded = found(0.3, at_bounds=True)
    assert judge(bounded, little, [], USUAL_VARIABILITY, SCORES)[0] == "unexplained"


@pytest.mark.parametrize(
    ("names", "left", "judged", "expected"),
    [
        (3, 0.04, True, "unexplained"),
        (2, 0.04, True, "explained"),
        (3, 0.02, True, "explained"),  # nothing stands against them
        (3, 0.04, False, "explained"),  # what is left may have moved the plate itself
    ],
)
def test_many_names_with_something_against_them_stand_in_for_another(names, left, judged, expected):
    named = found(0.3, effects=("a term",) * names)
    assert judge(named, remainder(left, judged), [], USUAL_VARIABILITY, SCORES)[0] == expected


def test_what_changing_responses_predict_must_exceed_chance_both_ways():
    mean_alone = replace(remainder(0.05, True), worst=0.02)
    assert mean_alone.criticises
    assert not replace(mean_alone, both_ways=True).criticises
    assert replace(mean_alone, worst=0.04, both_ways=True).criticises


@pytest.mark.parametrize(
    ("score", "judged", "expected"),
    [(0.7, True, "explained"), (0.5, False, "explained"), (0.7, False, "no_mismatch")],
)
def test_names_that_take_off_little_are_none_where_torque_may_have_moved_the_plate(
    score, judged, expected
):
    left = remainder(0.02, judged, held=False)
    named = found(score, at_bounds=expected == "no_mismatch")
    assert judge(named, left, [], USUAL_VARIABILITY, LIKE_LEAKAGE)[0] == expected


def most_predicted(servo=None, **problem):
    """What the banks of a problem predict most of, where each predicts what a test says."""
    problem = SimpleNamespace(
        servo=servo,
        fitter=SimpleNamespace(rows=SimpleNamespace(used=slice(None)), columns=None),
        parts=None,
        noise=np.zeros(4),
        **problem,
    )
    null = SimpleNamespace(drawn_from=lambda noise: noise)
    fit = SimpleNamespace(terms=["stiffness"], residual=None, plain=None)
    return criticism._most_predicted(problem, fit, null, None)


@pytest.mark.parametrize(
    ("torque_share", "without_rest", "judged"),
    [(0.0, 2, False), (0.02, 2, True), (0.02, 4, False)],
)
def test_behind_a_soft_servo_only_torque_before_a_movement_that_shows_something_judges(
    monkeypatch, torque_share, without_rest, judged
):
    """Without a command nothing else tells physics from torque that moved the plate."""
    times = np.cumsum([0.0] + [0.2] * without_rest + [0.6] * (9 - without_rest))
    monkeypatch.setattr(
        preceding_torque, "find_onsets", lambda columns: SimpleNamespace(time=times)
    )
    bank = SimpleNamespace(unpredicted=lambda noise, parts: noise)
    before = SimpleNamespace(unpredicted=lambda noise, parts: noise)
    left = {id(bank): remainder(0.05, True), id(before): remainder(0.2, True, torque_share)}
    monkeypatch.setattr(
        criticism, "remainder", lambda one, *_: replace(left[id(one)], by_chance=0.01)
    )
    most = most_predicted(
        gives_way=True,
        in_a_loop=True,
        bank=bank,
        bank_over_time=bank,
        bank_over_torque=before,
    )
    assert most.judged is judged


@pytest.mark.parametrize(
    ("alone", "servo", "gives_way", "leaked"),
    [
        (-0.05, None, True, True),
        (0.2, None, True, False),  # physics answers one quantity of the movement
        (-0.05, "told by the command", True, True),
        (-0.05, "told by the command", False, False),
        (-0.05, None, False, False),
    ],
)
def test_what_only_several_inputs_predict_is_torque_that_moved_the_plate(
    monkeypatch, alone, servo, gives_way, leaked
):
    """Behind a servo of which holds or command tell roughly how it gives way they cancel the
    movement.
    """
    bank = SimpleNamespace(unpredicted=lambda noise, parts: noise)
    over_time = SimpleNamespace(unpredicted=lambda noise, parts: noise)
    together = replace(
        remainder(0.5, True, torque_share=0.007), by_input={"velocity": alone, "position": -0.1}
    )
    monkeypatch.setattr(
        criticism,
        "remainder",
        lambda one, *_: together if one is bank else remainder(-0.1, True),
    )
    most = most_predicted(
        servo=servo,
        gives_way=gives_way,
        in_a_loop=False,
        bank=bank,
        bank_over_time=over_time,
        bank_over_torque=None,
    )
    assert most.leaked == leaked
    assert most.significant == (not leaked)
    nothing = found(1.0, effects=())
    expected = "no_mismatch" if leaked else "unexplained"
    assert judge(nothing, most, [], USUAL_VARIABILITY, LIKE_LEAKAGE)[0] == expected
    much = replace(most, torque_share=0.027)
    assert judge(nothing, much, [], USUAL_VARIABILITY, LIKE_LEAKAGE)[0] == expected


def ended(labels):
    return SimpleNamespace(at_bounds=labels, stopped=labels)


def effect_of(name, at_bounds):
    fit = SimpleNamespace(at_bounds=at_bounds)
    return Effect(Trial(name, fit, 0.5, (0.5, 0.5), -1.0), errors=None)


@pytest.mark.parametrize(
    ("bounded", "ends"), [((), False), ((0,), True), ((1,), False), ((1, 2), True)]
)
def test_the_first_name_or_half_of_them_at_a_bound_say_that_the_names_are_wrong(bounded, ends):
    names = ("tendon", "backlash", "thixotropy")
    labels = tuple(f"{names[k]}.x" for k in bounded)
    # Where they ended before the last refit tells nothing.
    effects = [effect_of(name, ("tendon.x",)) for name in names]
    base, final = ended(()), ended(labels)
    assert Found(base, final, effects=effects).ends_at_bounds == ends
    assert not Found(base, final).ends_at_bounds


def test_names_that_leave_no_plausible_inertia_took_the_foots_place():
    inside, at_bound = ended(()), ended(("inertia.I",))
    effects = [effect_of("plate_appendage", ())]
    assert Found(inside, at_bound, effects=effects).ends_at_bounds
    # A joint that is at the end of the range without them stays there.
    assert not Found(at_bound, at_bound, effects=effects).ends_at_bounds


def test_names_that_predict_no_torque_on_unseen_data_are_no_mismatch():
    useless = Scores(base=80.0, augmented=79.9, ceiling=82.0)
    moved = remainder(0.02, False, held=False)
    assert judge(found(0.5), moved, [], USUAL_VARIABILITY, useless)[0] == "no_mismatch"
    assert judge(found(0.3), moved, [], USUAL_VARIABILITY, useless)[0] == "explained"
    line = SimpleNamespace(unusual=["a narrow line"], unexplainable=[], unsteady=[])
    assert judge(found(0.9), moved, [], line, useless)[0] == "unexplained"


def test_names_are_a_mismatch_where_torque_does_not_move_the_plate():
    """However little they raise the VAF: slow torque, which no movement causes, decides that."""
    useless = Scores(base=80.0, augmented=79.9, ceiling=82.0)
    nothing, much = remainder(0.02, True), remainder(0.3, True)
    assert judge(found(0.96), nothing, [], USUAL_VARIABILITY, useless)[0] == "explained"
    assert judge(found(0.3), nothing, [], USUAL_VARIABILITY, useless)[0] == "explained"
    assert judge(found(0.9), much, [], USUAL_VARIABILITY, useless)[0] == "unexplained"
    line = SimpleNamespace(unusual=["a narrow line"], unexplainable=[], unsteady=[])
    assert judge(found(0.9), nothing, [], line, useless)[0] == "unexplained"


@pytest.mark.parametrize(
    ("score", "augmented", "judged", "left", "expected"),
    [
        (0.87, 80.15, True, 0.02, "explained"),  # no torque moves the plate
        (0.87, 80.15, False, 0.02, "no_mismatch"),
        (0.91, 80.3, True, 0.02, "explained"),
        (0.5, 80.15, True, 0.02, "explained"),
        (0.5, 80.15, False, 0.5, "no_mismatch"),  # torque that moved the plate
        (0.3, 80.15, False, 0.5, "unexplained"),
    ],
)
def test_names_that_predict_hardly_any_torque_and_take_off_little_are_no_mismatch(
    score, augmented, judged, left, expected
):
    nothing = remainder(left, judged, torque_share=2e-3, held=judged)
    scores = Scores(base=80.0, augmented=augmented, ceiling=82.0)
    assert judge(found(score), nothing, [], USUAL_VARIABILITY, scores)[0] == expected


def test_names_beside_more_torque_than_leaks_are_a_mismatch_however_little_they_predict():
    much = remainder(0.5, False, torque_share=0.05, held=False)
    scores = Scores(base=80.0, augmented=80.15, ceiling=82.0)
    assert judge(found(0.5), much, [], USUAL_VARIABILITY, scores)[0] == "unexplained"


def test_effects_that_take_off_next_to_nothing_are_no_mismatch():
    nothing, much = remainder(0.005, True), remainder(0.3, True)
    moved = remainder(0.02, False, held=False)
    assert judge(found(0.98), nothing, [], USUAL_VARIABILITY, SCORES)[0] == "explained"
    assert judge(found(0.99), nothing, [], USUAL_VARIABILITY, SCORES)[0] == "no_mismatch"
    assert judge(found(0.97), moved, [], USUAL_VARIABILITY, SCORES)[0] == "no_mismatch"
    assert judge(found(0.99), nothing, ["a gain"], USUAL_VARIABILITY, SCORES)[0] == "explained"
    assert judge(found(0.99), much, [], USUAL_VARIABILITY, SCORES)[0] == "unexplained"


@pytest.mark.parametrize(
    ("score", "share", "expected"),
    [
        (0.9, 0.0, Standing.COMPLETE),
        (0.97, 0.0, Standing.CRITICISED),  # so little may follow the movement by accident
        (0.9, 0.3, Standing.INCOMPLETE),
    ],
)
def test_a_name_is_sure_where_it_takes_off_enough_and_leaves_nothing(score, share, expected):
    assert standing_of("explained", found(score), remainder(share, True)) is expected
    assert standing_of("unexplained", found(score), remainder(share, True)) is Standing.UNEXPLAINED


@pytest.mark.parametrize(("augmented", "expected"), [(81.5, "no_mismatch"), (82.5, "explained")])
def test_names_that_close_little_of_what_torque_that_moved_the_plate_predicts_are_none(
    augmented, expected
):
    scores = Scores(base=80.0, augmented=augmented, ceiling=85.0)
    left = remainder(0.3, False, held=False)
    assert judge(found(0.5), left, [], USUAL_VARIABILITY, scores)[0] == expected
    assert (
        judge(found(0.5), left, ["a gain of a channel"], USUAL_VARIABILITY, scores)[0]
        == "explained"
    )
    held = remainder(0.02, True)
    assert judge(found(0.5), held, [], USUAL_VARIABILITY, scores)[0] == "explained"
    # Not where they leave half of it all.
    half = remainder(0.5, False, held=False)
    assert judge(found(0.8), half, [], USUAL_VARIABILITY, scores)[0] == "unexplained"


def test_names_beside_what_is_no_function_of_the_movement_do_not_explain_it():
    changing = SimpleNamespace(unusual=["responses differ"], unexplainable=[], unsteady=[])
    assert judge(found(0.2), remainder(0.3, True), [], changing, SCORES)[0] == "unexplained"
    assert judge(found(0.2), remainder(0.02, True), [], changing, SCORES)[0] == "explained"
    reflex = SimpleNamespace(
        unusual=["a late reflex"], unexplainable=["a late reflex"], unsteady=[]
    )
    assert judge(found(0.2), remainder(0.0, True), [], reflex, SCORES)[0] == "unexplained"
    assert judge(found(1.0, ()), remainder(0.0, True), [], reflex, SCORES)[0] == "unexplained"


def test_names_that_leave_much_of_the_torque_that_is_predictable_do_not_explain_it():
    much, little = remainder(0.2, True, torque_share=0.06), remainder(0.2, True, torque_share=0.03)
    assert (
        judge(found(0.2), much, [], USUAL_VARIABILITY, SCORES)[0] == "unexplained"
    )  # 14 % beside 6 %
    two = found(0.2, effects=("a term", "another"))
    assert judge(two, little, [], USUAL_VARIABILITY, SCORES)[0] == "explained"


def test_names_that_a_term_of_little_torque_contradicts_do_not_explain_it():
    nothing = remainder(0.02, True)
    assert judge(found(0.05), nothing, [], USUAL_VARIABILITY, SCORES)[0] == "explained"
    assert (
        judge(found(0.05, contradicted=True), nothing, [], USUAL_VARIABILITY, SCORES)[0]
        == "unexplained"
    )


@pytest.mark.parametrize(
    ("gain", "held_out", "expected"),
    [(0.3, (0.28, 0.25), True), (0.3, (0.28, 0.05), False), (0.15, (0.15, 0.15), False)],
)
def test_a_term_contradicts_the_named_ones_where_it_takes_off_much_of_what_they_leave(
    gain, held_out, expected
):
    trial = Trial(
        "tendon", SimpleNamespace(), gain, held_out, 0.0, by_chance=0.01, torque_share=1e-4
    )
    found = Found(SimpleNamespace(), SimpleNamespace(), near=[trial])
    assert found.contradicted is expected


@pytest.mark.parametrize(
    ("gain", "held_out", "expected"),
    [(0.05, (0.04, 0.05), True), (0.05, (0.04, -0.01), False), (0.02, (0.02, 0.02), False)],
)
def test_a_term_that_gains_beyond_chance_criticises_a_model_however_little_torque_it_changes(
    gain, held_out, expected
):
    trial = Trial(
        "tendon", SimpleNamespace(), gain, held_out, 0.0, by_chance=0.01, torque_share=1e-4
    )
    assert not trial.accepted
    assert trial.criticises is expected
    assert Found(SimpleNamespace(), SimpleNamespace(), near=[trial]).shape_corrected is expected


def test_what_is_still_predictable_criticises_a_model_however_little_torque_it_is():
    assert remainder(0.1, True, torque_share=1e-5).criticises
    assert not remainder(0.1, True, torque_share=1e-5).exceeds_chance
    assert not remainder(0.02, True).criticises
