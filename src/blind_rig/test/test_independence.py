"""The adversary shares no physics with the software under test."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "blind_rig"
SOFTWARE_UNDER_TEST = {"ankle_physics", "model_discrepancy", "ankle_sim"}
OWN = {"blind_rig", "ankle_interfaces", "session_recorder"}
LIBRARIES = {
    "numpy",
    "scipy",
    "numba",
    "mujoco",
    "dask",
    "rich",
    "matplotlib",
    "cryptography",
    "yaml",
}
MODULES = sorted(PACKAGE.glob("*.py"))


def _roots(tree: ast.AST) -> set[str]:
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide where code comes from"
            found.add((node.module or "").split(".")[0])
        elif isinstance(node, ast.Call) and isinstance(node.func, (ast.Name, ast.Attribute)):
            name = node.func.id if isinstance(node.func, ast.Name) else node.func.attr
            assert name not in ("__import__", "import_module"), "imports by name cannot be checked"
    return found


@pytest.mark.parametrize("module", MODULES, ids=lambda path: path.stem)
def test_imports_only_what_is_allowed(module: Path) -> None:
    roots = _roots(ast.parse(module.read_text()))
    assert not roots & SOFTWARE_UNDER_TEST
    assert roots <= OWN | LIBRARIES | set(sys.stdlib_module_names)


def test_from_the_software_only_wire_format_bag_writer_and_errors() -> None:
    allowed = {"ankle_interfaces.block", "ankle_interfaces.errors", "session_recorder.bag_writer"}
    for module in MODULES:
        for node in ast.walk(ast.parse(module.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in (
                "ankle_interfaces",
                "session_recorder",
            ):
                assert node.module in allowed, f"{module.name} imports {node.module}"


def test_the_product_imports_nothing_of_it() -> None:
    """Only the studies, which are no part of a laboratory's graph, know the rig of the proofs."""
    product = [
        path
        for path in PACKAGE.parents[1].glob("*/*/**/*.py")
        if path.relative_to(PACKAGE.parents[1]).parts[0] not in ("blind_rig", "simulation_study")
    ]
    assert len(product) > 300
    assert not [path for path in product if "blind_rig" in _imports(path)]


def _imports(path: Path) -> set[str]:
    nodes = ast.walk(ast.parse(path.read_text()))
    return {
        name.split(".")[0]
        for node in nodes
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }


def test_runs_where_the_software_under_test_cannot_be_imported(tmp_path: Path) -> None:
    script = f"""
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in {sorted(SOFTWARE_UNDER_TEST)!r}:
            raise ImportError('blocked: ' + name)
sys.meta_path.insert(0, Blocked())
sys.path.insert(0, {str(PACKAGE.parent)!r})
from pathlib import Path
from blind_rig.anatomy import Setup
from blind_rig.bag import Contents, write_bag
from blind_rig.protocols import Protocol
from blind_rig.trial import Trial, record, run
trial = Trial(Setup(), Protocol('random_levels', 0.03, 0.02, 2.0), 1000.0, 0.1, 1)
write_bag(Path({str(tmp_path / "case")!r}), record(trial, run(trial)), 1000.0,
          Contents(True, True, True))
assert not set(sys.modules) & set({sorted(SOFTWARE_UNDER_TEST)!r})
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "case" / "metadata.yaml").exists()
