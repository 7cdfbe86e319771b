"""Sealed cases: who gets which effect, how strong, on which protocol; the bag, and the truth about
it.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ankle_interfaces.errors import QuantityError
from blind_rig import effects, faults, strength
from blind_rig.bag import Contents, fingerprint, write_bag
from blind_rig.effects import Effect
from blind_rig.impedance import true_impedance
from blind_rig.protocols import PROTOCOLS, draw_protocol
from blind_rig.subjects import OPERATING_ANGLE, SAMPLING_RATES, draw_subject
from blind_rig.trial import Trial, record, run

# Shares of the kinds of cases; the rest hides one known effect.
NULLS, UNKNOWNS, FAULTS, PAIRS = 0.22, 0.13, 0.10, 0.12
# Moderate effects are what a laboratory meets and what is judged most.
STRENGTH_SHARES = {"weak": 0.25, "moderate": 0.5, "strong": 0.25}
# Draws of subject and protocol for an effect that does not show on the first: steps of one rise
# time hide a saturation.
DRAWS = 4
# An effect shows as wanted from this part of the wanted share on.
MIN_STRENGTH_SHARE = 0.5
# How often a laboratory stores a velocity, a reference, EMG.
WITH_VELOCITY, WITH_REFERENCE, WITH_EMG = 0.7, 0.75, 0.35


class Plan(NamedTuple):
    """Describes what a case is to hide; everything else follows from its seed.

    Attributes
    ----------
    name
        Says nothing about the contents.
    kind
        ``null``, ``known``, ``pair``, ``unknown`` or ``broken``.
    hidden
        Names of effects, or of the fault.
    strengths
        Of each effect.
    seed
        Of all that is drawn for the case.
    """

    name: str
    kind: str
    hidden: tuple[str, ...]
    strengths: tuple[str, ...]
    seed: int


def _deal(names: list[str], count: int, generator: np.random.Generator) -> list[str]:
    """Return `count` names, each as often as the others within one, in random order."""
    dealt: list[str] = []
    while len(dealt) < count:
        dealt += [names[i] for i in generator.permutation(len(names))]
    return dealt[:count]


def plan_cases(count: int, seed: int) -> list[Plan]:
    """Return plans of all cases of a study; the same for the same count and seed.

    Raises
    ------
    QuantityError
        Fewer than one case.
    """
    if count < 1:
        raise QuantityError(f"{count} cases; at least 1 is needed")
    generator = np.random.default_rng(np.random.SeedSequence(seed))
    shares = {"null": NULLS, "unknown": UNKNOWNS, "broken": FAULTS, "pair": PAIRS}
    kinds = [kind for kind, part in shares.items() for _ in range(round(part * count))]
    kinds += ["known"] * (count - len(kinds))
    known = _deal(
        [e.name for e in effects.KNOWN_EFFECTS],
        kinds.count("known") + 2 * kinds.count("pair"),
        generator,
    )
    unknown = _deal([e.name for e in effects.UNKNOWN_EFFECTS], kinds.count("unknown"), generator)
    fault = _deal(list(faults.FAULTS), kinds.count("broken"), generator)
    dealt: list[tuple[str, tuple[str, ...], tuple[str, ...]]] = []
    for kind in kinds:
        if kind == "null":
            hidden: tuple[str, ...] = ()
        elif kind == "broken":
            hidden = (fault.pop(),)
        elif kind == "unknown":
            hidden = (unknown.pop(),)
        elif kind == "known":
            hidden = (known.pop(),)
        else:
            first = known.pop()
            # Two of one place would be one effect with two names.
            other = next(
                (
                    i
                    for i in range(len(known))
                    if effects.EFFECTS_BY_NAME[known[i]].place
                    != effects.EFFECTS_BY_NAME[first].place
                ),
                0,
            )
            hidden = (first, known.pop(other))
        wanted = [
            str(s)
            for s in generator.choice(
                list(STRENGTH_SHARES), len(hidden), p=list(STRENGTH_SHARES.values())
            )
        ]
        dealt.append((kind, hidden, () if kind == "broken" else tuple(wanted)))
    order = generator.permutation(count)
    seeds = np.random.SeedSequence(seed).generate_state(count, np.uint64)
    plans = []
    for k, i in enumerate(order):
        kind, hidden, strengths = dealt[i]
        plans.append(Plan(f"case_{k:03d}", kind, hidden, strengths, int(seeds[k])))
    return plans


def _draw_trial(generator: np.random.Generator, hidden: tuple[str, ...]) -> Trial:
    """Return a trial without effects, under a protocol that shows what will be hidden in it."""
    kinds = set(PROTOCOLS)
    for name in hidden:
        kinds &= set(effects.EFFECTS_BY_NAME[name].protocols or PROTOCOLS)
    return Trial(
        draw_subject(generator),
        draw_protocol(generator, sorted(kinds)),
        float(generator.choice(SAMPLING_RATES)),
        float(generator.uniform(*OPERATING_ANGLE)),
        int(generator.integers(2**63)),
    )


def scaled_effect(
    trial: Trial, effect: Effect, wanted: str, generator: np.random.Generator
) -> tuple[dict[str, float], dict[str, Any]]:
    """Return the changes of the setup for an effect at a strength, and the truth about it.

    Parameters
    ----------
    trial
        Without the effect.
    effect
        What is hidden.
    wanted
        One of `strength.STRENGTHS`.
    generator
        Draws the effect's shape and variant.
    """
    shape, limits = effects.draw_shape(effect, generator)
    about: dict[str, Any] = {"name": effect.name, "place": effect.place, "wanted": wanted}
    if effect.levels:
        changes = {
            **shape,
            effect.magnitude: math.copysign(
                dict(zip(strength.STRENGTHS, effect.levels, strict=True))[wanted], limits[0]
            ),
        }
        about |= {"strength": wanted, "share": None, "target": None}
    else:
        scaled = strength.scale(trial, effect, shape, limits, strength.STRENGTHS[wanted])
        changes = scaled.changes
        about |= {
            "strength": strength.strength_of(scaled.share),
            "share": scaled.share,
            "target": scaled.target,
        }
    about["parameters"] = changes
    return changes, about


def shows(about: dict[str, Any]) -> bool:
    """Say whether an effect shows about as strongly as it was to.

    Parameters
    ----------
    about
        What `scaled_effect` tells of it.
    """
    return about["share"] is None or about["share"] >= MIN_STRENGTH_SHARE * about["target"]


def _hide(
    plan: Plan, generator: np.random.Generator
) -> tuple[Trial, dict[str, float], list[dict[str, Any]]]:
    """Return a trial without effects, the changes that bring the plan's effects in, and what the
    truth says about each.
    """
    for draw in range(DRAWS):
        trial = _draw_trial(generator, plan.hidden)
        changes: dict[str, float] = {}
        hidden: list[dict[str, Any]] = []
        for name, wanted in zip(plan.hidden, plan.strengths, strict=True):
            change, about = scaled_effect(trial, effects.EFFECTS_BY_NAME[name], wanted, generator)
            changes |= change
            hidden.append(about)
        if draw == DRAWS - 1 or all(shows(about) for about in hidden):
            break
    return trial, changes, hidden


def make_case(plan: Plan, bag: Path) -> dict[str, Any]:
    """Simulate a case, write its bag and return the truth about it.

    Returns
    -------
    dict[str, Any]
        JSON-ready: kind, effects with reached strengths and parameters, base parameters, protocol,
        what the bag holds, and the bag's fingerprint.

    Raises
    ------
    FloatingPointError
        The simulation diverged.
    """
    generator = np.random.default_rng(plan.seed)
    changes: dict[str, float]
    hidden: list[dict[str, Any]]
    if plan.kind == "broken":
        trial, changes, hidden = _draw_trial(generator, ()), {}, [{"name": plan.hidden[0]}]
    else:
        trial, changes, hidden = _hide(plan, generator)
    contents = Contents(
        *(bool(generator.random() < chance) for chance in (WITH_VELOCITY, WITH_REFERENCE, WITH_EMG))
    )
    needed = {
        column
        for name in plan.hidden
        if name in effects.EFFECTS_BY_NAME
        for column in effects.EFFECTS_BY_NAME[name].needs
    }
    if "position_sign" in plan.hidden:
        # A tachometer is its own channel: without it a wrong sign of the angle is a wrong sign of
        # the torque.
        needed.add("velocity")
    contents = contents._replace(**dict.fromkeys(needed, True))
    base = trial.setup
    done = trial._replace(setup=base.replaced(changes))
    ran = run(done)
    recording = record(done, ran)
    true = true_impedance(done, ran)
    if plan.kind == "broken":
        recording = faults.broken(recording, plan.hidden[0], generator)
    write_bag(bag, recording, trial.rate, contents)
    return {
        "case": plan.name,
        "kind": plan.kind,
        "effects": hidden,
        "base": {
            "I[kg.m^2]": true.I,
            "B[N.m.s/rad]": true.B,
            "K[N.m/rad]": true.K,
            "G[N.m.s/rad]": true.G,
            "delay[s]": base.reflex.delay,
        },
        "setup": done.setup.as_dict(),
        "protocol": trial.protocol._asdict(),
        "rate[Hz]": trial.rate,
        "operating_angle[rad]": trial.operating_angle,
        "bag": contents._asdict(),
        "seed": plan.seed,
        "fingerprint": fingerprint(bag),
    }
