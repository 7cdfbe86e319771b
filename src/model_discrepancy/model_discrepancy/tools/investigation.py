"""Diagnose, design the experiment that tells the rivals apart, record it, and judge all recordings.

This goes on until each effect has one name, until no movement within the limits would tell what is
left, or until the budget of recordings is spent. A rival is fitted to every recording anew, since a
subject's state changes from one to the next; what counts is how much more whitened error it leaves
than the likeliest name of its set, beside how much that differs from stretch to stretch. Then all
recordings are searched together, which may name what was in no set. Where this leaves something to
ask, or withdraws a set and leaves an effect without a name, the investigation goes on with what is
left of its budget: an effect that one recording shows under wrong names is named by several.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from ankle_physics.joint_profile import joint_in_force
from ankle_physics.rig_file import RigFile
from ankle_physics.term import ModelValues
from model_discrepancy.diagnose import Diagnosis, diagnose
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.recording_checks import faults
from model_discrepancy.search.exchange import RIVAL_EXCESS
from model_discrepancy.tools.candidate_movements import Candidate
from model_discrepancy.tools.experiment_design import Design
from model_discrepancy.tools.joint_judgement import judge_together, settle_doubts
from model_discrepancy.tools.movement_ranking import Proposal, RivalSet, rank
from model_discrepancy.tools.open_set import LEAST_APART, OpenSet
from model_discrepancy.tools.recording_judgement import judge_alone, open_sets
from model_discrepancy.tools.shared_effects import Together

# Longer than this is asked of no subject at once.
LONGEST_S = 180.0
# Shorter recordings have too few stretches for a null and for errors.
SHORTEST_S = 60.0

FIRST_FOLDER, TOGETHER_FOLDER = "first", "together"
"""Folders of an investigation: the diagnosis of the first recording, and what the search of all
recordings together wrote."""

ONE_NAME_EACH = "Each effect has one name."
Progress = Callable[[str], None]
Conduct = Callable[[Candidate, float, int], Recording | None]
"""Records a movement: the candidate, its duration [s] and the number of the round from 1; None
where the operator does not consent."""


@dataclass
class Round:
    """Describes one recording that was designed and made.

    Attributes
    ----------
    question
        The sets that were open, in words.
    proposal
        What was to be recorded and why, in one sentence.
    title
        The movement.
    duration
        [s]; 0 where it was not recorded.
    answer
        What the recording said, in one sentence.
    judged
        Whether the recording could be used.
    """

    question: str
    proposal: str
    title: str
    duration: float
    answer: str
    judged: bool = False


@dataclass
class Investigation:
    """Holds the story of an investigation.

    Attributes
    ----------
    first
        Diagnosis of the recording that it began with.
    sets
        What was open then, with what is left.
    rounds
        In order.
    ended
        Why it ended, in one sentence.
    recordings
        The first one and those that were judged.
    together
        What all of them said together, in one sentence; empty where there is one only.
    searched
        How many recordings were searched together last; one at first.
    found
        What that search found, with a model of each recording; None where there is one only.
    rig
        The calibrated rig of all recordings, which is taken as known; None where there is none.
    """

    first: Diagnosis
    sets: list[OpenSet]
    rounds: list[Round] = field(default_factory=list)
    ended: str = ""
    recordings: list[Recording] = field(default_factory=list)
    together: str = ""
    searched: int = 1
    found: Together | None = None
    rig: RigFile | None = None

    @property
    def names(self) -> list[str]:
        """Return the names that are left: one of each settled set, all of an open one, joined by a
        slash; none of a set that was withdrawn.
        """
        known = {s.effect: "/".join(s.left) for s in self.sets}
        names = (known.get(e["name"], e["name"]) for e in self.first.verdict.effects)
        return list(dict.fromkeys(name for name in names if name))

    @property
    def models(self) -> list[str]:
        """Return the model files in the folder of the investigation: one for each recording that
        was searched together with others, or the one of the first recording.
        """
        if self.found is None:
            return [f"{FIRST_FOLDER}/model.yaml"]
        return [f"{TOGETHER_FOLDER}/{member.name}.yaml" for member in self.found.members]

    @property
    def beside(self) -> ModelValues:
        """Return the effects for which no other names would do, with their values."""
        assert self.first.found is not None
        asked = {s.effect for s in self.sets}
        values = self.first.found.final.values
        names = [effect["name"] for effect in self.first.verdict.effects]
        return {name: dict(values.get(name, {})) for name in names if name not in asked}

    def content(self) -> dict[str, Any]:
        """Return plain data of ``investigation.json``."""
        return {
            "verdict": self.first.verdict.verdict,
            "rig": None if self.rig is None else self.rig.title,
            "names": self.names,
            "ended": self.ended,
            "sets": [
                {
                    "effect": s.effect,
                    "names": s.names,
                    "left": s.left,
                    "together": s.together,
                    "excess": s.excess,
                    "half_bic_above_best": s.evidence,
                    "standard_errors_above_likeliest": s.above_likeliest,
                    "excess_without": s.without,
                }
                for s in self.sets
            ],
            "rounds": [vars(r) for r in self.rounds],
            "together": self.together,
            "models": self.models,
            "parameters_of": f"{FIRST_FOLDER}/model.yaml",
            "parameters": self.first.verdict.parameters,
        }

    def save(self, out: Path) -> None:
        """Write ``investigation.json``, and what all recordings together say into a folder of its
        own.
        """
        if self.found is not None:
            self.found.save(out / TOGETHER_FOLDER)
        text = json.dumps(self.content(), indent=1, default=float)
        (out / "investigation.json").write_text(joint_in_force().in_units(text) + "\n")


def investigate(
    source: Recording | str | Path,
    conduct: Conduct,
    out: str | Path,
    rounds: int = 3,
    library: Sequence[str] | None = None,
    progress: Progress = lambda _: None,
    rig: RigFile | None = None,
) -> Investigation:
    """Find out which names of a recording's effects are right.

    Parameters
    ----------
    source
        The first recording, or its bag.
    conduct
        Makes a recording of a designed movement.
    out
        Folder; gets ``first`` (the diagnosis), a design for each round, ``together`` (the models of
        all recordings, where there are several), and the story.
    rounds
        Recordings at most.
    library
        Terms that may be named; None for all.
    progress
        Called with one line for each step.
    rig
        The calibrated rig of all recordings, which is taken as known.

    Raises
    ------
    BagError
        No such bag.
    DiagnosisError
        The first recording cannot be used.
    """
    recording = source if isinstance(source, Recording) else Recording.from_bag(source)
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    first = diagnose(recording, folder / FIRST_FOLDER, library=library, progress=progress, rig=rig)
    if first.verdict.verdict == "bad_recording":
        raise DiagnosisError(f"{recording.name} cannot be used: {first.verdict.reasons[0]}")
    story = Investigation(first, open_sets(first), recordings=[recording], rig=rig)
    asks = True
    while asks:
        story.ended = ""
        while not story.ended:
            story.ended = _next_round(story, conduct, folder, rounds, progress)
        asks = _search_together(story, library, progress) and _may_go_on(story, rounds)
    story.together += settle_doubts(story.sets)
    story.ended = _ending(story, rounds)
    story.save(folder)
    return story


def _ending(story: Investigation, rounds: int) -> str:
    """Return why the investigation ended, in one sentence, once all recordings were searched
    together: this may have changed what the last round left.
    """
    if not story.sets or (story.rounds and story.rounds[-1].duration == 0.0):
        return story.ended
    if any(one.open for one in story.sets) or not story.names:
        return _spent(rounds) if len(story.rounds) >= rounds else story.ended
    if any(one.withdrawn for one in story.sets):
        return "Each effect that is left has one name."
    return ONE_NAME_EACH


def _spent(rounds: int) -> str:
    return f"The budget of {rounds} recording{'s' if rounds > 1 else ''} is spent."


def _search_together(
    story: Investigation, library: Sequence[str] | None, progress: Progress
) -> bool:
    """Search all recordings together, where there are new ones, and return whether this leaves
    something to ask: a set is open, or was withdrawn and nothing explains the recordings.
    """
    if len(story.recordings) == story.searched:
        return False
    progress("all recordings together")
    story.searched = len(story.recordings)
    assert story.first.problem is not None
    reading = story.first.problem.reading
    judged = judge_together(
        story.sets, story.recordings, library, progress, story.beside, story.rig, reading
    )
    story.together, story.found = judged.sentence, judged.found
    withdrawn = any(one.withdrawn for one in story.sets)
    unexplained = judged.found is not None and judged.found.verdict == "unexplained"
    return judged.asks or (withdrawn and (unexplained or not story.names))


def _may_go_on(story: Investigation, rounds: int) -> bool:
    """Say whether the budget and the operator allow another recording."""
    return len(story.rounds) < rounds and story.rounds[-1].duration > 0.0


def _next_round(
    story: Investigation, conduct: Conduct, folder: Path, rounds: int, progress: Progress
) -> str:
    """Run one round; why the investigation ends, empty where it goes on."""
    if not story.sets:
        return "The first recording left no rivals: there was nothing to ask."
    unsettled = [s for s in story.sets if s.open]
    missing = [] if unsettled else [s for s in story.sets if s.withdrawn]
    if not unsettled and not missing:
        return ONE_NAME_EACH
    if missing and not any(len(s.models) > 1 for s in missing):
        return "No name is left to ask about."
    number = len(story.rounds) + 1
    if number > rounds:
        return _spent(rounds)
    if missing and len(story.recordings) > story.searched:
        return "All recordings are searched together."
    progress(f"round {number}: designing")
    design = _design(story, unsettled or missing, folder, number, progress)
    best = design.proposals[0] if design.proposals else None
    decides = best is not None and _may_decide(unsettled, best, rounds - len(story.rounds))
    # Though no movement tells them apart, another one shows whether they hold at all.
    first = len(story.recordings) == story.searched
    if best is None or not (decides or first or missing):
        return design.sentence
    duration = float(np.clip(60.0 * best.minutes, SHORTEST_S, LONGEST_S))
    if missing:
        question = f"What is there, where {_none_of(missing)}"
    else:
        question = "; ".join(" or ".join(s.left).replace("_", " ") for s in unsettled)
    proposal = design.sentence
    if best.excess < RIVAL_EXCESS and not missing:
        proposal += (
            " All recordings together may."
            if decides
            else f" It is recorded all the same: it shows whether {_any_of(unsettled)} at all."
        )
    round_ = Round(question, proposal, best.candidate.title, 0.0, "")
    story.rounds.append(round_)
    recording = conduct(best.candidate, duration, number)
    if recording is None:
        round_.answer = "The operator did not consent; nothing was recorded."
        return round_.answer
    round_.duration = recording.duration
    reasons = faults(recording)
    if reasons:
        round_.answer = f"The recording cannot be used: {reasons[0]}."
        return ""
    progress(f"round {number}: judging {recording.name}")
    round_.answer = (
        judge_alone(unsettled, recording, story.rig, story.first.problem)
        if unsettled
        else "It is searched together with the other recordings."
    )
    round_.judged = True
    story.recordings.append(recording)
    return ""


def _none_of(sets: Sequence[OpenSet]) -> str:
    """Return a clause about the names of sets that were withdrawn."""
    names = dict.fromkeys(name for one in sets for name in one.models)
    return f"none of {', '.join(names)} holds".replace("_", " ")


def _any_of(sets: Sequence[OpenSet]) -> str:
    """Return the subject and verb of a sentence about the names of all sets."""
    names = {name for one in sets for name in one.left}
    return "either holds" if len(names) == 2 else "any of them holds"


def _may_decide(sets: list[OpenSet], best: Proposal, recordings: int) -> bool:
    """Say whether so many more recordings are expected to exclude a name of a pair, together with
    what the recordings so far have against it.

    White residuals and a true model put the wrong one ``sqrt(misfit) / 2`` standard errors above
    it, and the squares of what independent recordings say add up.
    """
    minutes = recordings * LONGEST_S / 60.0
    return any(
        one.apart(*sorted((a, b), key=lambda name: -one.evidence.get(name, 0.0))) ** 2
        + 0.25 * minutes * best.misfit_of(a, b)
        > LEAST_APART**2
        for one in sets
        for a, b in combinations(one.left, 2)
        if (a, b) in best.pairs and (b, a) in best.pairs
    )


def _design(
    story: Investigation,
    asked: Sequence[OpenSet],
    folder: Path,
    number: int,
    progress: Progress,
) -> Design:
    """Return a design that tells the names apart that are left, or that stood in for an effect in a
    set that was withdrawn; written to a folder of its own.
    """
    sets = []
    for one in asked:
        names = one.left or list(one.models)
        if len(names) < 2:
            continue
        known = (max(one.excess[n]) for n in names[1:] if n in one.excess)
        sets.append(RivalSet({name: one.model(name) for name in names}, min(known, default=0.0)))
    made = [r.title for r in story.rounds if r.judged]
    design = Design(sets, rank(sets, story.first.verdict.recording, progress, made), [])
    design.save(folder / f"design_{number}")
    return design
