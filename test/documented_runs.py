"""How each documented command is run: to its end, until Ctrl-C, beside a graph, or not at all.

.venv/bin/python test/documented_runs.py      counts the commands, and names those not run
"""

from dataclasses import dataclass, replace

from documented_commands import PAGES, ROOT, commands, words_of

ANKLE = ".venv/bin/ankle"
PYTHON = ".venv/bin/python"
STUDY = f"{PYTHON} -m simulation_study."
BENCHMARK = f"{PYTHON} benchmarks/"

NOT_RUN = {
    "sudo apt-get install git make python3-venv": "changes this computer",
    "sudo apt-get install chromium": "changes this computer",
    "sudo snap install chromium": "changes this computer",
    "sudo apt install ros-jazzy-sros2": "changes this computer",
    "rosdep install --from-paths src --ignore-src --yes": "needs a computer with Jazzy",
    "colcon build && . install/setup.bash": "needs a computer with Jazzy",
    "python3 -m pip install --user --break-system-packages --requirement "
    "requirements/jazzy.txt": "changes this computer; the workflow builds the Dockerfile with it",
    "python3 -m pip install --user --break-system-packages --requirement "
    'requirements/rig.txt "numpy==1.26.4"': "changes this computer",
    "make PYTHON=python3.12 setup": "fetches packages; the workflow does it with four versions",
    "make test": "is what runs these commands",
    "make test-slow": "is what runs these commands",
    f"{ANKLE} fetch-trials": "needs the internet; test_human_trials fetches from a local server",
    f"{ANKLE} fetch-trials --out trials": "needs the internet; test_human_trials, as above",
    f"{BENCHMARK}naming.py STUDY": "needs a finished blind study, which takes hours",
}
"""Commands that no test runs, with the reason."""

BEGIN_TIME = 15.0
"""[s] A command that takes long is stopped then: it has read its options and begun its work."""
START_TIME = 25.0
"""[s] Every node of a graph has started and said what keeps it from working."""
RECORDING_TIME = 40.0
"""[s] Longer than the estimator settles."""
PATIENCE = 900.0
"""[s] Many times what a command needs alone on two cores: other programs may take most of them."""
LONG_PATIENCE = 1800.0
"""[s] The same for the demo, the courses of a benchmark and the smallest studies."""


@dataclass(frozen=True)
class Run:
    """States how a command is run.

    Attributes
    ----------
    stopped
        Seconds after which it gets Ctrl-C; 0 where it ends by itself.
    well
        Whether it ends without an error behind Ctrl-C, as a node or a graph does.
    beside
        The command that starts what has to run meanwhile; empty for none.
    before
        Commands that bring what runs beside into the state that the page supposes.
    code
        What it returns at its end.
    says
        What it then says.
    quick
        Whether `make test` runs it, too.
    patience
        Seconds within which it has to end.
    live
        Whether it is a graph, or starts one.
    asks_shell
        Whether it looks which shell has started it.
    """

    stopped: float = 0.0
    well: bool = False
    beside: str = ""
    before: tuple[str, ...] = ()
    code: int = 0
    says: str = ""
    quick: bool = False
    patience: float = PATIENCE
    live: bool = False
    asks_shell: bool = False


QUICK_RUN = Run(quick=True)
LONG_RUN = Run(patience=LONG_PATIENCE)
BEGUN_RUN = Run(stopped=BEGIN_TIME)
BEGUN_LIVE_RUN = replace(BEGUN_RUN, live=True)
LIVE_RUN = Run(live=True)
GRAPH_RUN = Run(stopped=START_TIME, well=True, live=True)
BESIDE_LABORATORY = Run(beside=f"{ANKLE} up simulated", live=True)
BESIDE_RIG = Run(beside=f"{ANKLE} up rig --emulator", live=True)
BESIDE_PLATE = Run(
    beside=f"{ANKLE} up {ROOT / 'test' / 'plate_to_calibrate.yaml'}",
    patience=LONG_PATIENCE,
    live=True,
)
BESIDE_READER = Run(
    beside=f"{ANKLE} run impedance_estimator impedance_estimator", patience=LONG_PATIENCE, live=True
)
MISSING_ARGUMENT = Run(code=2, says="Missing argument", quick=True)
MISSING_VALUE = Run(code=2, says="requires an argument", quick=True)
PROPOSAL = Run(code=1, says="nothing is imported yet: type the line above", quick=True)

