"""Verdicts counted: recordings without mismatch, with one effect, with two, with what the library
lacks, and with a term or an effect of the rig planted in recorded human trials.

Example: ``python -m simulation_study.verdict_study --seed 1 --null 24 --effect 24 --out FOLDER``.
Results are appended to ``cases*.jsonl`` in the folder; an interrupted study goes on where it
stopped, and ``--part 1/2`` and ``--part 2/2`` share one study between two processes. Every run
writes ``verdicts.md`` from whatever cases are there.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ankle_physics.term import term_library
from model_discrepancy.diagnose import Diagnosis, diagnose
from simulation_study.blind.acceptance import ANSWERS
from simulation_study.human_trials import load_trial, trial_paths
from simulation_study.verdict_cases import IN_HUMAN_TRIALS, KINDS, Plan, made, plans
from simulation_study.verdict_report import report

# Option of the command by kind of case.
OPTIONS = {
    "--null": "null",
    "--effect": "effect",
    "--pair": "pair",
    "--foreign": "foreign",
    "--left-out": "left_out",
    "--planted": "planted",
    "--planted-from-rig": "planted_from_rig",
}


def families(names: list[str]) -> set[str]:
    """Return the families of these terms; a term without one is its own.

    Parameters
    ----------
    names
        Of terms or of what the signals themselves show.
    """
    terms = term_library()
    return {(terms[n].family or n) if n in terms else n for n in names}


def right_names(plan: Plan) -> list[list[str]]:
    """Return the names that answer each hidden effect; none where the library lacks it.

    Parameters
    ----------
    plan
        The case.
    """
    if plan.kind == "planted":
        return [list(plan.hidden)]
    if plan.kind in ("null", "foreign", "left_out"):
        return [[] for _ in plan.hidden]
    return [list(ANSWERS[name].names) for name in plan.hidden]


def library_of(plan: Plan) -> list[str] | None:
    """Return the terms that the diagnosis may name, without a family that is left out.

    Parameters
    ----------
    plan
        The case.
    """
    if plan.kind != "left_out":
        return None
    gone = families([n for hidden in plan.hidden for n in ANSWERS[hidden].names])
    return [n for n in term_library() if not families([n]) & gone]


def counted(plan: Plan, trials: Path | None) -> dict[str, Any]:
    """Make one case, diagnose it, and return what the study keeps of it.

    Parameters
    ----------
    plan
        The case.
    trials
        Folder of recorded human trials.
    """
    recording, truth, shares = made(plan, trials)
    begun = time.process_time()
    diagnosis = diagnose(recording, library=library_of(plan))
    seconds = time.process_time() - begun
    entry = {
        "case": plan.name,
        "plan": asdict(plan),
        "right": right_names(plan),
        "shares": shares,
        "seconds": round(seconds, 1),
        **outcome(diagnosis),
    }
    if truth is not None:
        entry["truth"] = {"K[N.m/rad]": truth.K, "G[N.m.s/rad]": truth.G}
    return entry


def outcome(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return what a study keeps of a diagnosis.

    Parameters
    ----------
    diagnosis
        Of any recording.
    """
    verdict, found = diagnosis.verdict, diagnosis.found
    kept: dict[str, Any] = {
        "verdict": verdict.verdict,
        "effects": [
            {
                key: e.get(key)
                for key in ("name", "stated", "probability", "family", "family_probability", "set")
            }
            for e in verdict.effects
        ],
        "fit": verdict.fit,
        "parameters": {k: verdict.parameters.get(k) for k in ("K[N.m/rad]", "G[N.m.s/rad]")},
        "variability": verdict.variability,
        "reasons": verdict.reasons,
    }
    if found is not None:
        kept["by_chance"] = found.by_chance
        kept["at_bounds"] = list(found.final.at_bounds)
        kept["near"] = [[t.name, t.gain, list(t.held_out), t.torque_share] for t in found.near]
    if diagnosis.criticism is not None:
        after = diagnosis.criticism.after
        kept["remainder"] = [after.share, after.by_chance, after.worst, after.torque_share]
    return kept


