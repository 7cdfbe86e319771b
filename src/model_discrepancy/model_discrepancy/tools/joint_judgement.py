"""Judge the open sets of an investigation by a search of all its recordings together.

A set holds what fits the first recording about as well as the name that was preferred there. Where
that name stood in for something else, the right one may not be in the set, and no experiment that
tells its members apart brings it in. A search of all recordings together does: what stands in for
an effect in one movement seldom does so in another one. A set goes where that search names another
effect that is larger than whatever it names of the set, and the set's names leave all recordings
less likely, by BIC, than what the search found. The other effect takes its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from model_discrepancy.fit.base_model import bic_change
from model_discrepancy.fit.parallel import side_by_side
from model_discrepancy.recording.recording import Recording
from model_discrepancy.search.found import Progress
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
    """Search all recordings together, replace what is left of the sets that this contradicts, and
    return what it said in one sentence.

    Parameters
    ----------
    sets
        Changed where what is left of them is replaced.
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
    gains = {effect.name: effect.gain for effect in found.effects}
    # What stands beside the sets in the first model is none of theirs.
    beside = {name for one in sets for name in one.models[one.effect]}
    known = beside - {one.effect for one in sets} | {name for one in sets for name in one.left}
    new = sorted(gains.keys() - known, key=lambda name: -gains[name])
    said = []
    for one in sets:
        if not new or any(gains.get(name, 0.0) > gains[new[0]] for name in one.left):
            continue
        if _worse(one, found):
            refuted = " or ".join(one.left)
            one.together = _with_rivals(found, new.pop(0), library)
            one.left = list(one.together)
            said.append(
                f"{' or '.join(one.left)} takes the place of {refuted}, which leaves all "
                "recordings less likely"
            )
    if not said:
        said = [f"{', '.join(gains) or 'nothing'} is named, which replaces nothing"]
    return f"All recordings together: {'; '.join(said)}.".replace("_", " ")


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
        excess, evidence = rivals_together(found, name, library)
    one = OpenSet(name, {other: {} for other in excess}, excess, evidence)
    return remaining(one, list(excess))
