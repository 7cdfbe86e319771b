"""What single terms add on the recorded human trials: ``python -m simulation_study.human_terms
RECORDINGS --out FILE TERM...``.

RECORDINGS holds the trials as for `simulation_study.human_trials`. For each trial the base
model is fitted, then the best model that the search finds without the given terms; each term is
then fitted beside either. FILE becomes a table in Markdown of VAF on unseen data [%]: trained on
one half in time, scored on the other, both ways.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ankle_physics.errors import ModelError
from ankle_physics.term import term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.held_out import held_out
from model_discrepancy.problem import Problem, prepare
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import candidates, grid, moves_foot, screen, with_term
from model_discrepancy.search.term_search import search
from simulation_study.human_trials import load_trial, trial_paths

# Enough for a term with three nonlinear parameters beside five others.
EVALUATIONS = 40


def best_without(problem: Problem, terms: list[str]) -> Fit:
    """Return the model that the search finds in a library without these terms."""
    fitter = problem.fitter
    null = Null.of(problem.noise, fitter.rows.time, fitter.rows.used)
    library = [name for name in term_library() if name not in terms]
    return search(fitter, problem.base, null, library).final


def with_new(fitter: Fitter, fit: Fit, name: str) -> Fit:
    """Return the model with one more term, from the best point of its grid.

    A further coupling takes the place of the model's own, since a foot is strapped on once.
    """
    if moves_foot(name):
        kept = [t for t in fit.terms if not moves_foot(t)]
        fit = fitter.fit(kept, fit.values, evaluations=EVALUATIONS)
    if name not in candidates(fit):
        raise ModelError(f"term '{name}' cannot be added to {', '.join(fit.terms)}")
    points = {name: grid(name, fitter.rows.count / fitter.rows.rate)}
    start = screen(fitter, fit, points)[0].start
    return fitter.fit(
        with_term(fit.terms, name), {**fit.values, name: start}, evaluations=EVALUATIONS
    )


def table(files: list[Path], terms: list[str]) -> str:
    """Return the table of all trials in Markdown; prints each number as it comes."""
    lines = [
        "| trial | term | alone: VAF [%] | gain | beside the best without it: VAF [%] | gain |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for file in files:
        problem = prepare(load_trial(file))
        fitter = problem.fitter
        best = best_without(problem, terms)
        scored = [held_out(fitter, fit).vaf for fit in (problem.base, best)]
        added = ", ".join(t for t in best.terms if t not in problem.base.terms)
        lines.append(
            f"| {file.stem} | none; the best without the terms below holds {added} | "
            f"{scored[0]:.2f} | | {scored[1]:.2f} | |"
        )
        print(lines[-1], flush=True)
        for name in terms:
            now = [
                held_out(fitter, with_new(fitter, fit, name)).vaf for fit in (problem.base, best)
            ]
            lines.append(
                f"| {file.stem} | {name} | {now[0]:.2f} | {now[0] - scored[0]:+.2f} | "
                f"{now[1]:.2f} | {now[1] - scored[1]:+.2f} |"
            )
            print(lines[-1], flush=True)
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the table for the trials of a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", type=Path)
    parser.add_argument("terms", nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    unknown = [name for name in options.terms if name not in term_library()]
    if unknown:
        raise ModelError(f"unknown term '{unknown[0]}'; known: {', '.join(term_library())}")
    files = trial_paths(options.recordings)
    options.out.write_text(table(files, options.terms))


if __name__ == "__main__":
    main()
