"""`ankle estimate`: joint impedance from a bag."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ankle_bringup.errors import RunError
from ankle_bringup.known_model import KnownModel, known_model
from ankle_bringup.known_rig import KnownRig, known_rig
from ankle_bringup.terminal import (
    Algorithm,
    Out,
    Overwrite,
    OwnTerms,
    clear_folder,
    console,
    new_table,
    progress,
    steps,
    working,
)

if TYPE_CHECKING:
    from session_analysis.estimate_answer import Answer


def verb(
    bag: Annotated[Path, typer.Argument(help="A bag with ankle/samples.")],
    out: Out = Path("estimates"),
    algorithm: Algorithm = "",
    highpass: Annotated[
        str | None, typer.Option(help="C, CE and O: 'torque' as in the paper, or 'all'.")
    ] = None,
    model: KnownModel = None,
    rig: KnownRig = None,
    terms: OwnTerms = None,
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Estimate K, B, I and G from a bag, with the numbers that the node gives.

    Writes a bag with /impedance/estimate and /impedance/reflex_irf, and into its folder
    report.html, estimates.csv and estimates.png. Without one valid estimate it says why, and fails.

    Example: ankle estimate session --out session_estimates --rig rig.yaml
    """
    from ankle_interfaces.quantity import quantities
    from ankle_physics.own_terms import load_terms
    from impedance_estimator.algorithms import ALGORITHMS, DEFAULT
    from impedance_estimator.known_physics import KnownPhysics
    from impedance_estimator.offline.recorded_estimates import estimate_bag
    from impedance_estimator.stream import compile_estimator
    from session_analysis.estimate_answer import answer, require_start, require_valid
    from session_analysis.estimate_report import write_estimates
    from session_recorder.bag_reader import BagReader

    chosen = algorithm or DEFAULT
    if chosen not in ALGORITHMS:
        raise RunError(f"algorithm '{chosen}' is not known; allowed: {', '.join(ALGORITHMS)}")
    own = ALGORITHMS[chosen].settings_type
    given: dict[str, Any] = {} if highpass is None else {"highpass": highpass}
    if not given.keys() <= quantities(own).keys():
        raise RunError(f"algorithm '{chosen}' has no --highpass; C, CE and O have")
    settings = own(**given)
    load_terms(terms or "")
    taken, about_rig = known_rig(rig, [bag])
    subject, about_model = known_model(model, bag)
    known = None if subject is None and taken is None else KnownPhysics(taken, subject)
    require_start(bag)  # before an earlier result is removed
    clear_folder(out, overwrite, "metadata.yaml")
    with working(f"{chosen}: loading compiled code, or compiling it (up to two minutes, once)"):
        compile_estimator(chosen)
    with progress(f"estimating {bag}") as share:
        result = estimate_bag(bag, out, chosen, settings, known=known, progress=share)
    result.notes.extend(about for about in (about_model, about_rig) if about)
    with steps() as step:
        stated = BagReader(out).custom_data.get("settings", "")
        found = answer(bag, result, chosen, stated, step)
        report = write_estimates(found, out)
    _show(found)
    console.print(f"written to {out.resolve()}; look at {report}", soft_wrap=True)
    require_valid(found)
    console.print(
        f"next, does the model hold: ankle diagnose {bag} --out {bag}_diagnosis", soft_wrap=True
    )
    console.print(f"recording and estimates on one page: {_opening(bag, out)}", soft_wrap=True)
    return {
        "out": out.resolve(),
        "report": report.resolve(),
        "estimates": len(found.rows),
        "valid": int(found.valid.sum()),
        "doubtful": int(found.doubtful.sum()),
        "doubtful_because": {share.reason: round(share.share, 4) for share in found.doubts},
        "saturated": found.saturated,
        "not_valid_because": {share.reason: round(share.share, 4) for share in found.not_valid},
        "median": result.median(),
        "held_out_vaf[%]": found.opinion.held_out_vaf if found.opinion else None,
        "losses": found.losses.sentences(),
        "notes": found.remarks(),
    }


def _show(found: Answer) -> None:
    """Print what the estimates say, and what is in doubt about them."""
    from session_analysis.estimate_report import value_rows

    for sentence in found.losses.sentences():
        console.print(f"loss: {sentence}")
    for sentence in found.saturated:
        console.print(f"in doubt: {sentence}", soft_wrap=True)
    for remark in found.remarks():
        console.print(f"note: {remark}", soft_wrap=True)
    head, *rows = value_rows(found)
    table = new_table(head)
    for row in rows:
        table.add_row(*row)
    console.print(table)
    console.print(f"{found.valid.sum()} of {len(found.rows)} estimates are valid", end="")
    console.print(f", {found.doubtful.sum()} doubtful" if found.doubtful.any() else "")
    if found.doubtful.any():
        console.print(
            "doubtful: the torque shows more than the model explains; K and G may be off by more "
            "than their errors"
        )
    for doubt in found.doubts:
        console.print(f"doubtful for {doubt}", soft_wrap=True)
    for reason in found.not_valid:
        console.print(f"not valid for {reason}", soft_wrap=True)


def _opening(bag: Path, out: Path) -> str:
    """Return the command that shows a bag with its estimates."""
    beside = bag.resolve().with_name(f"{bag.resolve().name}_estimates")
    return f"ankle open {bag}" + ("" if out.resolve() == beside else f" --estimates {out}")
