"""What base and final model of a search leave of the recording, seen from every side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ankle_physics.term import term_library
from model_discrepancy.criticism.ceiling import ceiling_vaf
from model_discrepancy.criticism.judgement import Scores, judge
from model_discrepancy.criticism.locate import ResidualMap, residual_map
from model_discrepancy.criticism.missing_block import MissingBlock, missing_block
from model_discrepancy.criticism.remainder import Remainder, remainder
from model_discrepancy.criticism.stated_fit import stated_fit
from model_discrepancy.criticism.variability import Variability, variability
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.generic_bank import GenericBank
from model_discrepancy.fit.held_out import HeldOut, held_out
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.fit.preceding_torque import begins_from_rest
from model_discrepancy.fit.standard_errors import with_errors
from model_discrepancy.problem import Problem
from model_discrepancy.recording.channel_gains import Finding
from model_discrepancy.search.found import Found
from model_discrepancy.search.null import Null

# Of the movements that begin after a rest. Where a servo gave way and half of them did, as in a
# binary sequence, what was held before predicted 8 % of a residual without a mismatch.
MOST_FROM_REST = 0.75
# Of what is left, that a block of one input predicts on unseen data. What predicts less is chance,
# and would be simulated with the model.
LEAST_DESCRIBED = 0.005
TOO_SHORT_SENTENCE = (
    "the recording is too short to describe the missing block (six stretches of 5 s are needed)"
)
NO_BLOCK_SENTENCE = (
    "what is missing does not follow the movement: no term that a movement drives describes it"
)


@dataclass(frozen=True)
class Criticism:
    """Holds what the models of a search leave unexplained.

    Attributes
    ----------
    stated
        The final model with the values that are stated of it.
    before, after
        What generic regressors predict of the residual of base and final model.
    base_map, final_map
        Where these residuals sit.
    base_held_out, final_held_out
        VAF of both models on unseen data.
    alternating
        Whether unseen data are alternating stretches of 5 s: a term follows time, of which one half
        of a recording tells nothing about the other, so that this one would be predicted worse than
        by the base model.
    ceiling
        Lower and upper end of the VAF that is explainable [%].
    varies
        What no movement predicts.
    verdict
        ``no_mismatch``, ``explained`` or ``unexplained``.
    closed
        Share of the predictable mismatch that the effects close; NaN without a mismatch.
    block
        What is missing, where the recording is unexplained, and a part of it follows the movement.
    missing
        What is said of it in an unexplained recording, with or without a block; else empty.
    """

    stated: Fit
    before: Remainder
    after: Remainder
    base_map: ResidualMap
    final_map: ResidualMap
    base_held_out: HeldOut
    final_held_out: HeldOut
    alternating: bool
    ceiling: tuple[float, float]
    varies: Variability
    verdict: str
    closed: float
    block: MissingBlock | None
    missing: str


def criticise(
    problem: Problem,
    found: Found,
    null: Null,
    findings: list[Finding],
    progress: Callable[[str], None] = lambda _: None,
) -> Criticism:
    """Look at what the models of a search leave.

    Parameters
    ----------
    problem
        Of the recording.
    found
        Result of the search.
    null
        Surrogates of the recording's noise, as the search left them.
    findings
        What the channels themselves show.
    progress
        Called with one line for each step.
    """
    progress("asking what is still predictable")
    fitter, final = problem.fitter, found.final
    before, after = in_parallel(
        lambda one: _most_predicted(problem, one[0], null, one[1]),
        [(problem.base, null.drawn), (final, null.noise)],
    )
    base_scored, final_scored = _held_out(problem, found)
    base_map = residual_map(fitter.columns, problem.base)
    ceiling = ceiling_vaf(fitter.columns, final, final_scored.vaf, after)
    varies = variability(fitter, final, problem.recording.torque, problem.base)
    scores = Scores(base_scored.vaf, final_scored.vaf, ceiling[1], before.share)
    verdict, closed = judge(found, after, findings, varies, scores)
    block, missing = None, ""
    if verdict == "unexplained":
        progress("describing what is missing")
        block, missing = _described(missing_block(fitter, final, base_map.onsets))
    stated = (
        with_errors(fitter, found.base)
        if verdict == "no_mismatch" and found.effects
        else stated_fit(fitter, final, after)
    )
    return Criticism(
        stated,
        before,
        after,
        base_map,
        residual_map(fitter.columns, final),
        base_scored,
        final_scored,
        final_scored is not found.final_held_out,
        ceiling,
        varies,
        verdict,
        closed,
        block,
        missing,
    )


def _described(block: MissingBlock | None) -> tuple[MissingBlock | None, str]:
    """Return the missing block where it predicts more than nothing, and what is said of it."""
    if block is None:
        return None, TOO_SHORT_SENTENCE
    if block.share < LEAST_DESCRIBED:
        return None, NO_BLOCK_SENTENCE
    return block, block.sentence


def _held_out(problem: Problem, found: Found) -> tuple[HeldOut, HeldOut]:
    """Return the scores of both models on unseen data: of the other half, or of alternating
    stretches, as `Criticism.alternating` says.
    """
    base, final = found.base_held_out, found.final_held_out
    if final.vaf >= base.vaf or not any(term_library()[n].follows_time for n in found.final.terms):
        return base, final
    base, final = in_parallel(
        lambda fit: held_out(problem.fitter, fit, parts=problem.parts), [found.base, found.final]
    )
    return base, final


def _most_predicted(problem: Problem, fit: Fit, null: Null, surrogates: np.ndarray) -> Remainder:
    """Return what generic regressors predict of a residual: those of constant responses, of
    responses that change slowly, or of those that follow the muscles' torque.

    What is missing physics comes first, then what exceeds chance by most.
    """
    held = not problem.in_a_loop
    # How the servo gives way is known to some per cent.
    gives_way = problem.gives_way

    def predicted(bank: GenericBank, noise: np.ndarray, judged: bool) -> Remainder:
        found = remainder(bank, problem.fitter, fit.residual, fit.plain, problem.parts, noise)
        leaked = gives_way and found.by_cancelling
        return replace(found, judged=judged and not leaked, held=held and not leaked, leaked=leaked)

    found = [predicted(problem.bank, surrogates, not problem.in_a_loop)]
    changing = [(problem.bank_over_time, not problem.in_a_loop)]
    # A term that follows torque takes its course from the whole slow torque, and does not reach
    # what the bank makes of the torque before each movement.
    follows = any(term_library()[name].follows_torque for name in fit.terms)
    if problem.bank_over_torque is not None and not follows:
        # Torque that moved the plate follows itself, not its product with what was held before.
        # Where movements follow each other without rest, what was held before is the response to
        # the last one, which such torque changes, too.
        known = not problem.in_a_loop or begins_from_rest(problem.fitter.columns, MOST_FROM_REST)
        changing.append((problem.bank_over_torque, known))
    for bank, judged in changing:
        # What the bank predicts of the noise is none, and would raise what it predicts by chance.
        noise = bank.unpredicted(problem.noise, problem.parts)[problem.fitter.rows.used]
        # That lowers chance, so that both halves have to exceed it.
        one = replace(predicted(bank, null.drawn_from(noise), judged), both_ways=True)
        # Where it shows nothing, names remain in doubt behind a servo that gives way.
        doubted = problem.in_a_loop or one.leaked
        found.append(one if one.significant else replace(one, judged=not doubted))
    return max(found, key=lambda one: (one.significant, one.share - max(one.by_chance, 0.0)))
