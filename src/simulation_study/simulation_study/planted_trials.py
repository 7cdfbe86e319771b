"""Simulated trials with a planted effect, or none, and how the diagnosis does on them.

``python -m simulation_study.planted_trials --out FOLDER`` diagnoses trials without any mismatch and
one for each term of the library, appends every result to ``results.jsonl`` (an interrupted run goes
on where it stopped) and prints the table. With ``--leave-out`` the planted term is taken out of the
library first: what is then said must be `unexplained` or the name of a relative at the same place.
The simulation is that of `ankle_physics`: it shows what the search can tell apart, not what another
simulator would make of the same physics.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfilt

from ankle_physics.linear_dynamics import SecondOrder
from ankle_physics.model import Model
from ankle_physics.signals import Signals
from ankle_physics.term import term_library
from model_discrepancy.diagnose import Diagnosis, diagnose
from model_discrepancy.recording.recording import Recording

INTERNAL_RATE = 4096.0
# Position, velocity, torque: van 't Veld et al. 2018, section II-C.
SNR_DB = (52.7, 37.7, 24.1)
# Where the typical value of a term is too weak or too strong to be a moderate effect at these step
# sizes.
STRENGTHS: dict[str, dict[str, float]] = {
    "position_dependent_stiffness": {"k1": 800.0},
    "stiffness_drift": {"kt": -0.6},
    "settling_stiffness": {"kt": -0.6},
    "hardening_stiffness": {"k3": 6e4},
    "antagonist_reflex": {"Ga": 5.0},
    "position_reflex_gain": {"Gx": 300.0},
    "reflex_drift": {"Gt": -0.12},
    "cocontraction": {"kc": 25.0},
}


def simulate_trial(
    planted: dict[str, dict[str, float]],
    seed: int = 0,
    duration: float = 60.0,
    rate: float = 2048.0,
    protocol: str = "random",
    velocity: bool = True,
) -> Recording:
    """Return a trial of a random subject through the base model and the planted terms.

    Parameters
    ----------
    planted
        Values by term; what is not given is typical.
    seed
        Draws subject, steps and noise.
    duration
        Duration of the recording [s].
    rate
        1024 or 2048 Hz (a divisor of the internal 4096 Hz).
    protocol
        ``random`` (levels within 40 mrad) or ``equal`` (pulses and steps of 40 mrad).
    velocity
        Whether the velocity channel is recorded.
    """
    random = np.random.default_rng(seed)
    reference = _reference(random, duration, protocol)
    # A 30 Hz actuator, and its own drive's finite speed so that acceleration is continuous.
    driven = SecondOrder(INTERNAL_RATE).run(reference, 2 * np.pi * 30, 0.7)
    x, v, a = SecondOrder(INTERNAL_RATE).run_with_rates(driven, 2 * np.pi * 90, 0.8)
    time = np.arange(len(x)) / INTERNAL_RATE
    signals = Signals(INTERNAL_RATE, x, v, a, cocontraction=contraction(seed, time))
    torque = Model.of({**_subject(random), **planted}).start(INTERNAL_RATE, seed).torque(signals)
    anti_alias = butter(4, 0.45 * rate, fs=INTERNAL_RATE, output="sos")

    def read(signal: np.ndarray, snr: float) -> np.ndarray:
        sampled = sosfilt(anti_alias, signal)[:: int(INTERNAL_RATE / rate)]
        return sampled + random.standard_normal(len(sampled)) * np.std(signal) * 10 ** (-snr / 20)

    position, moved, torque = (
        read(signals.measured_position, SNR_DB[0]),
        read(v, SNR_DB[1]),
        read(torque, SNR_DB[2]),
    )
    return Recording(
        rate, position, torque, moved if velocity else None, name=f"simulated, seed {seed}"
    )


def contraction(seed: int, time: np.ndarray) -> np.ndarray:
    """Return how much opposing muscles contract together: smooth, of mean 0 and root mean square 1,
    and another one every second; shape (n,).

    Parameters
    ----------
    seed
        Draws it.
    time
        From 0 on [s], shape (n,).
    """
    knots = np.arange(0.0, time[-1] + 4.0, 1.0)
    level = np.random.default_rng([seed, 1]).standard_normal(len(knots))
    course = CubicSpline(knots, level)(time)
    course = course - course.mean()
    return np.asarray(course / np.sqrt(np.mean(course**2)))


def _subject(random: np.random.Generator) -> dict[str, dict[str, float]]:
    return {
        "inertia": {"I": random.uniform(0.01, 0.018)},
        "viscosity": {"B": random.uniform(0.5, 1.2)},
        "stiffness": {"K": random.uniform(50.0, 140.0)},
        "reflex": {
            "G": random.uniform(4.0, 14.0),
            "delay": random.uniform(0.036, 0.046),
            "omega": random.uniform(17.0, 25.0),
            "z": 0.8,
        },
        "voluntary_torque": {
            "level": 3.0,
            "rms": random.uniform(0.1, 0.6),
            "cutoff": random.uniform(0.2, 0.8),
        },
    }


def _reference(random: np.random.Generator, duration: float, protocol: str) -> np.ndarray:
    reference = np.zeros(int(duration * INTERNAL_RATE))
    time = 0.5
    while time < duration:
        start = int(time * INTERNAL_RATE)
        if protocol == "random":
            reference[start:] = random.uniform(-0.02, 0.02)
            time += random.uniform(0.2, 0.48)
        else:
            width = 0.04 if random.random() < 0.5 else 0.46
            reference[start : int((time + width) * INTERNAL_RATE)] = 0.04
            time += 0.5 + random.uniform(0.0, 0.2)
    return reference


def cases(nulls: int, seed: int, leave_out: bool = False) -> list[dict[str, Any]]:
    """Return trials without mismatch, then one for each term, over rates and protocols; `leave_out`
    takes the term out of the library.
    """
    names: list[str | None] = [None] * nulls
    names += [name for name, term in term_library().items() if term.searched]
    return [
        {
            "planted": name,
            "seed": seed + number,
            "rate": (2048.0, 1024.0)[number // 2 % 2],
            "protocol": ("random", "equal")[number % 2],
            "velocity": number % 3 != 0,
            "duration": 60.0,
            "leave_out": leave_out and name is not None,
        }
        for number, name in enumerate(names)
    ]


def run_case(case: dict[str, Any]) -> dict[str, Any]:
    """Diagnose one case; the case with what was found."""
    options = {key: value for key, value in case.items() if key not in ("planted", "leave_out")}
    planted = {case["planted"]: STRENGTHS.get(case["planted"], {})} if case["planted"] else {}
    library = (
        [name for name in term_library() if name != case["planted"]] if case["leave_out"] else None
    )
    return {**case, **outcome(diagnose(simulate_trial(planted, **options), library=library))}


def outcome(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return what a study keeps of a diagnosis."""
    verdict = diagnosis.verdict
    return {
        "verdict": verdict.verdict,
        "effects": [[e["probability"], *e["set"]] for e in verdict.effects],
        "fit": verdict.fit,
        "reasons": verdict.reasons,
    }


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for results.jsonl")
    parser.add_argument("--nulls", type=int, default=20, help="trials without mismatch")
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument(
        "--leave-out", action="store_true", help="take each planted term out of the library"
    )
    options = parser.parse_args()
    print(
        summary(
            run_all(cases(options.nulls, options.seed, options.leave_out), run_case, options.out)
        )
    )


