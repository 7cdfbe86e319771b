"""An extension is as many files as CONTRIBUTING says.

Each is made in a copy of the workspace, where everything else has to find it without a change, and
where the test at the end of its recipe has to pass (for an estimator that takes a minute, and every
estimator passes it in the same way).
"""

import os
import re
import shlex
import shutil
import subprocess
import sys

import pytest
from documented_commands import ROOT

SAMPLES = '(TIME_COLUMN, "position[rad]", "velocity[rad/s]", "torque[N.m]"),'
OPTIONAL = 'optional=("velocity[rad/s]",),\n    plots=(("position[rad]"'
ESTIMATOR = '''"""CE under another name."""

from impedance_estimator.algorithms.conceptual_experimental import ConceptualExperimental


class Mine(ConceptualExperimental):
    """Gives what CE gives."""

    name = "mine"
    title = "an estimator of one's own"


Algorithm = Mine
'''
VERB = '''"""`ankle double-it`: an example."""


def verb(number: float) -> dict[str, float]:
    """Double a number.

    Example: ankle double-it 2
    """
    return {"twice[1]": 2 * number}
'''
OTHER_FILES = {
    "term": """
import numpy as np
from types import SimpleNamespace
from docs_reference import terms_page
from ankle_physics.model import PAPER_TERMS, Model
from ankle_physics.term import term_library
from ankle_physics.virtual_rig import simulate
from ankle_sim.parameters import model_parameters
from model_discrepancy.search.screening import candidates
assert "cubic_stiffness" in term_library()
assert "cubic_stiffness" in candidates(SimpleNamespace(terms=list(PAPER_TERMS)))
model = Model.of({**{name: {} for name in PAPER_TERMS}, "cubic_stiffness": {"k3": 2000.0}})
assert "cubic_stiffness.k3" in model_parameters(model)
held = np.tile([0.1, 0.0, 0.0], (512, 1))
torque = [simulate(held, 2048.0, one).clean[-1, 2] for one in (model, Model.of(None))]
assert abs(torque[0] - torque[1] - 2.0) < 0.2, torque
assert "cubic_stiffness" in terms_page()
""",
    "estimator": """
import numpy as np
from impedance_estimator.algorithms import ALGORITHMS
from impedance_estimator.impedance_estimator_node import PARAMETERS
from impedance_estimator.stream import EstimateStream
assert "mine" in ALGORITHMS
(algorithm,) = [one for one in PARAMETERS if one.name == "algorithm"]
assert "mine" in algorithm.choices and "an estimator of one's own" in algorithm.description
assert EstimateStream("mine").settings == EstimateStream("CE").settings
from typer.testing import CliRunner
from ankle_bringup.command_line import app
refused = CliRunner().invoke(app, ["estimate", "nowhere", "--algorithm", "yours"]).exception
assert "mine" in str(refused)
""",
    "transport": """
import time
from ankle_actuator_driver import settings
from ankle_actuator_driver.ankle_actuator_driver_node import PARAMETERS
from ankle_actuator_driver.link.rig_link import Clocks, link_names, open_link
from ankle_actuator_driver.safety.rig import DeviceState, Order, Wanted
assert "echo_line" in link_names()
values = {one.name: one.default for one in settings.PARAMETERS}
line = open_link("echo_line", values, Clocks(lambda: (time.monotonic(), time.time())))
line.send(Order(Wanted.HOLD, resets=0))
assert line.receive(0.1)[0].event.state is DeviceState.HOLD
""",
    "verb": """
import json
from typer.testing import CliRunner
from ankle_bringup.command_line import app
assert "double-it" in CliRunner().invoke(app, ["--help"]).output
assert json.loads(CliRunner().invoke(app, ["double-it", "2", "--json"]).output) == {"twice[1]": 4}
""",
    "column": """
import numpy as np
from ankle_interfaces.block import Block, require_columns, select_columns
from ankle_interfaces.topics import ANKLE_SAMPLES
from impedance_estimator.stream import POSITION, TORQUE, VELOCITY
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
assert ANKLE_SAMPLES.columns[-1] == "knee[rad]"
data = np.column_stack([np.arange(1024) / 2048, np.zeros((1024, 3)), np.full(1024, 0.5)])
old = Block(ANKLE_SAMPLES.columns_of(4), data[:, :4])
new = Block(ANKLE_SAMPLES.columns, data)
for block in (old, new):
    wanted = require_columns(block, (POSITION, VELOCITY, TORQUE), "ankle/samples")
    assert (wanted.data == data[:, :4]).all()
with BagWriter("bag") as bag:
    bag.add_topic(ANKLE_SAMPLES.absolute)
    bag.write_block(ANKLE_SAMPLES.absolute, new)
read = next(iter(BagReader("bag").blocks(ANKLE_SAMPLES.absolute)))
wanted, _ = select_columns(read, ("knee[rad]",), "ankle/samples", ())
assert (wanted.data[:, 1] == 0.5).all()
wanted, _ = select_columns(old, ("position[rad]",), "ankle/samples", ("knee[rad]",))
""",
}


