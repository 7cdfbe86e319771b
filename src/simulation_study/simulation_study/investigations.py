"""Whether an investigation finds the right name of an open set.

Example: ``python -m simulation_study.investigations --seed 1 --cases 54 --out FOLDER``. Each case
is a recording of the independent rig with one hidden effect. Where its diagnosis leaves rivals,
`investigate` designs further recordings and the same rig and subject make them, until one name is
left. Results are appended to ``results*.jsonl``; an interrupted run goes on where it stopped,
``--part 1/2`` and ``--part 2/2`` share one study between two processes, and every run writes
``investigations.md`` from whatever results are there.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from blind_rig.trial import run
from model_discrepancy.report.investigation_report import write_investigation
from model_discrepancy.tools.investigation import investigate
from simulation_study.independent_conduct import IndependentConduct
from simulation_study.verdict_cases import Plan, plans, recorded, trial_of
from simulation_study.verdict_report import rate_with_interval
from simulation_study.verdict_study import right_names

# Recordings after the first one, at most: as many as `investigate` makes unless told otherwise.
ROUNDS = 3
Entry = dict[str, Any]


def run_case(plan: Plan, out: Path) -> Entry:
    """Investigate one case.

    Parameters
    ----------
    plan
        From `verdict_cases.plans`.
    out
        Folder of the study; the story of an open set is kept there.
    """
    trial, shares = trial_of(plan)
    first = recorded(plan, trial, run(trial))
    folder = out / plan.name
    story = investigate(first, IndependentConduct(plan, trial), folder, ROUNDS)
    write_investigation(story, folder / "report.html")
    return {
        "case": plan.name,
        "hidden": plan.hidden[0],
        "protocol": plan.protocol,
        "share": shares[plan.hidden[0]],
        "right": right_names(plan)[0],
        "verdict": story.first.verdict.verdict,
        "sets": [s.names for s in story.sets],
        "left": [s.left for s in story.sets],
        "names": story.names,
        "together": story.together,
        "recordings": [r.title for r in story.rounds if r.duration > 0.0],
        "ended": story.ended,
        "answers": [r.answer for r in story.rounds],
    }


def outcome(names: list[str], left: list[str], right: list[str]) -> str:
    """Return what became of a set, in words.

    Parameters
    ----------
    names, left
        Of the set, before and after.
    right
        Names that answer the hidden effect.
    """
    if left and set(left) <= set(right):
        return "right"
    if set(left) & set(right):
        return "open"
    if not left and not set(names) & set(right):
        return "withdrawn"
    return "wrong" if set(names) & set(right) else "wrong, as it was from the first"


def names_in_the_end(entry: Entry) -> str:
    """Return what an investigation says of its recording in the end, in words: the names of all its
    effects, whatever set they were in.

    Parameters
    ----------
    entry
        A case of which at least one set was open.
    """
    names = {name for effect in entry["names"] for name in effect.split("/")}
    if not names:
        return "none"
    if names <= set(entry["right"]):
        return "right"
    return "both" if names & set(entry["right"]) else "wrong"


def report(entries: list[Entry], command: str) -> str:
    """Return the counts and every open set, as Markdown.

    Parameters
    ----------
    entries
        Cases.
    command
        With which they are made again.
    """
    rows = [
        (entry, names, left, outcome(names, left, entry["right"]))
        for entry in entries
        for names, left in zip(entry["sets"], entry["left"], strict=True)
    ]
    holding = [row for row in rows if set(row[1]) & set(row[0]["right"])]
    before = sum(set(row[1]) <= set(row[0]["right"]) for row in holding)

    def count(word: str, among: list[tuple[Entry, list[str], list[str], str]]) -> str:
        return rate_with_interval(sum(row[3].startswith(word) for row in among), len(among))

    asked = [names_in_the_end(entry) for entry in entries if entry["sets"]]

    def count_asked(word: str) -> str:
        return rate_with_interval(asked.count(word), len(asked))

    lines = [
        "# Investigations of ambiguous recordings",
        "",
        f"`{command} --out FOLDER`: {len(entries)} recordings of the independent rig with one "
        f"effect each; of the open sets at most {ROUNDS} further recordings are made.",
        "",
        "| | counted (95 % interval) |",
        "| --- | --- |",
        f"| sets of names that the first recording left open | {len(rows)} |",
        f"| of these, the right name was in it | {rate_with_interval(len(holding), len(rows))} |",
        f"| every name was right from the first | {rate_with_interval(before, len(rows))} |",
        f"| only right names are left in the end | {count('right', rows)} |",
        f"| right and wrong names are left | {count('open', rows)} |",
        f"| withdrawn, and no right name was in it | {count('withdrawn', rows)} |",
        f"| wrong names are left, or a right one was withdrawn | {count('wrong', rows)} |",
        f"| of the sets that held the right name: only right names are left | "
        f"{count('right', holding)} |",
        f"| wrong names are left, or it was withdrawn | {count('wrong', holding)} |",
        "",
        "What an investigation says in the end is the names of all effects that its first "
        "recording named, as far as they are left: one hidden effect may have opened two sets, or "
        "a set beside a name that was settled from the first.",
        "",
        "| | counted (95 % interval) |",
        "| --- | --- |",
        f"| recordings that left a set open | {len(asked)} |",
        f"| only right names are left of all their effects | {count_asked('right')} |",
        f"| right and wrong names are left | {count_asked('both')} |",
        f"| no name is left | {count_asked('none')} |",
        f"| only wrong names are left | {count_asked('wrong')} |",
        "",
        "| hidden (share of the torque's variance) | protocol | open set | left | further "
        "recordings | outcome |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for entry, names, left, became in rows:
        lines.append(
            f"| {entry['hidden']} ({100 * entry['share']:.1f} %) | {entry['protocol']} | "
            f"{', '.join(names)} | {', '.join(left) or 'nothing'} | "
            f"{'; '.join(entry['recordings']) or 'none'} "
            f"| {became} |"
        )
    return "\n".join(lines) + "\n"


def read_results(folder: Path) -> list[Entry]:
    """Read the results of a study, in the order of its cases.

    Parameters
    ----------
    folder
        With ``results*.jsonl``.
    """
    lines = [
        line for file in folder.glob("results*.jsonl") for line in file.read_text().splitlines()
    ]
    return sorted((json.loads(line) for line in lines), key=lambda entry: entry["case"])


def main() -> None:
    """Investigate every case that has no result yet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--cases", type=int, default=54)
    parser.add_argument("--part", default="1/1", help="k/n: every n-th case, beginning at the k-th")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    part, of = (int(word) for word in options.part.split("/"))
    command = (
        ".venv/bin/python -m simulation_study.investigations "
        f"--seed {options.seed} --cases {options.cases}"
    )
    done = {entry["case"] for entry in read_results(options.out)}
    every = list(plans({"effect": options.cases}, options.seed))
    for plan in every[part - 1 :: of]:
        if plan.name in done:
            continue
        found = run_case(plan, options.out)
        with (options.out / f"results-{part}.jsonl").open("a") as file:
            file.write(json.dumps(found, default=float) + "\n")
        print(
            f"{found['case']}: {found['verdict']}, {found['sets']} -> {found['left']}", flush=True
        )
        (options.out / "investigations.md").write_text(report(read_results(options.out), command))


if __name__ == "__main__":
    main()
