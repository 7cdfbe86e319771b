"""Makes what a documented command reads, under the name that the documentation gives it."""

import re
import shutil
import subprocess
import sys
from datetime import datetime, timezone
from functools import cache
from pathlib import Path

from documented_commands import ROOT, words_of
from documented_runs import LONG_PATIENCE

from ankle_physics.model import Model
from ankle_physics.rig_file import Measured, RigFile
from session_analysis.virtual_study import VirtualSession, record_session

EXAMPLE = ROOT / "examples" / "simulate_a_model.py"
OUTPUTS = ("--out", "-o", "init")
"""What stands before the name of what a command writes."""
PLACEHOLDER = r"[A-Z]+"
"""A word that the reader replaces; in another command it stands for something else."""
SECONDS = 60
"""[s] As in the tutorial: long enough to be estimated and diagnosed."""


def ankle(*words, cwd):
    """Run the command; what it writes is wanted here."""
    program = [sys.executable, "-m", "ankle_bringup.command_line", *map(str, words)]
    subprocess.run(program, cwd=cwd, check=True, capture_output=True, timeout=LONG_PATIENCE)


class Inputs:
    """Makes each kind of input once, and copies it to where a command reads it."""

    def __init__(self, folder):
        self.folder = folder

    def provide(self, line, page, folder):
        """Copy what a command reads and none before it wrote into the folder of its page."""
        words = words_of(line)
        for before, word in zip(["", *words], words, strict=False):
            name = word.partition("=")[2] if re.fullmatch(r"[a-z_.]+=[\w.]+", word) else word
            place = folder / name
            if re.fullmatch(PLACEHOLDER, name) and place.exists():
                shutil.rmtree(place)
            kind = KINDS.get((line, name)) or KINDS.get((page, name)) or KINDS.get(name)
            if kind is not None and before not in OUTPUTS and not place.exists():
                place.parent.mkdir(parents=True, exist_ok=True)
                made = self.made(kind)
                (shutil.copytree if made.is_dir() else shutil.copy)(made, place)

    @cache  # noqa: B019
    def made(self, kind):
        """Return the file or folder of a kind."""
        place = self.folder / kind
        getattr(self, kind)(place)
        return place

    def session(self, place):
        """Simulate a subject who holds one torque, with EMG."""
        record_session(VirtualSession(1, (1, 0), hold=50.0, reach=35.0), place)

    def table(self, place):
        """Write the table of the tutorial."""
        words = [
            sys.executable,
            EXAMPLE,
            "behind_table",
            "--seconds",
            str(SECONDS),
            "--table",
            place,
        ]
        subprocess.run(
            words, cwd=self.folder, check=True, capture_output=True, timeout=LONG_PATIENCE
        )

    def bag(self, place):
        """Simulate the recording behind the table."""
        self.made("table")
        shutil.copytree(self.folder / "behind_table", place)

    def trials(self, place):
        """Make a folder as `ankle fetch-trials` leaves it."""
        shutil.copytree(self.made("bag"), place / "trial_1")

    def estimates(self, place):
        """Estimate the recording."""
        ankle("estimate", self.made("bag"), "--out", place, cwd=self.folder)

    def diagnosis(self, place):
        """Diagnose the session."""
        ankle("diagnose", self.made("session"), "--out", place, cwd=self.folder)

    def subject(self, place):
        """Take the model of the subject that a calibration of the session finds."""
        ankle("calibrate", "session", self.made("session"), "--out", place, cwd=self.folder)

    def rig(self, place):
        """Describe a rig with a heavy plate, a late torque and a servo that gives way."""
        terms = {"footplate_inertia": {"Ip": 0.0046}, "servo_compliance": {"k_a": 2300.0}}
        RigFile(
            "laboratory 2",
            datetime(2026, 1, 1, tzinfo=timezone.utc),
            torque_delay=Measured(0.0007),
            zero_position=0.0,
            zero_torque=0.0,
            noise={"position[rad]": 4.5e-5, "velocity[rad/s]": 6.5e-3, "torque[N.m]": 0.14},
            bandwidth=Measured(33.0),
            damping=Measured(0.65),
            model=Model.of(terms),
        ).save(place)

    def faultless_rig(self, place):
        """Describe the rig of `ankle up simulated`."""
        noise = {"position[rad]": 4.5e-5, "velocity[rad/s]": 6.5e-3, "torque[N.m]": 0.14}
        RigFile("simulated", datetime(2026, 1, 1, tzinfo=timezone.utc), noise=noise).save(place)

    def plate_bag(self, place):
        """Record the movements of a rig's calibration."""
        hidden = self.made("rig")
        words = ("--simulated", hidden, "--bag", place, "--out", "found.yaml")
        ankle("calibrate", "rig", *words, cwd=self.folder)

    def course_record(self, place):
        """Let a simulated subject do the sessions of a course."""
        ankle("course", "down_training", "--simulate", "--out", "done", cwd=self.folder)
        shutil.copy(self.folder / "done" / "record.yaml", place)

    def study(self, place):
        """Begin a study of one recording."""
        ankle("study", "init", place, cwd=self.folder)
        add = ("study", "add", place, self.made("session"), "--subject", "S07", "--visit", "3")
        ankle(*add, cwd=self.folder)

    def parameters(self, place):
        """Write every parameter."""
        ankle("parameter-file", "--out", place, cwd=self.folder)

    def terms(self, place):
        """Take the example of a term."""
        shutil.copytree(ROOT / "examples" / "terms", place)


KINDS = {
    **dict.fromkeys(["session", "monday_3", "monday_1", "tuesday_1"], "session"),
    **dict.fromkeys(["BAG", "my_bag", "A", "B", "C", "SIMULATED", "RECORDED"], "bag"),
    **dict.fromkeys(["simulated", "imported"], "bag"),
    **dict.fromkeys(["example.csv", "trial.csv"], "table"),
    **dict.fromkeys(["rig.yaml", "hidden.yaml"], "rig"),
    **dict.fromkeys(["DIAGNOSIS", "diagnosis"], "diagnosis"),
    "estimates": "estimates",
    "subject.yaml": "subject",
    "record.yaml": "course_record",
    "mine.yaml": "parameters",
    "my_study": "study",
    **dict.fromkeys(["trials", "RECORDINGS"], "trials"),
    "trials/trial_1": "bag",
    (".venv/bin/ankle calibrate rig BAG --out from_bag.yaml", "BAG"): "plate_bag",
    (
        ".venv/bin/ankle calibrate session --seconds 90 --rig rig.yaml --out subject.yaml",
        "rig.yaml",
    ): "faultless_rig",
    (Path("docs/physics.md"), "FOLDER"): "terms",
}
"""The kind behind each name; for one page or command alone where a pair has it."""
