"""Verdicts counted on the independent rig: recordings without any mismatch and with one effect.

Servo stiff or compliant, a reflex that varies from stretch to stretch, tremor, with and without a
velocity channel: what every laboratory and every subject has, and what is no mismatch. Example:
``python -m simulation_study.verdict_study --nulls 24 --effects 24 --seed 1 --out docs/results``.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import beta

from ankle_physics.term import term_library
from blind_rig import effects
from blind_rig.impedance import TrueImpedance, true_impedance
from blind_rig.magnitudes import brought_in
from blind_rig.protocols import PROTOCOLS, Protocol
from blind_rig.subjects import OPERATING_ANGLE, draw_subject
from blind_rig.trial import Trial, record, run
from model_discrepancy.diagnose import diagnose
from model_discrepancy.recording.recording import Recording
from model_discrepancy.report.verdict import Verdict
from simulation_study.blind.acceptance import ANSWERS

DURATION_S = 60.0
RATE_HZ = 1000.0
# A servo gives way by some per cent of the movement on an ankle of 100 N.m/rad.
SERVO_STIFFNESS = (2000.0, 3000.0)
SERVO_HZ = (35.0, 60.0)
# Usual variability of a subject at rest.
REFLEX_VARIATION = (0.1, 0.3)
TREMOR_RMS = (0.0, 0.2)
# From here on a name is stated with confidence.
MIN_STATED_PROBABILITY = 0.7
# Answers to these are verdicts, signal findings or variability and no names of terms.
EXCLUDED_EFFECTS = frozenset({"tremor", "position_gain", "encoder_play"})


@dataclass(frozen=True)
class Case:
    """Holds one recording and what was found in it."""

    effect: str
    servo: str
    protocol: str
    velocity: bool
    verdict: Verdict
    truth: TrueImpedance
    seconds: float

    @property
    def confident(self) -> list[str]:
        """Names that are stated with 0.7 or more."""
        return [
            e["name"] for e in self.verdict.effects if e["probability"] >= MIN_STATED_PROBABILITY
        ]

    @property
    def right_names(self) -> tuple[str, ...]:
        """Names that answer the hidden effect; none for a null or an unknown effect."""
        return ANSWERS[self.effect].names if self.effect in ANSWERS else ()

    @property
    def family_found(self) -> bool:
        """Say whether a stated effect is of the family of a right answer."""
        families = {_family(name) for name in self.right_names}
        return any(_family(e["name"]) in families for e in self.verdict.effects)

    @property
    def exact(self) -> bool:
        """Say whether the most probable effect is a right answer."""
        stated = sorted(self.verdict.effects, key=lambda e: -e["probability"])
        return bool(stated) and stated[0]["name"] in self.right_names

    def score_of(self, key: str, true: float) -> tuple[float, float] | None:
        """Return relative error and standard score of K or G; None for a bad recording."""
        entry = self.verdict.parameters.get(key)
        if entry is None or not entry["standard_error"]:
            return None
        error = entry["augmented"] - true
        return error / true, error / entry["standard_error"]


def _family(name: str) -> str:
    terms = term_library()
    return terms[name].family or name if name in terms else name


def cases(nulls: int, planted: int, seed: int) -> Iterator[Case]:
    """Simulate and diagnose, one after the other."""
    generator = np.random.default_rng(seed)
    names = [
        e.name
        for e in (*effects.KNOWN_EFFECTS, *effects.UNKNOWN_EFFECTS)
        if e.name not in EXCLUDED_EFFECTS
    ]
    hidden = [str(n) for n in generator.permutation(names)]
    wanted = [""] * nulls + [hidden[k % len(hidden)] for k in range(planted)]
    for number, effect in enumerate(wanted):
        yield _case(effect, number, np.random.default_rng([seed, number]))


def _case(effect: str, number: int, generator: np.random.Generator) -> Case:
    compliant = number % 2 == 1
    velocity = bool(generator.random() < 0.5)
    known = effects.BY_NAME.get(effect)
    kinds = list(known.protocols) if known and known.protocols else list(PROTOCOLS)
    kind = str(generator.choice(kinds))
    changes = {
        "courses.stretch_variation": float(generator.uniform(*REFLEX_VARIATION)),
        "courses.tremor_rms": float(generator.uniform(*TREMOR_RMS)),
    }
    if compliant:
        changes["rig.servo_k"] = float(generator.uniform(*SERVO_STIFFNESS))
        changes["rig.servo_hz"] = float(generator.uniform(*SERVO_HZ))
    protocol = Protocol(kind, float(generator.uniform(0.03, 0.045)), 0.024, DURATION_S)
    trial = Trial(
        draw_subject(generator).replaced(changes),
        protocol,
        RATE_HZ,
        float(generator.uniform(*OPERATING_ANGLE)),
        int(generator.integers(2**62)),
    )
    if effect:
        trial = brought_in(trial, effect, "moderate")
    done = run(trial)
    made = record(trial, done)
    recording = Recording(
        RATE_HZ,
        made.position,
        made.torque,
        made.velocity if velocity else None,
        made.reference[:, 0],
        name=f"case {number}",
    )
    begun = time.process_time()
    verdict = diagnose(recording).verdict
    truth = true_impedance(trial, done)
    servo = "compliant" if compliant else "stiff"
    return Case(effect, servo, kind, velocity, verdict, truth, time.process_time() - begun)


def rate_with_interval(hits: int, of: int) -> str:
    """Return a share with its 95 % interval (Clopper & Pearson 1934) in words."""
    if of == 0:
        return "none"
    low = float(beta.ppf(0.025, hits, of - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, of - hits)) if hits < of else 1.0
    return f"{hits} of {of} ({100 * hits / of:.0f} %, {100 * low:.0f} to {100 * high:.0f} %)"


def table(done: list[Case]) -> list[tuple[str, str]]:
    """Return every count with its interval."""
    empty = [c for c in done if not c.effect]
    known = [c for c in done if c.right_names]
    foreign = [c for c in done if c.effect and not c.right_names]
    lines = []
    for servo in ("stiff", "compliant"):
        own = [c for c in empty if c.servo == servo]
        wrong = sum(c.verdict.verdict != "no_mismatch" for c in own)
        lines.append((f"false alarms, {servo} servo", rate_with_interval(wrong, len(own))))
    named = [(c, name) for c in done for name in c.confident]
    wrong = sum(name not in c.right_names for c, name in named)
    lines += [
        ("names stated with 0.7 or more that are wrong", rate_with_interval(wrong, len(named))),
        (
            "moderate effects: family",
            rate_with_interval(sum(c.family_found for c in known), len(known)),
        ),
        ("moderate effects: exact", rate_with_interval(sum(c.exact for c in known), len(known))),
        (
            "unknown effects called unexplained",
            rate_with_interval(
                sum(c.verdict.verdict == "unexplained" for c in foreign), len(foreign)
            ),
        ),
        (
            "good recordings called bad",
            rate_with_interval(sum(c.verdict.verdict == "bad_recording" for c in done), len(done)),
        ),
    ]
    for key, symbol in (("K[N.m/rad]", "K"), ("G[N.m.s/rad]", "G")):
        scores = [s for c in done if (s := c.score_of(key, float(getattr(c.truth, symbol))))]
        within = rate_with_interval(sum(abs(z) <= 2.0 for _, z in scores), len(scores))
        middle = 100 * float(np.median([abs(e) for e, _ in scores])) if scores else math.nan
        lines += [
            (f"{symbol}: median error", f"{middle:.1f} %"),
            (f"{symbol} within two standard errors", within),
        ]
    middle = float(np.median([c.seconds for c in done]))
    return [*lines, ("processor time of a diagnosis, median", f"{middle:.0f} s")]


def report(done: list[Case], command: str) -> str:
    """Return the counts and every case, as Markdown."""
    head = [
        "# Verdicts on the independent rig",
        "",
        f"`{command}`",
        "",
        "| | counted (95 % interval) |",
        "| --- | --- |",
        *(f"| {name} | {value} |" for name, value in table(done)),
        "",
        "| hidden | servo | protocol | velocity | verdict | stated |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for c in done:
        stated = ", ".join(f"{e['name']} {e['probability']:.2f}" for e in c.verdict.effects)
        head.append(
            f"| {c.effect or 'nothing'} | {c.servo} | {c.protocol} | "
            f"{'yes' if c.velocity else 'no'} | {c.verdict.verdict} | {stated} |"
        )
    return "\n".join(head) + "\n"


def main() -> None:
    """Run the study and write its table, after every case again."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nulls", type=int, default=24)
    parser.add_argument("--effects", type=int, default=24)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    command = (
        f"python -m simulation_study.verdict_study --nulls {options.nulls} --effects "
        f"{options.effects} --seed {options.seed} --out {options.out}"
    )
    options.out.mkdir(parents=True, exist_ok=True)
    done: list[Case] = []
    for case in cases(options.nulls, options.effects, options.seed):
        done.append(case)
        print(f"{case.effect or 'nothing'}: {case.verdict.verdict} {case.confident}", flush=True)
        (options.out / "verdicts.md").write_text(report(done, command))


if __name__ == "__main__":
    main()
