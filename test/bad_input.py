"""Bad input of every kind that others write, from a seed: accepted and used as it says, or refused
with the error of its reader. Anything else (another exception, a hang, motion) ends with 1.

    make bad-input                             a million cases
    python test/bad_input.py --cases 20000 --seed 3 --only packets
    python test/bad_input.py --again "HTTP headers" 5017 --seed 3      one case, with its traceback

Kinds that are cheap carry the number; files of a few hundred kilobytes get some hundred each. A
million cases take seven minutes of one core. A run of all kinds writes docs/results/bad_input.md.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from damaged_input.damage import Case
from damaged_input.files import (
    MODEL,
    RIG,
    SCENARIO,
    as_c3d,
    as_csv,
    as_edf,
    as_mat,
    as_parquet,
    as_tdms,
    as_xlsx,
    bags,
    forked_tables,
    of_package,
    read_model,
    tables,
    yaml_files,
)
from damaged_input.graph import blocks, session_events, stream_descriptions
from damaged_input.line import packets_to_the_driver, packets_to_the_rig, references
from damaged_input.pages import http_headers, page_messages, saved_sessions

from ankle_physics.errors import ModelError
from ankle_physics.rig_file import RigFile
from ankle_physics.scenario import Scenario
from biofeedback.errors import ProtocolError
from biofeedback.session.course import load_course
from biofeedback.session.protocol import load_protocol

PAGE = Path(__file__).resolve().parents[1] / "docs" / "results" / "bad_input.md"
HEAD = """# Bad input

`make bad-input CASES={cases} SEED={seed}`: input of every kind that others write, from a seed.

- *Accepted*: the reader took it, and everything that it then states holds. Values are finite and
  within bounds, no motion goes beyond a limit, samples are complete or reported as missing.
- *Refused*: the reader refused it by its own error.
- *Anything else*: another exception, more than {longest:g} s, motion, or content that is silently
  wrong.

| input | cases | accepted | refused | anything else |
| --- | --- | --- | --- | --- |
"""
LONGEST_CASE = 20.0  # s; what takes longer hangs
LEAST_CASES = 200  # of an expensive kind, in a run of a million


class Kind(NamedTuple):
    """A kind of input.

    Attributes
    ----------
    name
        For the table.
    share
        Of all cases; 0 for kinds that get few.
    prepare
        Makes the case in a folder: true where the input was accepted, false where its reader
        refused it.
    """

    name: str
    share: float
    prepare: Callable[[Path], Case]


KINDS = (
    Kind("packets to the rig", 0.28, packets_to_the_rig),
    Kind("packets to the driver", 0.22, packets_to_the_driver),
    Kind("blocks of the reference", 0.1, references),
    Kind("messages of samples", 0.2, blocks),
    Kind("messages of a page", 0.1, page_messages),
    Kind("HTTP headers", 0.08, http_headers),
    Kind("LSL descriptions", 0.018, stream_descriptions),
    Kind("session events", 0.002, session_events),
    Kind("saved sessions", 0.0, saved_sessions),
    Kind("models", 0.0, yaml_files(MODEL, "model.yaml", read_model, (ModelError,))),
    Kind("scenarios", 0.0, yaml_files(SCENARIO, "scenario.yaml", Scenario.load, (ModelError,))),
    Kind("rig files", 0.0, yaml_files(RIG, "rig.yaml", RigFile.load, (ModelError,))),
    Kind(
        "protocols",
        0.0,
        yaml_files(
            of_package("demonstration.yaml"),
            "protocol.yaml",
            lambda path: load_protocol(str(path)),
            (ProtocolError,),
        ),
    ),
    Kind(
        "courses",
        0.0,
        yaml_files(
            of_package("courses", "down_training.yaml"),
            "course.yaml",
            lambda path: load_course(str(path)),
            (ProtocolError,),
        ),
    ),
    Kind("bags", 0.0, bags),
    *(
        Kind(f"files {write.__name__[3:].upper()}", 0.0, tables(write))
        for write in (as_csv, as_edf, as_xlsx, as_parquet, as_tdms)
    ),
    *(
        Kind(f"files {write.__name__[3:].upper()}", 0.0, forked_tables(write))
        for write in (as_mat, as_c3d)
    ),
)


def seeded(seed: int, kind: Kind, case: int) -> np.random.Generator:
    """The numbers of one case, which does not depend on any other."""
    return np.random.default_rng([seed, *kind.name.encode(), case])


class Found(NamedTuple):
    """What became of a kind's cases."""

    counts: Counter[str]
    problems: list[str]


def examine(kind: Kind, cases: int, seed: int, progress: Callable[[int], None]) -> Found:
    """So many cases of one kind."""
    counts: Counter[str] = Counter()
    problems: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        case = kind.prepare(Path(folder))
        for index in range(cases):
            begin = time.monotonic()
            try:
                counts["accepted" if case(seeded(seed, kind, index)) else "refused"] += 1
            except Exception as error:
                counts["failed"] += 1
                last = traceback.extract_tb(error.__traceback__)[-1]
                where = f"{Path(last.filename).name}:{last.lineno}"
                problems.append(f"{kind.name} {index}: {type(error).__name__} ({where}): {error}")
            if time.monotonic() - begin > LONGEST_CASE:
                problems.append(f"{kind.name} {index}: took {time.monotonic() - begin:.0f} s")
            progress(index)
    return Found(counts, problems)


def number_of(kind: Kind, cases: int) -> int:
    """How many cases of a kind a run of so many in all has."""
    few = LEAST_CASES * cases // 1_000_000
    return max(int(kind.share * cases), few, 5)


def show_progress(name: str, cases: int) -> Callable[[int], None]:
    """Return what shows the number of the present case every two seconds."""
    shown = [time.monotonic()]

    def show(index: int) -> None:
        if time.monotonic() - shown[0] > 2.0:
            shown[0] = time.monotonic()
            print(f"\r{name}: {index} of {cases}   ", end="", file=sys.stderr, flush=True)

    return show


def main() -> int:
    """Run the cases, print the table and write it into the page."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--cases", type=int, default=1_000_000)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--only", default="", help="kinds with these words in their name")
    options.add_argument("--again", nargs=2, metavar=("KIND", "CASE"))
    given = options.parse_args()
    if given.again:
        kind = next(kind for kind in KINDS if kind.name == given.again[0])
        with tempfile.TemporaryDirectory() as folder:
            print(kind.prepare(Path(folder))(seeded(given.seed, kind, int(given.again[1]))))
        return 0
    problems, rows, total = [], [], 0
    for kind in [kind for kind in KINDS if given.only in kind.name]:
        cases = number_of(kind, given.cases)
        found = examine(kind, cases, given.seed, show_progress(kind.name, cases))
        problems += found.problems
        total += cases
        counts = [found.counts[fate] for fate in ("accepted", "refused", "failed")]
        rows.append(f"| {kind.name} | {cases} | {' | '.join(map(str, counts))} |")
        print(rows[-1], flush=True)
    closing = f"{total} cases, seed {given.seed}: {len(problems)} neither accepted nor refused."
    if not given.only:
        head = HEAD.format(cases=given.cases, seed=given.seed, longest=LONGEST_CASE)
        PAGE.write_text(f"{head}{chr(10).join(rows)}\n\n{closing}\n")
    print("\n".join([closing, *problems[:50]]))
    return int(bool(problems))


if __name__ == "__main__":
    raise SystemExit(main())
