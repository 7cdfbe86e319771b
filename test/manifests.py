"""What the manifests must say: the dependencies of each package, found from its imports."""

import ast
import re
import sys
from functools import cache
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
PACKAGES = sorted(path.parent.name for path in ROOT.glob("src/*/package.xml"))

# Module: key that rosdep resolves on Ubuntu 24.04 (rosdep/python.yaml of ros/rosdistro).
ROSDEP_KEYS = {
    "aiohttp": "python3-aiohttp",
    "cryptography": "python3-cryptography",
    "h5py": "python3-h5py",
    "hypothesis": "python3-hypothesis",
    "matplotlib": "python3-matplotlib",
    "numpy": "python3-numpy",
    "psutil": "python3-psutil",
    "requests": "python3-requests",
    "pytest": "python3-pytest",
    "scipy": "python3-scipy",
    "yaml": "python3-yaml",
}
# Module: distribution of PyPI, for what rosdep lacks there. `python3-numba` is a key, but for
# Ubuntu 18.04 and 20.04 only. The step that installs these is in docs/install.md.
FROM_PYPI = {
    "cpuinfo": "py-cpuinfo",
    "dask": "dask",
    "distributed": "distributed",
    "edfio": "edfio",
    "ezc3d": "ezc3d",
    "mcap": "mcap",
    "mcap_ros2": "mcap-ros2-support",
    "mujoco": "mujoco",
    "numba": "numba",
    "nptdms": "nptdms",
    "openpyxl": "openpyxl",
    "playwright": "playwright",
    "plotly": "plotly",
    "pooch": "pooch",
    "pyarrow": "pyarrow",
    "pylsl": "pylsl",
    "rich": "rich",
    "rosbags": "rosbags",
    "threadpoolctl": "threadpoolctl",
    "tqdm": "tqdm",
    "typer": "typer",
    "zstandard": "zstandard",
}
# ROS packages of Jazzy whose module has the package's name.
ROS = (
    "ament_index_python",
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "launch",
    "launch_ros",
    "lifecycle_msgs",
    "rcl_interfaces",
    "rclpy",
    "rosgraph_msgs",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
)


@cache
def modules_of(folder: Path) -> frozenset[str]:
    """Top-level modules that the Python files below a folder import, without the folder's own."""
    found: set[str] = set()
    own = {path.stem for path in folder.rglob("*.py")}
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                found.add(str(node.module).partition(".")[0])
    return frozenset(found - set(sys.stdlib_module_names) - (own - set(PACKAGES)))


def started_by(package: str) -> set[str]:
    """Packages whose nodes a package's graphs start."""
    found: set[str] = set()
    for path in (ROOT / "src" / package).rglob("*.yaml"):
        content = yaml.safe_load(path.read_text())
        if isinstance(content, dict) and isinstance(content.get("nodes"), list):
            found |= {node["package"] for node in content["nodes"]}
    return found


def imported(package: str) -> set[str]:
    """Modules that a package needs when it runs."""
    folder = ROOT / "src" / package
    found = set(modules_of(folder / package)) | started_by(package)
    if (folder / "launch").is_dir():
        found |= modules_of(folder / "launch")
    return found - {package}


def key_of(module: str) -> str | None:
    """The dependency of a manifest that a module stands for; None where PyPI has it.

    Raises
    ------
    LookupError
        Nobody has said where the module comes from.
    """
    if module in PACKAGES or module in ROS:
        return module
    if module in ROSDEP_KEYS:
        return ROSDEP_KEYS[module]
    if module in FROM_PYPI:
        return None
    raise LookupError(
        f"module '{module}': add it to ROS, ROSDEP_KEYS or FROM_PYPI in test/manifests.py"
    )


def needed(package: str) -> tuple[list[str], list[str]]:
    """The dependencies that a manifest must state: for running, and for testing besides."""
    run = {key for module in imported(package) if (key := key_of(module))}
    folder = ROOT / "src" / package / "test"
    tests = modules_of(folder) if folder.is_dir() else frozenset()
    # A package that needs this one to run cannot be a dependency of its tests: colcon would find a
    # circle. Those tests run where the whole workspace is built.
    keys = {
        key
        for module in {*tests, "pytest"} - {package}
        if (key := key_of(module)) and package not in everything_below(module)
    }
    return sorted(run, key=_order), sorted(keys - run, key=_order)


def everything_below(package: str) -> set[str]:
    """The packages of this workspace that a package needs to run, those behind them included."""
    found: set[str] = set()
    waiting = [package] if package in PACKAGES else []
    while waiting:
        for below in imported(waiting.pop()) & set(PACKAGES):
            if below not in found:
                found.add(below)
                waiting.append(below)
    return found


def _order(key: str) -> tuple[int, str]:
    return (0 if key in ROS else 1 if key in PACKAGES else 2, key)


def stated(package: str) -> tuple[list[str], list[str]]:
    """The dependencies that the manifest states: for running, and for testing."""
    text = (ROOT / "src" / package / "package.xml").read_text()
    return (
        re.findall(r"<(?:exec_depend|depend)>([^<]+)<", text),
        re.findall(r"<test_depend>([^<]+)<", text),
    )


def write(package: str) -> None:
    """Write the dependencies of a package into its manifest."""
    path = ROOT / "src" / package / "package.xml"
    run, tests = needed(package)
    lines = [f"  <exec_depend>{key}</exec_depend>\n" for key in run]
    lines += [f"  <test_depend>{key}</test_depend>\n" for key in tests]
    text = re.sub(r" *<(exec_|test_)?depend>[^<]*</(exec_|test_)?depend>\n", "", path.read_text())
    path.write_text(text.replace("  <export>\n", "".join(lines) + "  <export>\n"))


def write_script(package: str) -> None:
    """Write the description of a manifest into the set-up script."""
    folder = ROOT / "src" / package
    (said,) = re.findall(
        r"<description>([^<]*)</description>", (folder / "package.xml").read_text()
    )
    script = folder / "setup.py"
    text = re.sub(r'description=("[^"]*"\s*)+', f'description="{said}"', script.read_text())
    script.write_text(text)


if __name__ == "__main__":
    for name in PACKAGES:
        write(name)
        write_script(name)
