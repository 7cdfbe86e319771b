"""The `ankle` command: every verb is a thin door to a package that also works without it."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Optional

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

app = typer.Typer(
    name="ankle",
    help="Software of an ankle-perturbation laboratory: run it, record it, estimate joint impedance from it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
console = Console()

Out = Annotated[Path, typer.Option("--out", "-o", help="Where to write. An existing place is never overwritten.")]
Settings = Annotated[list[str], typer.Option("--set", help="A parameter, as node.parameter=value. May be repeated.")]


@contextmanager
def _progress(what: str) -> Iterator:
    """A progress bar, and a function that takes the done share from 0 to 1."""
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)


@contextmanager
def _steps() -> Iterator:
    """A progress bar for work of several steps, and a function that takes a step's name and its done share from 0 to 1."""
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda what, share: bar.update(task, description=what, completed=share)


@app.command()
def demo(
    out: Out = Path("demo_results"),
    seconds: Annotated[float, typer.Option(help="Length of the live run; below 75 s the estimates do not reach the jump's end.")] = 90.0,
    trials: Annotated[Path, typer.Option(help="Folder of real trials as .npz files.")] = Path("../shared/recordings"),
) -> None:
    """Run the main job once: simulated ankle live, estimates made again from the bag, real human trials.

    Example: ankle demo --out demo_results
    """
    from ankle_bringup.demo import run_demo

    if not run_demo(out, seconds, trials, console):
        raise typer.Exit(1)


@app.command()
def estimate(
    bag: Annotated[Path, typer.Argument(help="A bag with /ankle/samples.")],
    out: Out = Path("estimates"),
    algorithm: Annotated[str, typer.Option(help="As the estimator node's parameter of that name.")] = "",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what is at --out.")] = False,
) -> None:
    """Estimate K, B, I and G from a bag, with the numbers that the node gives.

    Example: ankle estimate session --out session_estimates
    """
    from impedance_estimator.algorithms import DEFAULT
    from impedance_estimator.offline import estimate_bag

    with _progress(f"estimating {bag}") as share:
        result = estimate_bag(bag, out, algorithm or DEFAULT, overwrite=overwrite, progress=share)
    for note in result.notes:
        console.print(f"note: {note}")
    table = Table("", "median", "unit")
    for name, value in result.median().items():
        quantity, unit = name.rstrip("]").split("[")
        table.add_row(quantity, f"{value:.4g}", unit)
    console.print(table)
    console.print(f"{len(result.valid)} of {len(result.rows)} estimates are valid; written to {out.resolve()}")


@app.command()
def diagnose(
    bag: Annotated[Path, typer.Argument(help="A bag with /ankle/samples.")],
    out: Out = Path("diagnosis"),
    model: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="A model file as the baseline, instead of the paper's model refitted."),
    ] = None,
) -> None:
    """Find where the joint model fails on a recording, and which physics was left out.

    Writes report.html, verdict.json and the augmented model.yaml, which ankle_sim loads.

    Example: ankle diagnose session --out session_diagnosis
    """
    from ankle_bringup.errors import RunError
    from model_discrepancy.diagnose import diagnose as diagnose_bag

    if out.exists() and any(out.iterdir()):
        raise RunError(f"{out} is not empty; nothing is overwritten unasked")
    with Console(stderr=True).status("diagnosing ...") as status:
        found = diagnose_bag(bag, out, model, progress=lambda step: status.update(f"diagnosing: {step}"))
    console.print(f"verdict: [bold]{found.verdict.verdict}[/bold]")
    for effect in found.verdict.effects:
        console.print(f"- {effect['sentence']}")
    for reason in found.verdict.reasons:
        console.print(f"  {reason}")
    console.print(f"report: {(out / 'report.html').resolve()}")


@app.command()
def compare(
    simulated: Annotated[Path, typer.Argument(help="A bag of the simulation.")],
    recorded: Annotated[Path, typer.Argument(help="A recorded bag.")],
    out: Out = Path("comparison"),
) -> None:
    """Find where a recorded bag differs from a simulated one: joint, actuator or sensors.

    Writes report.html and compare.json.

    Example: ankle compare simulated_session session --out comparison
    """
    from ankle_bringup.errors import RunError
    from model_discrepancy.comparison_report import compare_bags

    if out.exists() and any(out.iterdir()):
        raise RunError(f"{out} is not empty; nothing is overwritten unasked")
    with Console(stderr=True).status("comparing ...") as status:
        result = compare_bags(simulated, recorded, out, progress=lambda step: status.update(f"comparing: {step}"))
    console.print(f"verdict: [bold]{result.verdict}[/bold]")
    console.print(result.headline, markup=False)
    console.print(f"report: {(out / 'report.html').resolve()}")


