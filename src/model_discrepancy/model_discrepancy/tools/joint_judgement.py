"""Judge the open sets of an investigation by a search of all its recordings together.

A set holds what fits the first recording about as well as the name that was preferred there. Where
that name stood in for something else, the right one may not be in the set, and no experiment that
tells its members apart brings it in. A search of all recordings together does: what stands in for
an effect in one movement seldom does so in another one.

- A set is replaced where that search names another effect that is larger than whatever it names of
  the set, and the set's names leave all recordings less likely, by BIC, than what the search found.
- A set is withdrawn where that search confirms none of its names: they take off next to nothing of
  what all effects take off together. Where the search leaves a recording unexplained, only its
  largest effect is confirmed, since what is missing has stand-ins of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from model_discrepancy.fit.base_model import bic_change
from model_discrepancy.fit.parallel import side_by_side
from model_discrepancy.recording.recording import Recording
from model_discrepancy.search.found import REFINEMENT, Progress
from model_discrepancy.tools.joint_candidates import rivals_together
from model_discrepancy.tools.open_set import OpenSet, remaining
from model_discrepancy.tools.several_recordings import diagnose_together
from model_discrepancy.tools.shared_effects import Together

# Names of a set that are compared with what all recordings say, the likeliest first: each is fitted
# to every recording, and the others were less likely.
MOST_COMPARED = 3


def judge_together(
    sets: Sequence[OpenSet],
    recordings: Sequence[Recording],
    library: Sequence[str] | None = None,
    progress: Progress = lambda _: None,
) -> str:
    """Search all recordings together, replace or withdraw what is left of the sets that this
    contradicts, and return what it said in one sentence.

    Parameters
    ----------
    sets
        Changed where what is left of them is replaced or withdrawn.
    recordings
        The first one and those that were designed, two at least.
    library
        Terms that may be named; None for all.
    progress
        Called with one line for each step.

    Raises
    ------
    DiagnosisError
        One of the recordings cannot be used.
    """
    named = [replace(r, name=f"recording {k}") for k, r in enumerate(recordings, start=1)]
    found = diagnose_together(named, library, progress)
    shares = {effect.name: effect.share for effect in found.effects}
    # What stands beside the sets in the first model is none of theirs.
    beside = {name for one in sets for name in one.models[one.effect]}
    known = beside - {one.effect for one in sets} | {name for one in sets for name in one.left}
    new = sorted(shares.keys() - known, key=lambda name: -shares[name])
    said = []
    for one in sets:
        names, largest = " or ".join(one.left), max(shares.get(name, 0.0) for name in one.left)
        if new and shares[new[0]] > max(largest, REFINEMENT) and _worse(one, found):
            one.together = _with_rivals(found, new.pop(0), library)
            one.left = list(one.together)
            said.append(
                f"{' or '.join(one.left)} takes the place of {names}, which leaves all "
                "recordings less likely"
            )
        elif not _confirmed(largest, shares, found) and (
            found.verdict == "unexplained" or _worse(one, found)
        ):
            one.left = []
            said.append(f"{names} is withdrawn, since the other recordings do not confirm it")
    if not said:
        names = ", ".join(effect.name for effect in found.named)
        said = [f"{names or 'nothing'} is named, which replaces nothing"]
    return f"All recordings together: {'; '.join(said)}.".replace("_", " ")


def _confirmed(largest: float, shares: Mapping[str, float], found: Together) -> bool:
    """Say whether all recordings confirm a set whose largest effect has this share."""
    if found.verdict == "unexplained":
        return largest > 0.0 and largest == max(shares.values())
    return largest >= REFINEMENT


def _worse(one: OpenSet, found: Together) -> bool:
    """Say whether every name of a set leaves all recordings less likely, by BIC, than what was
    found in them together.
    """
    fitters = [member.problem.fitter for member in found.members]
    changes = [
        sum(
            bic_change(fitter, member.fit, one.fitted(fitter, name))
            for fitter, member in zip(fitters, found.members, strict=True)
        )
        for name in one.left[:MOST_COMPARED]
    ]
    return min(changes, default=0.0) > 0.0


def _with_rivals(found: Together, name: str, library: Sequence[str] | None) -> list[str]:
    """Return a name and the others that fit all recordings about as well in its place."""
    with side_by_side():
        rivals = rivals_together(found, name, library)
    one = OpenSet(name, {other: {} for other in rivals.fits}, rivals.excess, rivals.evidence)
    return remaining(one, list(rivals.fits))
