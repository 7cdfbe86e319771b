"""The third engine shares no code with any other package of the workspace."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "second_rig"
WORKSPACE = PACKAGE.parents[1]
LIBRARIES = {"numpy", "scipy", "numba"}
OTHERS = {path.parent.name for path in WORKSPACE.glob("*/setup.py")} - {"second_rig"}
MODULES = sorted(PACKAGE.rglob("*.py"))
KNOW_THE_RIGS_OF_THE_PROOFS = ("second_rig", "simulation_study")


def _imported(path: Path) -> set[str]:
    """Packages that a module imports; an import that cannot be read off is an error."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide where code comes from"
            found.add((node.module or "").split(".")[0])
        elif isinstance(node, ast.Call) and isinstance(node.func, (ast.Name, ast.Attribute)):
            name = node.func.id if isinstance(node.func, ast.Name) else node.func.attr
            assert name not in ("__import__", "import_module"), "imports by name cannot be checked"
    return found


@pytest.mark.parametrize(
    "module", MODULES, ids=lambda path: str(path.relative_to(PACKAGE).with_suffix(""))
)
def test_imports_numpy_scipy_numba_and_itself_alone(module: Path) -> None:
    assert _imported(module) <= {"second_rig"} | LIBRARIES | set(sys.stdlib_module_names)


def test_the_product_imports_nothing_of_it() -> None:
    product = [
        path
        for path in WORKSPACE.glob("*/*/**/*.py")
        if path.relative_to(WORKSPACE).parts[0] not in KNOW_THE_RIGS_OF_THE_PROOFS
    ]
    assert len(product) > 300
    assert not [path for path in product if _uses(path)]


def _uses(path: Path) -> bool:
    text = path.read_text()
    names: set[str] = set()
    for node in ast.walk(ast.parse(text)) if "second_rig" in text else ():
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add((node.module or "").split(".")[0])
    return "second_rig" in names


def test_records_where_no_other_package_can_be_imported() -> None:
    assert "model_discrepancy" in OTHERS
    script = f"""
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in {sorted(OTHERS)!r}:
            raise ImportError('blocked: ' + name)
sys.meta_path.insert(0, Blocked())
sys.path.insert(0, {str(PACKAGE.parent)!r})
from second_rig.draw import draw_cases
from second_rig.recording import record
print(len(record(draw_cases(1)[0], 2.0).torque))
assert not set(sys.modules) & set({sorted(OTHERS)!r})
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=240, check=False
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) >= 2000
