"""Does an investigation find the right name of a set? ``python -m simulation_study.investigations
--out FOLDER``.

Each effect is planted in a drawn subject and recorded with the paper's equal pulses and steps,
which leave rivals. `ankle investigate` designs and records (simulated) until one name is left.
Appends to ``results.jsonl``; an interrupted run goes on where it stopped. The simulation is that of
`ankle_physics`: it shows what designs and judgements can tell, not what another engine makes.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ankle_physics.model import Model
from model_discrepancy.report.investigation_report import write_investigation
from model_discrepancy.tools.investigation import investigate
from model_discrepancy.tools.simulated_conduct import SimulatedConduct
from simulation_study.planted_trials import STRENGTHS, simulate_trial

# Effects whose relatives answer equal steps alike.
EFFECTS = (
    "reflex_threshold",
    "short_range_stiffness",
    "reflex_saturation",
    "tendon",
    "maxwell_relaxation",
    "dahl_hysteresis",
    "saturating_damping",
    "torque_sensor_lag",
)
ROUNDS = 2


def run_case(name: str, seed: int, out: Path) -> dict[str, Any]:
    """Investigate one planted effect; what was found."""
    planted = {name: STRENGTHS.get(name, {})}
    first = simulate_trial(planted, seed=seed, duration=60.0, rate=1024.0, protocol="equal")
    subject = Model.of({"inertia": {}, "viscosity": {}, "stiffness": {}, "reflex": {}, **planted})
    quiet = Model.of({"voluntary_torque": {"rms": 0.3}})
    conduct = SimulatedConduct(Model([*subject.entries, *quiet.entries]), seed + 100)
    story = investigate(first, conduct, out / name, ROUNDS)
    write_investigation(story, out / name / "report.html")
    return {
        "planted": name,
        "seed": seed,
        "verdict": story.first.verdict.verdict,
        "sets": [list(s.models) for s in story.sets],
        "left": [s.left for s in story.sets],
        "recordings": len(story.rounds),
        "ended": story.ended,
        "answers": [r.answer for r in story.rounds],
    }


def main() -> None:
    """Investigate every effect that has no result yet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--effects", nargs="+", default=list(EFFECTS))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    results = options.out / "results.jsonl"
    known = results.read_text().splitlines() if results.exists() else []
    done = {json.loads(line)["planted"] for line in known}
    for number, name in enumerate(options.effects):
        if name in done:
            continue
        found = run_case(name, options.seed + number, options.out)
        with results.open("a") as file:
            file.write(json.dumps(found) + "\n")
        print(json.dumps(found), flush=True)


if __name__ == "__main__":
    main()