HEADINGS = {
    "term": "A term",
    "transport": "A line to a rig",
    "verb": "A verb",
    "column": "A column",
}


def recipes_test(what):
    """Return the arguments of Python that run the test at the end of a recipe."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    (recipe,) = re.findall(rf"^## {HEADINGS[what]}\b.*?(?=^## |\Z)", text, re.M | re.S)
    (line,) = re.findall(r"^    \.venv/bin/python -m pytest (.*)$", recipe, re.M)
    return ["-m", "pytest", *shlex.split(line), "-m", "not live"]


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """The packages, without their tests, and with what is compiled of them."""
    folder = tmp_path_factory.mktemp("extensions")
    for package in sorted(path.parent for path in (ROOT / "src").glob("*/setup.py")):
        shutil.copytree(
            package / package.name,
            folder / "src" / package.name / package.name,
            ignore=shutil.ignore_patterns("*.tmp.*", "*.pyc.*"),  # being written by another test
        )
    return folder


def changed(workspace):
    """The text of every file of Python, by its path."""
    return {path: path.read_text() for path in workspace.rglob("*.py")}


def extend(what, workspace):
    """Write what the recipe says, and no more."""
    source = workspace / "src"
    if what == "term":
        package = source / "ankle_physics" / "ankle_physics"
        shutil.copy(ROOT / "examples" / "terms" / "cubic_stiffness.py", package / "terms")
    elif what == "estimator":
        package = source / "impedance_estimator" / "impedance_estimator"
        (package / "algorithms" / "mine.py").write_text(ESTIMATOR)
    elif what == "transport":
        package = source / "ankle_actuator_driver" / "ankle_actuator_driver"
        shutil.copy(ROOT / "examples" / "links" / "echo_line.py", package / "link")
    elif what == "verb":
        file = source / "ankle_bringup" / "ankle_bringup" / "verbs" / "double_it.py"
        file.write_text(VERB)
    else:
        file = source / "ankle_interfaces" / "ankle_interfaces" / "topics.py"
        text = file.read_text()
        assert text.count(SAMPLES) == text.count(OPTIONAL) == 1
        text = text.replace(SAMPLES, SAMPLES[:-2] + ', "knee[rad]"),')
        file.write_text(text.replace(OPTIONAL, OPTIONAL.replace('",)', '", "knee[rad]")', 1)))


@pytest.mark.parametrize("what", OTHER_FILES)
def test_an_extension_is_one_file(what, workspace):
    """One file is changed; a column needs two more, publisher and reader, which others may add."""
    before = changed(workspace)
    extend(what, workspace)
    assert sum(before.get(path) != text for path, text in changed(workspace).items()) == 1
    packages = [str(path) for path in (workspace / "src").iterdir()]
    reference = f"import sys; sys.path.insert(0, {str(ROOT / 'docs')!r})\n"
    program = OTHER_FILES[what].replace("docs_reference", "generated_reference")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(packages)}
    for arguments, folder in (
        (["-c", reference + program], workspace),
        *([(recipes_test(what), ROOT)] if what in HEADINGS else []),
    ):
        done = subprocess.run(
            [sys.executable, *arguments],
            env=environment,
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=280,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