@app.command("design-experiment")
def design_experiment(
    verdict: Annotated[Path, typer.Argument(help="verdict.json of a diagnosis, or its folder.")],
    out: Out = Path("design"),
) -> None:
    """Propose the perturbation that tells the rivals of a verdict apart.

    Writes design.yaml, a parameter file of the perturbation generator, and design.png.

    Example: ankle design-experiment session_diagnosis --out design
    """
    from ankle_bringup.errors import RunError
    from model_discrepancy.experiment_design import LISTED
    from model_discrepancy.experiment_design import design_experiment as design

    if out.exists() and any(out.iterdir()):
        raise RunError(f"{out} is not empty; nothing is overwritten unasked")
    with Console(stderr=True).status("designing ...") as status:
        found = design(verdict, progress=lambda step: status.update(f"designing: {step}"))
    found.save(out)
    table = Table("perturbation", "hardest pair", "excess error [%]", "minutes")
    for proposal in found.proposals[:LISTED]:
        pair = " / ".join(name.replace("_", " ") for name in proposal.pair)
        table.add_row(proposal.candidate.title, pair, f"{100 * proposal.excess:.1f}", f"{proposal.minutes:.2g}")
    if found.proposals:
        console.print(table)
    for sentence in [found.sentence, *found.other]:
        console.print(sentence, markup=False)
    if found.proposals:
        console.print(f"written to {out.resolve()}")


@app.command()
def blind(
    cases: Annotated[int, typer.Option(help="Recordings to conceal and to diagnose.")] = 100,
    seed: Annotated[int, typer.Option(help="Draws subjects, effects and noise.")] = 1,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the study; an interrupted one goes on.")] = Path("blind_study"),
    workers: Annotated[int, typer.Option(help="Processes on this machine.")] = os.cpu_count() or 1,
    scheduler: Annotated[Optional[str], typer.Option(help="Address of a running Dask scheduler instead.")] = None,  # noqa: UP045
) -> None:
    """Diagnose recordings of an independent rig whose truth is sealed; then open the seal and score.

    Example: ankle blind --cases 100 --seed 7 --out blind_study
    """
    from ankle_bringup.errors import RunError

    tests = Path(__file__).resolve().parents[3] / "test"
    if not (tests / "blind_rig").is_dir():
        raise RunError(f"the blind rig is not in {tests}: it comes with the source tree, not with an installed package")
    sys.path.insert(0, str(tests))
    from blind_rig.study import blind as run_study

    command = [sys.executable, "-m", "ankle_bringup.command_line", "diagnose", "{bag}", "--out", "{out}"]
    run_study(cases, seed, out, command, workers, scheduler=scheduler, console=console)
    console.print((out / "result.md").read_text(), markup=False, highlight=False)


@app.command()
def table2(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the study; an interrupted one goes on.")] = Path("table2_study"),
    seed: Annotated[int, typer.Option(help="Draws K, G, perturbations and noise.")] = 1,
    quick: Annotated[bool, typer.Option("--quick", help="8 runs instead of 100, 5 seeds instead of 20.")] = False,
    workers: Annotated[int, typer.Option(help="Processes on this machine.")] = os.cpu_count() or 1,
    scheduler: Annotated[Optional[str], typer.Option(help="Address of a running Dask scheduler instead.")] = None,  # noqa: UP045
) -> None:
    """Make table II of van 't Veld et al. 2018 again: six combinations of signal-model and algorithm, the paper's numbers beside ours.

    Writes table2.md, table2.csv, figure6.png and figure7.png.

    Example: ankle table2 --quick --out table2_study
    """
    from simulation_study.table2_report import reproduce_table2

    console.print(reproduce_table2(out, seed, quick, workers, scheduler, console), markup=False, highlight=False, soft_wrap=True)
    console.print(f"written to {out.resolve()}")


@app.command()
def emg(
    bag: Annotated[Path, typer.Argument(help="A bag with /emg/samples and /perturbation/reference or /ankle/samples.")],
    out: Out = Path("emg_responses"),
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what is at --out.")] = False,
) -> None:
    """Background and reflex activity of every onset in a bag, with the numbers that the node gives.

    Writes a bag with /emg/responses and /emg/ensemble.

    Example: ankle emg session --out session_responses
    """
    from emg_driver.offline import respond_bag, summary

    with _progress(f"reading {bag}") as share:
        found = respond_bag(bag, out, overwrite=overwrite, progress=share)
    for note in found.notes[:10]:
        console.print(f"note: {note}")
    table = Table("muscle", "onsets", "background [uV]", "reflex [uV.s]")
    for row in summary(found):
        table.add_row(*row)
    console.print(table)
    console.print(f"{len(found.rows)} onsets; written to {out.resolve()}")


