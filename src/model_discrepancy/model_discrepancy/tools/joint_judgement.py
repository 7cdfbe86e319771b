"""Judge the open sets of an investigation by a search of all its recordings together.

A set holds what fits the first recording about as well as the name that was preferred there. Where
that name stood in for something else, the right one may not be in the set, and no experiment that
tells its members apart brings it in. A search of all recordings together does: what stands in for
an effect in one movement seldom does so in another one. The search begins from the base model, and
once more from what is left of the sets. Where it leaves a recording unexplained, only its largest
effect is confirmed, since what is missing has stand-ins of its own.

- A set is replaced where that search names another effect that is much larger than whatever it
  names of the set, and the set's names leave all recordings less likely, by BIC, than what the
  search found. What it names beside the set in similar size is another effect.
- Where such an effect is named and confirms none of the set's names, but these fit all recordings
  as well with all that stands beside them, both stay in question: either model was chosen on
  these recordings, so that only a further one can decide.
- A set is withdrawn where that search confirms none of its names and puts none in their place:
  they take off next to nothing of what all effects take off together. It is withdrawn, too, where
  no designed recording needs any of its names: the first one chose them, and says nothing more.
- A set that was withdrawn before takes what a search of more recordings names and confirms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from ankle_physics.rig_file import RigFile
from ankle_physics.term import ModelValues
from model_discrepancy.fit.base_model import bic_change
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.parallel import side_by_side
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.torque_reading import TorqueReading
from model_discrepancy.search.found import REFINEMENT, Progress
from model_discrepancy.tools.joint_candidates import rivals_together
from model_discrepancy.tools.open_set import OpenSet, remaining
from model_discrepancy.tools.several_recordings import diagnose_together
from model_discrepancy.tools.shared_effects import Together

# Share of the error that a name must take off all designed recordings: what takes off less is not
# shown by them.
LEAST_TAKEN = 0.005
# Names of a set that are compared with what all recordings say, the likeliest first: each is fitted
# to every recording, and the others were less likely.
MOST_COMPARED = 3
# What stood in for another effect may still correct the equation of that one a little. Where it is
# more than this share of it, it stands beside it: both are needed.
LARGEST_REMNANT = 0.25


@dataclass(frozen=True)
class Judgement:
    """Tells what all recordings together say of the open sets.

    Attributes
    ----------
    sentence
        In plain words.
    asks
        Whether it put names into a set that a further recording could tell apart.
    found
        What the search found, with a model of each recording; None where nothing was searched.
    """

    sentence: str
    asks: bool
    found: Together | None = None


def judge_together(
    sets: Sequence[OpenSet],
    recordings: Sequence[Recording],
    library: Sequence[str] | None = None,
    progress: Progress = lambda _: None,
    beside: ModelValues | None = None,
    rig: RigFile | None = None,
    reading: TorqueReading | None = None,
) -> Judgement:
    """Search all recordings together, and replace, question or withdraw what is left of the sets
    that this contradicts.

    Parameters
    ----------
    sets
        Changed where what is left of them is replaced, questioned or withdrawn.
    recordings
        The first one and those that were designed, two at least.
    library
        Terms that may be named; None for all.
    progress
        Called with one line for each step.
    beside
        Values by term and symbol of other effects, which the sets do not ask about.
    rig
        The calibrated rig of all recordings, which is taken as known.
    reading
        How the torque sensor reads what acts on the plate, as the first recording tells it.

    Raises
    ------
    DiagnosisError
        One of the recordings cannot be used.
    """
    named = [replace(r, name=f"recording_{k}") for k, r in enumerate(recordings, start=1)]
    asked = [one for one in sets if not one.withdrawn]
    before = [one for one in sets if one.withdrawn]
    begin = dict(beside or {})
    for one in asked:
        likeliest = one.upheld[0]
        begin[likeliest] = one.model(likeliest).get(likeliest, {})
    found = diagnose_together(named, library, progress, rig=rig, begin=begin, reading=reading)
    shares = {effect.name: effect.share for effect in found.effects}
    known = set(beside or {}) | {name for one in asked for name in one.upheld}
    # What is named beside a set, or in another one, is no new name for it.
    new = sorted(shares.keys() - known, key=lambda name: -shares[name])
    said, asks = [], False
    for one in asked:
        names, largest = " or ".join(one.upheld), max(shares.get(n, 0.0) for n in one.upheld)
        instead = (
            bool(new)
            and shares[new[0]] > max(largest / LARGEST_REMNANT, REFINEMENT)
            and _confirmed(shares[new[0]], shares, found)
        )
        confirmed, needless = _confirmed(largest, shares, found), _needless(one, found)
        if confirmed and not instead and not needless:
            continue
        if instead and _worse(one, found):
            _replace(one, found, new.pop(0), library)
            asks = asks or one.open
            said.append(
                f"{' or '.join(one.left)} takes the place of {names}, which leaves all "
                "recordings less likely"
            )
        elif instead and not confirmed:
            _question(one, found, new.pop(0), library)
            asks = True
            said.append(
                f"{' or '.join(one.together)} is named instead of {names}, which fits as well "
                "with all that stands beside it, so that a further recording has to decide"
            )
        elif needless or not confirmed:
            one.left, one.doubted = [], []
            said.append(f"{names} is withdrawn, since the other recordings do not confirm it")
    for one in before:
        if not new or not _confirmed(shares[new[0]], shares, found):
            break
        _replace(one, found, new.pop(0), library)
        if _needless(one, found):
            one.left = []
            continue
        asks = asks or one.open
        said.append(f"{' or '.join(one.left)} is named where nothing was left")
    if not said:
        names = ", ".join(effect.name for effect in found.named)
        said = [f"{names or 'nothing'} is named, which replaces nothing"]
    sentence = f"All recordings together: {'; '.join(said)}.".replace("_", " ")
    return Judgement(sentence, asks, found)


def settle_doubts(sets: Sequence[OpenSet]) -> str:
    """End the questions that no further recording decided, and return what became of them in one
    sentence; empty where there are none.

    Neither side is stated then: a search of all recordings together doubted the one, and the
    likelihood does not speak for the other.

    Parameters
    ----------
    sets
        Changed where two sides are left.
    """
    said = []
    for one in sets:
        if one.undecided:
            said.append(f"{' or '.join(one.left)} is withdrawn, since no recording decides")
            one.left = []
        one.doubted = []
    return f" In the end {'; '.join(said)}.".replace("_", " ") if said else ""


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
        for name in one.upheld[:MOST_COMPARED]
    ]
    return min(changes, default=0.0) > 0.0


def _needless(one: OpenSet, found: Together) -> bool:
    """Say whether each name of a set takes next to nothing off all designed recordings."""
    designed = [member.problem.fitter for member in found.members[1:]]
    taken = [
        sum(
            one.fitted_without(fitter, name).score / one.fitted(fitter, name).score - 1.0
            for fitter in designed
        )
        for name in one.upheld[:MOST_COMPARED]
    ]
    return bool(designed) and max(taken, default=0.0) < LEAST_TAKEN


def _replace(one: OpenSet, found: Together, name: str, library: Sequence[str] | None) -> None:
    """Put a name, and the others that fit all recordings about as well in its place, in the place
    of a set's names.
    """
    with side_by_side():
        rivals = rivals_together(found, name, library)
    fits = {name: rivals.fits[name], **rivals.fits}
    # The next movement is designed with what the last recording made of each name.
    one.models = {other: _values(each[-1]) for other, each in fits.items()}
    one.excess, one.evidence, one.errors = rivals.excess, rivals.evidence, rivals.errors
    one.without, one.doubted = [], []
    one.left = one.together = remaining(one, list(fits))
    one.models = {other: one.models[other] for other in one.left}


def _question(one: OpenSet, found: Together, name: str, library: Sequence[str] | None) -> None:
    """Put a name, and the others that fit about as well in its place, beside a set's names; what
    was chosen on the recordings so far says nothing more.
    """
    doubted = one.upheld[:MOST_COMPARED]
    models = {old: one.model(old) for old in doubted}
    _replace(one, found, name, library)
    one.doubted = [old for old in doubted if old not in one.left]
    one.models |= {old: models[old] for old in one.doubted}
    one.left = [*one.left, *one.doubted]
    one.excess, one.evidence, one.errors = {}, {}, {}


def _values(fit: Fit) -> ModelValues:
    """Return the values of a model's terms."""
    return {term: dict(fit.values[term]) for term in fit.terms}
