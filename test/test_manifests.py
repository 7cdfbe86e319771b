"""Each package's manifest against its imports, its set-up script and the requirements."""

import importlib
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest
from manifests import FROM_PYPI, PACKAGES, ROOT, imported, modules_of, needed, stated


@pytest.mark.parametrize("package", PACKAGES)
def test_a_manifest_states_what_is_imported_and_nothing_else(package):
    run, tests = stated(package)
    assert (sorted(run), sorted(tests)) == tuple(map(sorted, needed(package))), (
        "`make manifests` writes what is imported"
    )


@pytest.mark.parametrize("package", PACKAGES)
def test_manifest_and_set_up_script_say_the_same(package):
    folder = ROOT / "src" / package
    manifest, script = (folder / "package.xml").read_text(), (folder / "setup.py").read_text()
    for key in ("version", "description", "license"):
        (value,) = re.findall(rf"<{key}>([^<]*)</{key}>", manifest)
        assert f'{key}="{value}"' in script
    assert 'extras_require={"test": ["pytest"]}' in script


@pytest.mark.parametrize("package", PACKAGES)
def test_colcon_has_tests_to_run_that_only_compute(package):
    files = (ROOT / "src" / package / "test").glob("test_*.py")
    assert any("\npytestmark = pytest.mark.live" not in file.read_text() for file in files)


def test_every_package_is_type_checked():
    done = subprocess.run(
        ["make", "--dry-run", "lint"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    (checked,) = re.findall(r"/mypy (.*)", done.stdout)
    assert {f"src/{package}/{package}" for package in PACKAGES} <= set(checked.split())


def test_what_rosdep_lacks_is_in_the_requirements():
    named = {
        re.split(r"[=<>~!\[; ]", line)[0].lower()
        for path in (ROOT / "requirements").glob("*.txt")
        for line in path.read_text().splitlines()
        if line and line[0].isalpha()
    }
    modules = {module for package in PACKAGES for module in imported(package)}
    for module in sorted(modules & set(FROM_PYPI)):
        assert FROM_PYPI[module].lower() in named


def test_the_workspace_has_no_circle():
    colcon = Path(sys.executable).parent / "colcon"
    if not colcon.exists():
        pytest.skip("colcon is not installed beside this Python")
    listed = subprocess.run(
        [colcon, "list", "--topological-order", "--names-only", "--base-paths", "src"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert listed.returncode == 0, listed.stderr
    assert sorted(listed.stdout.split()) == PACKAGES


def test_a_module_of_unknown_origin_is_named(tmp_path):
    (tmp_path / "probe.py").write_text(
        "import os\nimport numpy.linalg\nfrom nowhere.at import all\n"
    )
    assert modules_of(tmp_path) == {"numpy", "nowhere"}


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_exports_what_it_says_and_is_light_to_import(package):
    program = (
        f"import sys, {package}; "
        "heavy = {'numpy', 'scipy', 'numba', 'rclpy', 'mujoco', 'matplotlib'} & set(sys.modules); "
        f"[getattr({package}, name) for name in {package}.__all__]; print(heavy)"
    )
    shown = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False
    )
    assert shown.returncode == 0, shown.stderr
    assert shown.stdout.strip() == "set()"


@pytest.mark.parametrize("package", PACKAGES)
def test_an_exported_name_is_not_that_of_a_module_which_would_hide_it(package):
    module = importlib.import_module(package)
    assert module.__all__ == sorted(set(module.__all__))
    modules = {found.name for found in pkgutil.iter_modules(module.__path__)}
    assert not modules & set(module.__all__)
    with pytest.raises(AttributeError, match=f"package '{package}' has no 'nobody'"):
        _ = module.nobody


OF_A_RIG = (
    "ankle_actuator_driver.ankle_actuator_driver_node",
    "ankle_actuator_driver.link.udp",
    "perturbation_generator.perturbation_generator_node",
    "session_recorder.record_node",
    "session_recorder.replay_node",
)


@pytest.mark.parametrize(
    ("requirements", "modules"),
    [
        (("rig",), OF_A_RIG),
        (("rig", "emulator"), (*OF_A_RIG, "rig_emulator.rig_emulator_node")),
    ],
)
def test_a_rigs_computer_needs_no_module_beside_its_requirements(requirements, modules):
    stated = "".join((ROOT / f"requirements/{name}.txt").read_text() for name in requirements)
    installed = set(re.findall(r"^[A-Za-z][\w-]*", stated, re.MULTILINE))
    from_apt = {"aiohttp", "cryptography", "h5py", "matplotlib", "numpy", "scipy"}
    named = FROM_PYPI | {name: name for name in from_apt}
    missing = sorted(module for module, name in named.items() if name not in installed)
    assert {"matplotlib", "mujoco"} <= set(missing)
    blocked = "".join(f"sys.modules[{module!r}] = None; " for module in missing)
    program = f"import sys; {blocked}import {', '.join(modules)}"
    shown = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False
    )
    assert shown.returncode == 0, shown.stderr