@app.command()
def validate(
    bags: Annotated[list[str], typer.Argument(help="Recorded sessions, each as BAG or as SUBJECT=BAG.")],
    out: Out = Path("validation"),
    recompute: Annotated[bool, typer.Option("--recompute", help="Estimates and EMG responses from the samples, not as recorded.")] = False,
) -> None:
    """Correlate K and G with EMG over the hold periods of recorded sessions: the paper's Table III and figures 4, 5, 8.

    Writes report.html, the pictures, table3.csv and holds.csv.

    Example: ankle validate anna=monday_1 anna=monday_2 ben=tuesday_1 --out validation
    """
    from session_analysis.console import report_validation

    with _steps() as step:
        report_validation(bags, out, recompute, step, console)


@app.command("virtual-study")
def virtual_study(
    out: Out = Path("virtual_study"),
    steady: Annotated[bool, typer.Option("--cannot-modulate", help="Subjects whose stiffness and reflexes stay the same.")] = False,
    seed: Annotated[int, typer.Option(help="Of states, noise and perturbation.")] = 1,
) -> None:
    """Three virtual subjects through the paper's experiment, recorded as bags, then validated like real ones (about 15 minutes).

    Writes subject_1 to subject_3 (bags of 45 minutes, together 1.2 GB) and validation/; bags that are there are used again.

    Example: ankle virtual-study --out virtual_study
    """
    from session_analysis.console import report_validation
    from session_analysis.virtual_study import paper_study, record_study

    with _steps() as step:
        bags = record_study(paper_study(not steady, seed), out, step)
        report_validation([str(bag) for bag in bags], out / "validation", False, step, console)


@app.command()
def up(
    graph: Annotated[str, typer.Argument(help="A graph that comes with the package, or the path of a YAML file.")] = "simulated",
    settings: Settings = [],  # noqa: B006
    seconds: Annotated[float, typer.Option(help="Stop after so many seconds; 0 runs until Ctrl-C.")] = 0.0,
    logs: Annotated[Path, typer.Option(help="Folder for one log file a node.")] = Path("ankle_logs"),
) -> None:
    """Start a graph of nodes and show what it says, until Ctrl-C.

    Example: ankle up simulated --set ankle_sim.K=80.0 --seconds 30
    """
    from ankle_bringup.graph import load_graph
    from ankle_bringup.up import run_graph

    run_graph(load_graph(graph).with_settings(settings), logs, seconds, console)


@app.command()
def graphs() -> None:
    """List the graphs that come with the package.

    Example: ankle graphs
    """
    from ankle_bringup.graph import known_graphs, load_graph

    for name in known_graphs():
        console.print(f"[bold]{name}[/bold]: {load_graph(name).description}")


@app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []})
def run(context: typer.Context, package: str, executable: str) -> None:
    """Run a single node, as `ros2 run` does.

    Example: ankle run ankle_sim ankle_sim --ros-args -p K:=80.0
    """
    from ankle_bringup.processes import node_command

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    command = node_command(package, executable) + context.args
    os.execv(command[0], command)


@app.command()
def record(
    out: Annotated[Path, typer.Argument(help="The new bag.")],
    topics: Annotated[str, typer.Option(help="Topics joined by commas; empty records all of them.")] = "",
) -> None:
    """Record the running graph into a bag, until Ctrl-C.

    Example: ankle record session
    """
    _become_node("session_recorder", "record", out=str(out), topics=topics)


@app.command()
def replay(
    bag: Path,
    rate: Annotated[float, typer.Option(help="Bag seconds per second; 0 is as fast as the readers follow.")] = 1.0,
    topics: Annotated[str, typer.Option(help="Topics joined by commas; empty replays the recorded inputs, 'all' everything.")] = "",
    wait_for_readers: Annotated[int, typer.Option(help="Nodes that must read along before the start.")] = 1,
) -> None:
    """Send a bag to the graph again, without losing a block at any rate.

    Example: ankle replay session --rate 0
    """
    _become_node("session_recorder", "replay", bag=str(bag), rate=rate, topics=topics, wait_for_readers=wait_for_readers)


def _become_node(package: str, executable: str, **parameters: object) -> None:
    from ankle_bringup.graph import NodeDescription
    from ankle_bringup.processes import node_command

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    command = node_command(package, executable) + NodeDescription(package, executable, executable, parameters).ros_arguments()
    os.execv(command[0], command)


