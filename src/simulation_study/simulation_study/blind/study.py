"""The blind study: make and seal all cases, print the seal, diagnose without sight of the truth,
open, verify, score.

Folder of a study::

    study.json            what was asked for
    commitments.json      hash of each case's truth, and the root over them
    bags/CASE/            what the diagnosis sees
    verdicts/CASE/        log, time, and what the diagnosis wrote
    result.md, result.json, confusion.png

The commitments are written before the first diagnosis. The truths lie in another folder (`seal`). A
finished step is never done twice: an interrupted study goes on when it is started again with the
same arguments.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

import blind_rig
from blind_rig.bag import fingerprint
from blind_rig.cases import Plan, make_case, plan_cases
from simulation_study.blind import concealment
from simulation_study.blind.diagnosis import RUN_FILE, diagnose_case, is_diagnosed, read_verdict
from simulation_study.blind.report import write_report
from simulation_study.blind.scoring import CaseScore, score_case, summarise
from simulation_study.blind.seal import Seal, SealError, commitment, root
from simulation_study.study_folder import StudyError, settle
from simulation_study.study_workers import spread

# Five times what a diagnosis of the longest bag may take.
TIME_LIMIT = 600.0


def _commit(out: Path, commitments: dict[str, str]) -> str:
    """Publish the commitments, or check that they are those that were published."""
    file, whole = out / "commitments.json", root(commitments)
    if file.exists():
        published = json.loads(file.read_text())
        if published["root"] != whole or published["cases"] != commitments:
            raise SealError(
                f"the sealed truths hash to {whole}, but {published['root']} was announced"
            )
    else:
        file.write_text(json.dumps({"root": whole, "cases": commitments}, indent=1))
    return whole


def _hidden_folders(truth: Path, console: Console) -> list[Path]:
    """Return folders that the diagnosis will not see; none where this machine cannot hide them."""
    hidden = [truth, Path(__file__).resolve().parent, Path(blind_rig.__file__).resolve().parent]
    truth.mkdir(parents=True, exist_ok=True, mode=0o700)
    if concealment.interface_version() and concealment.works(hidden):
        console.print(
            "Concealed by the kernel (Landlock): the diagnosis can read neither the truth nor "
            "this engine's code."
        )
        return hidden
    console.print(
        "This machine cannot hide folders from a process (no Landlock). The truths are encrypted "
        "with a key that only this process "
        "holds: they stay secret, but an interrupted study cannot go on."
    )
    return []


def blind(
    n_cases: int,
    seed: int,
    out: Path | str,
    diagnose_command: list[str],
    workers: int = 1,
    *,
    truth: Path | str | None = None,
    scheduler: str | None = None,
    time_limit: float = TIME_LIMIT,
    console: Console | None = None,
) -> dict[str, Any]:
    """Run a blind study, or go on with an interrupted one.

    Parameters
    ----------
    n_cases, seed
        Of the cases (`cases.plan_cases`).
    out
        Folder of the study.
    diagnose_command
        Words of the command that diagnoses; ``{bag}`` and ``{out}`` are replaced.
    workers
        Processes on this machine; without meaning where `scheduler` is given.
    truth
        Folder of the sealed truths; by default beside `out`, named ``OUT_truth``.
    scheduler
        Address of a running Dask scheduler whose workers see the same folders.
    time_limit
        For one diagnosis [s].
    console
        Where progress is shown; the terminal where None.

    Returns
    -------
    dict[str, Any]
        `scoring.summarise` with root hash, seed and how the truth was concealed; also in
        ``result.json``.

    Raises
    ------
    StudyError
        Another study or something else is in `out`, or the truth would lie in it.
    SealError
        A truth or a bag was changed since it was sealed.
    """
    console = console or Console()
    out = Path(out).resolve()
    truth = Path(truth).resolve() if truth is not None else out.with_name(out.name + "_truth")
    _require_usable(out, truth, diagnose_command)
    plans = plan_cases(n_cases, seed)
    settle(out, {"cases": n_cases, "seed": seed, "command": diagnose_command})
    hidden = _hidden_folders(truth, console)
    seal = Seal(truth, store_key=bool(hidden))

    commitments = seal.sealed()
    for name, secret in spread(
        make_case,
        _unmade(plans, commitments, out),
        len(commitments),
        "making cases",
        workers,
        scheduler,
        console,
    ):
        commitments[name] = seal.close(name, secret)
    whole = _commit(out, commitments)
    console.print(f"Sealed: {n_cases} cases, root hash SHA-256 {whole}", soft_wrap=True)

    jobs = _undiagnosed(plans, diagnose_command, out, hidden, time_limit)
    for _ in spread(
        diagnose_case, jobs, n_cases - len(jobs), "diagnosing", workers, scheduler, console
    ):
        pass

    truths = {name: _opened(seal, name, commitments[name], out) for name in sorted(commitments)}
    console.print("Opened: every truth and every bag is the one that was sealed.")
    scores = _scores(truths, out)
    result = summarise(scores)
    result |= {"seed": seed, "root": whole, "concealed_by": "landlock" if hidden else "encryption"}
    result["diagnosis_seconds_median"] = _median_seconds(out, plans)
    write_report(out, result, scores, truths)
    console.print(f"Result: {out / 'result.md'}")
    return result


def _require_usable(out: Path, truth: Path, diagnose_command: list[str]) -> None:
    """Refuse folders in which a diagnosis would see the truth, and a command that sees no bag."""
    if truth == out or out in truth.parents or truth in out.parents:
        raise StudyError(f"the truth ({truth}) must lie apart from the study ({out})")
    if not any("{bag}" in word for word in diagnose_command) or not any(
        "{out}" in word for word in diagnose_command
    ):
        raise StudyError(
            f"the diagnosing command must say {{bag}} and {{out}}: {' '.join(diagnose_command)}"
        )


def _unmade(
    plans: list[Plan], commitments: dict[str, str], out: Path
) -> dict[str, tuple[Plan, Path]]:
    """Return jobs for the cases that are not sealed yet; bags of cases that were interrupted before
    their seal are made anew.
    """
    jobs = {}
    for plan in plans:
        if plan.name not in commitments:
            shutil.rmtree(out / "bags" / plan.name, ignore_errors=True)
            jobs[plan.name] = (plan, out / "bags" / plan.name)
    return jobs


def _undiagnosed(
    plans: list[Plan], command: list[str], out: Path, hidden: list[Path], time_limit: float
) -> dict[str, tuple[list[str], Path, Path, list[Path], float]]:
    """Return jobs for the cases that have no verdict yet."""
    return {
        plan.name: (
            command,
            out / "bags" / plan.name,
            out / "verdicts" / plan.name,
            hidden,
            time_limit,
        )
        for plan in plans
        if not is_diagnosed(out / "verdicts" / plan.name)
    }


def _opened(seal: Seal, name: str, committed: str, out: Path) -> dict[str, Any]:
    """Return the truth about a case, its hash and its bag's fingerprint verified."""
    salt, secret = seal.open(name, committed)
    if fingerprint(out / "bags" / name) != secret["fingerprint"]:
        raise SealError(f"the bag of {name} was changed after it was sealed")
    return {**secret, "salt": salt.hex(), "commitment": commitment(salt, secret)}


def _scores(truths: dict[str, dict[str, Any]], out: Path) -> list[CaseScore]:
    return [
        score_case(secret, *read_verdict(out / "verdicts" / name))
        for name, secret in truths.items()
    ]


def _median_seconds(out: Path, plans: list[Plan]) -> float:
    return float(
        np.median(
            [
                json.loads((out / "verdicts" / plan.name / RUN_FILE).read_text())["seconds"]
                for plan in plans
            ]
        )
    )