EXACT_RUNS = {
    "make setup": QUICK_RUN,
    "make manifests": QUICK_RUN,
    "make docs": LONG_RUN,
    f"{ANKLE} --help": QUICK_RUN,
    f"{ANKLE} --install-completion": Run(quick=True, asks_shell=True),
    f"{ANKLE} parameter-file": QUICK_RUN,
    f"{ANKLE} parameter-file --out mine.yaml": QUICK_RUN,
    f"{ANKLE} robustness --help": QUICK_RUN,
    f"{ANKLE} import trial.npz --help": QUICK_RUN,
    f"{ANKLE} run emg_driver emg_bridge --help": QUICK_RUN,
    f"{ANKLE} open session": QUICK_RUN,
    f"{ANKLE} estimate session --out estimates": QUICK_RUN,
    f"{ANKLE} emg session --out responses": QUICK_RUN,
    f"{ANKLE} validate anna=session --out report": QUICK_RUN,
    f"{ANKLE} export session --out session_csv": QUICK_RUN,
    f"{ANKLE} study init my_study": QUICK_RUN,
    f"{ANKLE} study add my_study session --subject S07 --visit 3": QUICK_RUN,
    f"{ANKLE} import example.csv": PROPOSAL,
    f"{ANKLE} import trial.csv": PROPOSAL,
    f"{PYTHON} test/documented_runs.py": QUICK_RUN,
    f"{PYTHON} examples/add_a_term.py": QUICK_RUN,
    f"{PYTHON} examples/own_link.py": QUICK_RUN,
    # A sentence names the verb, or an option of it.
    **dict.fromkeys(
        [f"{ANKLE} {verb}" for verb in ("estimate", "validate", "diagnose", "emg", "study run")],
        MISSING_ARGUMENT,
    ),
    f"{ANKLE} import --rig rig.yaml": MISSING_ARGUMENT,
    f"{ANKLE} investigate": MISSING_ARGUMENT,
    f"{ANKLE} estimate --algorithm": MISSING_VALUE,
    f"{ANKLE} up --sidecar": MISSING_VALUE,
    f"{ANKLE} up --params-file": MISSING_VALUE,
    # The file of the line is written by the reader.
    f"{ANKLE} up rig --set ankle_actuator_driver.link=ethercat": Run(
        code=1, says="'link' = 'ethercat' is refused", live=True
    ),
    f"{ANKLE} rig start": replace(BESIDE_RIG, before=(f"{ANKLE} rig stop", f"{ANKLE} rig arm")),
    f"{ANKLE} rig reset-fault": replace(
        BESIDE_RIG, before=(f"{ANKLE} rig faults emergency_stop=1", f"{ANKLE} rig faults none")
    ),
    f"{ANKLE} calibrate rig BAG --out from_bag.yaml": LIVE_RUN,
    f"{ANKLE} calibrate session BAG": Run(),
}
"""Commands that are run otherwise than what their beginning says."""

RUNS_BY_BEGINNING = {
    f"{ANKLE} up": GRAPH_RUN,
    f"{ANKLE} run": GRAPH_RUN,
    f"{ANKLE} echo": replace(BESIDE_LABORATORY, stopped=BEGIN_TIME, well=True, says="K[N.m/rad]"),
    f"{ANKLE} record": replace(BESIDE_LABORATORY, stopped=RECORDING_TIME, well=True),
    f"{ANKLE} replay session --topics /emg/samples": replace(
        BESIDE_READER, beside=f"{ANKLE} run emg_driver emg_outlet"
    ),
    f"{ANKLE} replay": BESIDE_READER,
    f"{ANKLE} params emg_bridge": Run(beside=f"{ANKLE} run emg_driver emg_bridge", live=True),
    f"{ANKLE} params": BESIDE_LABORATORY,
    f"{ANKLE} rig": BESIDE_RIG,
    f"{ANKLE} calibrate rig --simulated": replace(LIVE_RUN, patience=LONG_PATIENCE),
    f"{ANKLE} calibrate rig": BESIDE_PLATE,
    f"{ANKLE} calibrate session": replace(BESIDE_LABORATORY, patience=LONG_PATIENCE),
    f"{ANKLE} investigate": replace(BESIDE_LABORATORY, stopped=BEGIN_TIME),
    "make demo": replace(LONG_RUN, live=True),
    f"{ANKLE} demo": BEGUN_LIVE_RUN,
    f"{ANKLE} robustness --quick": LONG_RUN,
    f"{ANKLE} robustness": BEGUN_RUN,
    f"{ANKLE} blind": BEGUN_RUN,
    f"{ANKLE} table2 --quick": LONG_RUN,
    f"{ANKLE} table2": BEGUN_RUN,
    f"{ANKLE} virtual-study": BEGUN_RUN,
    "make ": BEGUN_LIVE_RUN,
    STUDY: BEGUN_RUN,
    **{
        f"{BENCHMARK}{name}.py": LONG_RUN
        for name in (
            *("course_trends", "interval_coverage", "offline", "simulation", "estimators"),
            *("standstills", "real_trials"),
        )
    },
    BENCHMARK: BEGUN_LIVE_RUN,
    f"{ANKLE} ": Run(),
    f"{PYTHON} ": Run(),
    f"ANKLE_SCREENSHOTS=docs {PYTHON} ": Run(),
}
"""The first beginning that a command has says how it is run."""


def run_of(line):
    """Return how a command is run; a `KeyError` names one for which nothing is stated."""
    if line in EXACT_RUNS:
        return EXACT_RUNS[line]
    for beginning, run in RUNS_BY_BEGINNING.items():
        if line.startswith(beginning):
            return run
    raise KeyError(line)


def documented():
    """Return each command once, with the first page that shows it."""
    found = {}
    for page in PAGES:
        for line in commands(page):
            found.setdefault(line, page.relative_to(ROOT))
    return [(page, line) for line, page in found.items()]


def to_run(live):
    """Return page, command and how it is run, of those that are run; of the live ones or others."""
    kept = [(page, line) for page, line in documented() if line not in NOT_RUN]
    runs = [(page, line, run_of(line)) for page, line in kept if words_of(line)[0] != "ros2"]
    return [one for one in runs if one[2].live == live]


def main():
    """Count the commands."""
    lines = documented()
    runs = [run for live in (False, True) for _, _, run in to_run(live)]
    print(f"{len(lines)} commands are documented, on {len({page for page, _ in lines})} pages")
    quick = sum(run.quick for run in runs)
    print(f"{quick} are run by `make test`, {len(runs) - quick} by `make test-slow`")
    print(f"    {sum(run.stopped > 0 for run in runs)} of them are stopped once they work")
    print(f"{len(lines) - len(runs) - len(NOT_RUN)} of ros2 are compared with the packages")
    print(f"{len(NOT_RUN)} are not run:")
    for line, reason in NOT_RUN.items():
        print(f"    {line}: {reason}")


if __name__ == "__main__":
    main()