@app.command("import")
def import_(
    source: Annotated[Path, typer.Argument(help="A .csv, .txt, .npz or .mat file.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The new bag.")],
    column: Annotated[list[str], typer.Option("--column", "-c", help="What a column is: 'name[unit]=column'. Repeat for each.")],
    torque_sign: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(help="'rig': torque that moves the ankle, positive in dorsiflexion; 'subject': the opposite."),
    ] = None,
    rate: Annotated[Optional[float], typer.Option(help="Sampling rate [Hz]; needed without a time column.")] = None,  # noqa: UP045
    missing: Annotated[str, typer.Option(help="Samples that are not finite: 'nan' keeps them, 'gap' leaves them out.")] = "nan",
    force: Annotated[bool, typer.Option("--force", help="Import in spite of contradictions; the bag says so.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a bag that is there.")] = False,
) -> None:
    """Import a recording into a bag; wrong units and signs are recognised from the data and refused.

    Example: ankle import trial.npz -o trial -c 't[s]=time' -c 'position[rad]=position' -c 'torque[N.m]=torque' --torque-sign subject
    """
    from ankle_bringup.errors import GraphError
    from session_recorder.importing import import_recording

    stated = {}
    for text in column:
        name, equals, source_column = text.partition("=")
        if not equals:
            raise GraphError(f"--column '{text}' is not 'name[unit]=column', as in 'position[deg]=angle'")
        stated[name] = source_column
    with _progress(f"importing {source}") as share:
        report = import_recording(
            source, out, stated, torque_sign=torque_sign, rate=rate, missing=missing, force=force, overwrite=overwrite, progress=share
        )
    for sentence in report.warnings:
        console.print(f"note: {sentence}")
    console.print(f"written to {out.resolve()}")


@app.command()
def export(
    bag: Path,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for CSV, file for NPZ.")],
    form: Annotated[str, typer.Option("--format", help="'csv' or 'npz'.")] = "csv",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what is there.")] = False,
) -> None:
    """Write the sampled topics of a bag as CSV or NPZ, columns named with their units.

    Example: ankle export session -o session_csv
    """
    from session_recorder.exporting import export_bag

    with _progress(f"exporting {bag}") as share:
        written = export_bag(bag, out, form, overwrite=overwrite, progress=share)
    for path in written:
        console.print(str(path))


@app.command()
def recover(
    bag: Path,
    out: Annotated[Optional[Path], typer.Option("--out", "-o", help="The repaired bag; beside the damaged one unless given.")] = None,  # noqa: UP045
) -> None:
    """Make a complete bag from one whose recorder was killed.

    Example: ankle recover session -o session_repaired
    """
    from session_recorder.recovery import recover as recover_bag

    with _progress(f"reading {bag}") as share:
        recovered = recover_bag(bag, out, progress=share)
    for sentence in recovered.problems:
        console.print(f"note: {sentence}")
    console.print(f"{recovered.messages} messages in {recovered.path}")


@app.command()
def topics() -> None:
    """List the topics of the running graph, with their types and how many publish and read them.

    Example: ankle topics
    """
    from ankle_bringup.live_graph import observer
    from ankle_bringup.live_graph import topics as live_topics

    table = Table("topic", "type", "publishers", "readers")
    with observer() as node:
        for name, types, publishers, readers in live_topics(node):
            table.add_row(name, types, str(publishers), str(readers))
    console.print(table)


@app.command()
def echo(
    topic: str,
    count: Annotated[int, typer.Option("--count", "-n", help="End after so many messages; 0 goes on.")] = 0,
    seconds: Annotated[float, typer.Option(help="End when nothing has come for so many seconds.")] = 10.0,
) -> None:
    """Show the messages of a topic: blocks as tables, all others as YAML.

    Example: ankle echo /impedance/estimate -n 1
    """
    from ankle_bringup.errors import RunError
    from ankle_bringup.live_graph import echo as live_echo
    from ankle_bringup.live_graph import observer

    with observer() as node:
        shown = live_echo(node, topic, lambda text: print(text, flush=True), count, seconds)
    if shown == 0:
        raise RunError(f"nothing came on '{topic}' within {seconds:g} s")


@app.command()
def params(
    node: Annotated[str, typer.Argument(help="Name of a running node.")],
    parameter: Annotated[Optional[str], typer.Argument(help="Show this one only.")] = None,  # noqa: UP045
    value: Annotated[Optional[str], typer.Argument(help="Set it to this value.")] = None,  # noqa: UP045
) -> None:
    """Show the parameters of a running node with unit, range and description, or set one.

    Example: ankle params ankle_sim K 120.0
    """
    from ankle_bringup.live_graph import describe_parameters, observer, set_parameter

    with observer() as looking:
        if parameter is not None and value is not None:
            set_parameter(looking, node, parameter, value)
            console.print(f"{node}: {parameter} = {value}")
            return
        table = Table("parameter", "value", "what it is", "allowed")
        for descriptor, present in describe_parameters(looking, node):
            if parameter is None or descriptor.name == parameter:
                table.add_row(descriptor.name, str(present), descriptor.description, descriptor.additional_constraints)
    console.print(table)


def main() -> None:
    """Run the command; errors that a user can act on are one line on stderr and exit code 1."""
    try:
        app()
    except (ValueError, RuntimeError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
