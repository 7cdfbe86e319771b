"""What several recordings of one rig or one subject show together, and in which of them."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ankle_physics.joint_profile import joint_in_force
from ankle_physics.term import Owner, term_library
from model_discrepancy.criticism.remainder import Remainder
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.held_out import HeldOut
from model_discrepancy.problem import Problem
from model_discrepancy.report.fitted_model import fitted_model
from model_discrepancy.search.exchange import RIVAL_EXCESS
from model_discrepancy.search.found import REFINEMENT
from model_discrepancy.search.null import Null

# Values of a rig's term differ between recordings where Q is that improbable. Standard errors of a
# fit are good to some ten per cent, so that a milder limit would call every rig unsteady.
LEAST_PROBABILITY_SAME = 1e-3
# One value for all recordings may leave so much more whitened error in one of them: as much as
# excludes a name. Where values differ though their errors are large, the errors are wrong.
LARGEST_SHARED_EXCESS = RIVAL_EXCESS


@dataclass
class Member:
    """Holds one of several recordings on its way through the search.

    Attributes
    ----------
    problem
        Its rows, noise and base model.
    null
        Surrogates of its noise.
    fit
        The present model.
    """

    problem: Problem
    null: Null
    fit: Fit
    final: HeldOut | None = None
    base: HeldOut | None = None
    after: Remainder | None = None

    @property
    def name(self) -> str:
        """Return the name of the recording."""
        return self.problem.recording.name


@dataclass(frozen=True)
class SharedEffect:
    """Describes a term that several recordings need together.

    Attributes
    ----------
    name
        The term.
    belongs_to
        Rig or subject, by what the term says of itself.
    gain
        Share of the whitened error of all recordings that it takes off.
    values
        Value and standard error of each fitted parameter, by its key, one pair for each recording,
        before anything is shared.
    share
        Of the whitened error that all effects take off.
    probability_same
        Of differences as large as these between the recordings if all had the same values.
    excess
        Share by which one value for all raises the whitened error of a recording, the largest.
    """

    name: str
    belongs_to: Owner
    gain: float
    values: dict[str, list[tuple[float, float]]]
    share: float
    probability_same: float
    excess: float = 0.0

    @property
    def refines(self) -> bool:
        """Tell whether it takes off so little that it corrects the equation of a larger one."""
        return self.share < REFINEMENT

    @property
    def shared(self) -> bool:
        """Tell whether its values are held to be the same in all recordings."""
        return self.belongs_to is Owner.RIG and self.same

    @property
    def same(self) -> bool:
        """Tell whether the recordings may have the same values."""
        agree = self.probability_same > LEAST_PROBABILITY_SAME
        return agree and self.excess <= LARGEST_SHARED_EXCESS

    @property
    def sentence(self) -> str:
        """Say to whom it belongs and why, in plain words."""
        what = term_library()[self.name].sentence
        same = self.same
        odds = (
            f"p = {self.probability_same:.2g}"
            if self.excess <= LARGEST_SHARED_EXCESS
            else f"one value for all leaves {100 * self.excess:.0f} % more error in one of them"
        )
        if self.belongs_to is Owner.RIG:
            whose = (
                f"It is the rig's, and the same in all recordings ({odds})."
                if same
                else f"By its place it would be the rig's, but it differs between the recordings "
                f"({odds}): the rig was changed, or it is something of the subject."
            )
        else:
            whose = (
                f"It is the subject's, and did not change between the recordings ({odds})."
                if same
                else f"It is the subject's, and differs from recording to recording ({odds})."
            )
        return f"{what} {whose}"


@dataclass
class Together:
    """Holds what several recordings say together.

    Attributes
    ----------
    members
        One for each recording, with its final model.
    effects
        In the order in which they were found, those that refine others, too.
    by_chance
        Joint gain that each term must exceed, so that the library does not by chance.
    """

    members: list[Member]
    effects: list[SharedEffect] = field(default_factory=list)
    by_chance: dict[str, float] = field(default_factory=dict)

    @property
    def named(self) -> list[SharedEffect]:
        """Return the effects that are left out, without those that refine others."""
        return [effect for effect in self.effects if not effect.refines]

    @property
    def verdict(self) -> str:
        """Return ``no_mismatch``, ``explained`` or ``unexplained``, of all recordings."""
        if any(m.after is not None and m.after.significant for m in self.members):
            return "unexplained"
        return "explained" if self.effects else "no_mismatch"

    def content(self) -> dict[str, Any]:
        """Return plain data of ``verdict.json``."""
        return {
            "verdict": self.verdict,
            "joint": joint_in_force().name,
            "effects": [
                {
                    "name": effect.name,
                    "belongs_to": effect.belongs_to.value,
                    "shared": effect.shared,
                    "probability_same": round(effect.probability_same, 5),
                    "gain": round(effect.gain, 4),
                    "share": round(effect.share, 4),
                    "refines": effect.refines,
                    "parameters": {k: [list(v) for v in vs] for k, vs in effect.values.items()},
                    "sentence": effect.sentence,
                }
                for effect in self.effects
            ],
            "recordings": [
                {
                    "name": m.name,
                    "baseline_vaf_holdout": round(m.base.vaf, 2) if m.base else None,
                    "augmented_vaf_holdout": round(m.final.vaf, 2) if m.final else None,
                    "remaining_predictable_share": round(max(m.after.share, 0.0), 4)
                    if m.after
                    else None,
                }
                for m in self.members
            ],
        }

    def save(self, out: Path) -> None:
        """Write ``verdict.json`` and a model file for each recording."""
        out.mkdir(parents=True, exist_ok=True)
        text = json.dumps(self.content(), indent=1, default=float)
        (out / "verdict.json").write_text(joint_in_force().in_units(text) + "\n")
        for member in self.members:
            fitted_model(member.fit, f"{member.name}: fitted together with others").save(
                out / f"{member.name}.yaml"
            )
