"""Verdicts on recordings of a third engine: what is named, and what K and G are.

Example: ``python -m simulation_study.second_rig_study --seed 1 --out FOLDER``. The recordings are
those of `second_rig`: without a mismatch, with one effect, with two, and with physics that nobody
lists. Results are appended to ``results*.jsonl``; an interrupted study goes on where it stopped,
``--part 1/2`` and ``--part 2/2`` share one study between two processes, and every recording writes
``second_rig.md`` anew from whatever results are there.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from model_discrepancy.diagnose import diagnose
from model_discrepancy.recording.recording import Recording
from second_rig.draw import COUNTS, Case, draw_cases
from second_rig.recording import SECONDS, Recorded, record
from simulation_study.investigations import read_results
from simulation_study.second_rig_answers import answers_of
from simulation_study.second_rig_report import KINDS, QUANTITIES, Entry, report
from simulation_study.study_folder import StudyError, settle
from simulation_study.verdict_study import outcome

# Option of the command by kind of recording.
OPTIONS = {"base": "--base", "effect": "--effects", "pair": "--pairs", "unlisted": "--unlisted"}


def ordered(seed: int, counts: dict[str, int]) -> list[Case]:
    """Order the recordings of a draw, all kinds in turn, so that an unfinished study holds some of
    each.

    Parameters
    ----------
    seed
        Of the draw.
    counts
        Recordings of each kind.
    """
    return sorted(draw_cases(seed, counts), key=lambda c: (c.number + 0.5) / counts[c.kind])


def as_recording(case: Case, made: Recorded) -> Recording:
    """Return a recording as the diagnosis takes it.

    Parameters
    ----------
    case
        What was recorded.
    made
        What the laboratory stored.
    """
    return Recording(
        float(made.rate),
        made.position,
        made.torque,
        velocity=made.velocity,
        reference=made.reference,
        name=case.name,
    )


def truth_of(made: Recorded) -> dict[str, float]:
    """Return the K and G against which estimates are held.

    K is the tangent stiffness of the joint about the mean position, at the mean torque and in the
    middle of the recording. G is the impulse of the reflex' torque for each radian of stretch, all
    arcs to velocity together: the area of the impulse response where the reflex is linear. The
    product states both so. A threshold, a saturation or fading lowers that impulse, so that the
    slope of a part of the velocities would be another quantity.

    Parameters
    ----------
    made
        What the laboratory stored.
    """
    impedance = made.truth.impedance
    return {QUANTITIES["K"]: impedance.K, QUANTITIES["G"]: impedance.G_of_impulse}


def counted(case: Case, seconds: float = SECONDS) -> Entry:
    """Make a recording, diagnose it, and return what the study keeps of it.

    Parameters
    ----------
    case
        From `second_rig.draw.draw_cases`.
    seconds
        Length of the recording [s].
    """
    made = record(case, seconds)
    begun = time.process_time()
    diagnosis = diagnose(as_recording(case, made))
    return {
        "case": case.name,
        "kind": case.kind,
        "protocol": made.truth.laboratory["protocol"]["kind"],
        "servo": case.servo_stiffness,
        "right": answers_of(case.effects),
        "shares": {e.id: e.share_of_torque_variance for e in made.truth.effects},
        "truth": truth_of(made),
        "made": made.truth.content(),
        "seconds": round(time.process_time() - begun, 1),
        **outcome(diagnosis),
    }


def main() -> None:
    """Diagnose every recording that has no result yet, and write the table after each."""
    parser = argparse.ArgumentParser(description=__doc__)
    for kind, option in OPTIONS.items():
        words = f"recordings: {KINDS[kind]}"
        parser.add_argument(option, type=int, default=COUNTS[kind], dest=kind, help=words)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--part", default="1/1", help="k/n: every n-th case, beginning at the k-th")
    options = parser.parse_args()
    sizes = {kind: int(getattr(options, kind)) for kind in OPTIONS}
    try:
        settle(options.out, {"study": "second rig", "seed": options.seed, "counts": sizes})
    except StudyError as error:
        parser.error(str(error))
    part, of = (int(word) for word in options.part.split("/"))
    given = " ".join(f"{option} {sizes[kind]}" for kind, option in OPTIONS.items())
    command = f".venv/bin/python -m simulation_study.second_rig_study --seed {options.seed} {given}"

    def write() -> None:
        text = report(read_results(options.out), command)
        (options.out / "second_rig.md").write_text(text)

    done = {entry["case"] for entry in read_results(options.out)}
    todo = [c for c in ordered(options.seed, sizes)[part - 1 :: of] if c.name not in done]
    for number, case in enumerate(todo, start=1):
        entry = counted(case)
        with (options.out / f"results-{part}.jsonl").open("a") as file:
            file.write(json.dumps(entry, default=float) + "\n")
        said = ", ".join(f"{e['name']} {e['probability']}" for e in entry["effects"])
        progress = f"{number} of {len(todo)}: {case.name}: {entry['verdict']} {said}"
        print(f"{progress} ({entry['seconds']} s)", flush=True)
        write()
    write()


if __name__ == "__main__":
    main()
