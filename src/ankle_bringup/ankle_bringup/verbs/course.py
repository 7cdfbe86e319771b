"""`ankle course`: conditioning courses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.errors import RunError
from ankle_bringup.terminal import (
    SEED,
    Out,
    Overwrite,
    clear_folder,
    console,
    number_option,
    working,
)
from ankle_interfaces.quantity import Quantity

CHANGE = Quantity("change", "%", -50.0, 50.0, 2.0)


def verb(
    plan: Annotated[
        str,
        typer.Argument(
            help="down_training, up_training, demonstration, or a course file of your own."
        ),
    ],
    record: Annotated[
        Path | None, typer.Option(help="Record of a subject's course; shows its trend.")
    ] = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Let a simulated subject do all sessions.")
    ] = False,
    change: Annotated[
        float, number_option(CHANGE, "What that subject learns in a session [%]; 0: nothing.")
    ] = 2.0,
    seed: Annotated[int, number_option(SEED, "Draws that subject.")] = 0,
    subject: Annotated[str, typer.Option(help="Pseudonym of the subject.")] = "S01",
    out: Out = Path("course"),
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Check a conditioning course, run it with a simulated subject, or show the trend of a record.

    Writes record.yaml, course.png and course.pdf. docs/biofeedback.md explains the course files.

    Example: ankle course down_training --simulate --change 2 --out trained
    """
    from biofeedback.errors import CommandError, ProtocolError
    from biofeedback.session.course import load_course
    from biofeedback.session.course_picture import draw_course, sentence
    from biofeedback.session.course_record import load_record, new_record
    from biofeedback.session.course_trend import trend
    from biofeedback.session.simulated_learner import Learner, SimulatedLearner, run_course

    try:
        course = load_course(plan)
        console.print(
            f"{course.title}: {course.baseline_sessions} baseline and "
            f"{course.conditioning_sessions} conditioning sessions of {course.blocks} x "
            f"{course.trials_per_block} trials; the reflex is to go {course.direction}"
        )
        if record is None and not simulate:
            return {"course": course.title, "sessions": course.sessions}
        clear_folder(out, overwrite, "record.yaml")
        kept = new_record(course, subject) if record is None else load_record(record)
        if simulate:
            with working("a simulated subject does the sessions"):
                run_course(course, kept, SimulatedLearner(Learner(change / 100.0), course, seed))
        elif kept.digest != course.digest:
            raise RunError(f"{record} follows '{kept.course}', another course than {plan}")
    except (ProtocolError, CommandError) as error:
        raise RunError(str(error)) from None
    out.mkdir(parents=True, exist_ok=True)
    kept.save(out / "record.yaml")
    for ending in ("png", "pdf"):
        draw_course(kept, course, out / f"course.{ending}")
    console.print(sentence(kept, course), soft_wrap=True)
    console.print(f"record: {(out / 'record.yaml').resolve()}", soft_wrap=True)
    console.print(f"picture: {out / 'course.png'}, to print: {out / 'course.pdf'}", soft_wrap=True)
    found = trend(kept, course)
    return {
        "out": out.resolve(),
        "sessions": len(kept.results),
        "trend": None if found is None else found.found,
        "percent": None if found is None else [found.percent, found.lower, found.upper],
    }
