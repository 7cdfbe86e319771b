"""How sure a name is, and when it gives way to its family."""

from types import SimpleNamespace

import pytest

from model_discrepancy.fit.movements import Peak
from model_discrepancy.report.effect_size import Size
from model_discrepancy.report.verdict import CERTAINTY, Standing, effect_entry
from model_discrepancy.search.found import Found

VALUES = {"reflex_stiffening": {"kr": 80.0, "delay": 0.04, "omega": 20.0, "recovery": 0.5}}


@pytest.mark.parametrize(
    ("at_bounds", "standing", "stated"),
    [
        ((), Standing.COMPLETE, "maxwell_relaxation"),
        (("maxwell_relaxation.T",), Standing.COMPLETE, "intrinsic memory"),
        ((), Standing.CRITICISED, "intrinsic memory"),
        ((), Standing.INCOMPLETE, "intrinsic memory"),
        (("reflex.G",), Standing.COMPLETE, "maxwell_relaxation"),
    ],
)
def test_a_name_whose_equation_is_not_quite_right_gives_way_to_its_family(
    at_bounds, standing, stated
):
    entry = entry_of("maxwell_relaxation", at_bounds, True, standing)
    assert entry["stated"] == stated
    assert entry["family_probability"] >= entry["probability"]
    assert (entry["probability"] >= 0.7) == (stated == "maxwell_relaxation")
    assert entry["tentative"] == (standing is Standing.INCOMPLETE)


def test_a_further_name_is_sure_only_where_nothing_stands_against_the_model():
    for standing in Standing:
        further = entry_of("maxwell_relaxation", (), False, standing)
        assert (further["probability"] >= 0.7) == (standing is Standing.COMPLETE)
        assert further["probability"] <= CERTAINTY[True, standing][0]
    assert entry_of("maxwell_relaxation", (), True, Standing.UNEXPLAINED)["probability"] < 0.3


def test_the_name_of_a_term_that_imitates_others_is_never_sure():
    entry = entry_of("reflex_stiffening", (), True, Standing.COMPLETE)
    assert entry["probability"] == CERTAINTY[True, Standing.CRITICISED][0] < 0.7


def test_rivals_are_weighed_against_the_model_that_they_were_tried_with():
    """A flexible term lowers the error of the final model, and of none of its rivals."""
    rival = SimpleNamespace(name="short_range_stiffness", fit=SimpleNamespace(score=1.0))
    alone, beside, later = (
        entry_of("maxwell_relaxation", (), True, Standing.COMPLETE, rivals, inflexible)
        for rivals, inflexible in (([], None), ([rival], None), ([rival], 1.0))
    )
    assert beside["probability"] == pytest.approx(0.5 * alone["probability"])
    assert later["probability"] == beside["probability"]
    unweighed = entry_of("maxwell_relaxation", (), True, Standing.COMPLETE, [rival], 0.7)
    assert unweighed["probability"] > 0.99 * alone["probability"]


def entry_of(name, at_bounds, first, standing, rivals=(), inflexible=None):
    effect = SimpleNamespace(
        trial=SimpleNamespace(name=name, held_out=(0.2, 0.2)),
        rivals=list(rivals),
        excluded={},
    )
    before = None if inflexible is None else SimpleNamespace(score=inflexible)
    final = SimpleNamespace(
        values={name: VALUES.get(name, {"k": 30.0, "T": 0.1})},
        errors={},
        score=1.0,
        stopped=at_bounds,
    )
    return effect_entry(
        effect,
        Found(final, final, inflexible=before),
        final,
        Size(0.1, Peak(0.2, 0.1, "dorsiflexion"), 0.1),
        first,
        standing,
    )