def read_cases(folder: Path) -> list[dict[str, Any]]:
    """Read the results in the order of the study; of a case that was run twice, the later one.

    Parameters
    ----------
    folder
        With ``cases*.jsonl``.
    """
    found = {}
    for file in sorted(folder.glob("cases*.jsonl")):
        for line in file.read_text().splitlines():
            entry = json.loads(line)
            found[entry["case"]] = entry
    return sorted(found.values(), key=lambda e: (KINDS.index(e["plan"]["kind"]), e["case"]))


def ordered(counts: dict[str, int], seed: int, trials: list[str]) -> list[Plan]:
    """Order every case of a study, all kinds in turn, so that an unfinished one holds some of each.

    Parameters
    ----------
    counts, seed, trials
        As `verdict_cases.plans`.
    """
    every = list(plans(counts, seed, trials))
    return sorted(every, key=lambda p: (p.number + 0.5) / counts[p.kind])


def run_part(todo: list[Plan], file: Path, trials: Path | None) -> Iterator[dict[str, Any]]:
    """Run these cases one after the other and append each to a file.

    Parameters
    ----------
    todo
        Cases.
    file
        Receives one line of JSON for each.
    trials
        Folder of recorded human trials.
    """
    for plan in todo:
        entry = counted(plan, trials)
        with file.open("a") as stream:
            stream.write(json.dumps(entry, default=float) + "\n")
        yield entry


def shown_by_trials(trials: Path, file: Path) -> dict[str, list[str]]:
    """Return the names that each recorded trial shows without anything planted, and keep them.

    Parameters
    ----------
    trials
        Folder of recorded human trials.
    file
        JSON; what it holds already is not diagnosed again.
    """
    if not file.exists():
        shown = {
            path.stem: [e["name"] for e in diagnose(load_trial(path)).verdict.effects]
            for path in trial_paths(trials)
        }
        file.write_text(json.dumps(shown, indent=2) + "\n")
    return dict(json.loads(file.read_text()))


def main() -> None:
    """Run the study and write its table, after every case again."""
    parser = argparse.ArgumentParser(description=__doc__)
    for option, kind in OPTIONS.items():
        parser.add_argument(option, type=int, default=0, dest=kind, help="so many of this kind")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--trials", type=Path, help="folder of recorded human trials")
    parser.add_argument("--part", default="1/1", help="k/n: every n-th case, beginning at the k-th")
    options = parser.parse_args()
    counts = {kind: getattr(options, kind) for kind in KINDS}
    names = [path.stem for path in trial_paths(options.trials)] if options.trials else []
    for option, kind in OPTIONS.items():
        if kind in IN_HUMAN_TRIALS and counts[kind] and not names:
            parser.error(f"{option} needs --trials, a folder as `ankle fetch-trials` writes it")
    part, of = (int(word) for word in options.part.split("/"))
    given = " ".join(f"{option} {counts[k]}" for option, k in OPTIONS.items() if counts[k])
    command = f".venv/bin/python -m simulation_study.verdict_study --seed {options.seed} {given}"
    options.out.mkdir(parents=True, exist_ok=True)
    done = {entry["case"] for entry in read_cases(options.out)}
    todo = [p for p in ordered(counts, options.seed, names)[part - 1 :: of] if p.name not in done]
    file = options.out / f"cases-{part}.jsonl"
    planted = any(counts[kind] for kind in IN_HUMAN_TRIALS)
    shown = shown_by_trials(options.trials, options.out / "trials.json") if planted else {}

    def write() -> None:
        (options.out / "verdicts.md").write_text(report(read_cases(options.out), command, shown))

    for entry in run_part(todo, file, options.trials):
        stated = ", ".join(f"{e['stated']} {e['probability']}" for e in entry["effects"])
        print(f"{entry['case']}: {entry['verdict']} {stated} ({entry['seconds']} s)", flush=True)
        write()
    write()


if __name__ == "__main__":
    main()
