"""Nothing of the emulated rig is compiled while it runs: that would keep it from the line for
longer than the watchdog of the driver allows.
"""

import gc
import subprocess
import sys
from pathlib import Path

from numba.core.dispatcher import Dispatcher
from virtual_laboratory import RATE, VirtualLaboratory

from rig_emulator.emulated_ankle import EmulatedAnkle
from rig_emulator.settings import Settings

RUN = 3.0  # s; the perturbation begins after the soft start


class WatchedAnkle(EmulatedAnkle):
    """The emulated ankle, with the velocity that the virtual laboratory keeps."""

    def run(self, command):
        samples = super().run(command)
        self.velocity = samples[:, 1]
        return samples


def compiled():
    """Return the names of all compiled functions with their number of signatures."""
    functions = [item for item in gc.get_objects() if isinstance(item, Dispatcher)]
    return {function.__qualname__: len(function.signatures) for function in functions}


def compiled_while_running():
    """Return what a session on the emulated rig compiles from arming on."""
    setup = Settings.defaults().setup
    laboratory = VirtualLaboratory(plant=WatchedAnkle(setup, RATE, True, print))
    laboratory.run(1.5)
    before = compiled()
    laboratory.running(RUN)
    assert laboratory.command("stop").done
    laboratory.run(1.0)
    return {name: count for name, count in compiled().items() if count != before.get(name, 0)}


def test_arming_moving_and_stopping_compile_nothing():
    script = "import test_emulator_compiles_before as t; print(sorted(t.compiled_while_running()))"
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "[]"