def run_all(
    todo: list[dict[str, Any]], run: Callable[[dict[str, Any]], dict[str, Any]], out: Path
) -> list[dict[str, Any]]:
    """Return results of all cases; those in ``results.jsonl`` of the folder `out` already are not
    run again. Cases differ by ``seed``.
    """
    out.mkdir(parents=True, exist_ok=True)
    file = out / "results.jsonl"
    known = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    done = {entry["seed"] for entry in known}
    for number, case in enumerate(todo):
        if case["seed"] in done:
            continue
        result = run(case)
        with file.open("a") as stream:
            stream.write(json.dumps(result, default=float) + "\n")
        known.append(result)
        print(f"{number + 1}/{len(todo)} {_line(result)}", flush=True)
    return known


def _line(result: dict[str, Any]) -> str:
    found = "; ".join(" or ".join(effect[1:]) for effect in result["effects"]) or "nothing"
    return f"planted {result['planted'] or 'nothing'}: {result['verdict']}, {found}"


def summary(results: list[dict[str, Any]]) -> str:
    """Count false alarms, names and sets; for terms left out of the library, what was said
    instead.
    """
    nulls = [r for r in results if r["planted"] is None]
    rest = [r for r in results if r["planted"] is not None and not r["leave_out"]]
    without = [r for r in results if r["leave_out"]]
    said = []
    if nulls:
        said.append(
            f"false alarms {sum(r['verdict'] != 'no_mismatch' for r in nulls)} of {len(nulls)}"
        )
    if rest:
        exact = sum(any(e[1] == r["planted"] for e in r["effects"]) for r in rest)
        within = sum(any(r["planted"] in e[1:4] for e in r["effects"]) for r in rest)
        alone = sum(len(r["effects"]) == 1 and r["planted"] in r["effects"][0][1:4] for r in rest)
        missed = sum(r["verdict"] == "no_mismatch" for r in rest)
        said.append(
            f"of {len(rest)} planted: named {exact}, in a set of three {within}, nothing else "
            f"beside {alone}; overlooked {missed}"
        )
    if without:
        unnamed = [r for r in without if r["verdict"] in ("unexplained", "no_mismatch")]
        relative = [
            r
            for r in without
            if r["verdict"] == "explained"
            and _place(r["planted"]) in {_place(e[1]) for e in r["effects"]}
        ]
        wrong = [r["planted"] for r in without if r not in unnamed and r not in relative]
        said.append(
            f"of {len(without)} left out of the library: unexplained or nothing {len(unnamed)}, a "
            f"relative of the place {len(relative)}, "
            f"a name from elsewhere {len(wrong)} ({', '.join(wrong)})"
        )
    return "; ".join(said)


def _place(name: str) -> str:
    return term_library()[name].place.value if name in term_library() else name


if __name__ == "__main__":
    main()
