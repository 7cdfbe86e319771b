"""A session with the step of calibration, in virtual time."""

import asyncio

from laboratory import (
    CALIBRATED,
    FakeCalibration,
    FakeEstimator,
    FakeRig,
    FakeSubject,
    short_protocol,
)

from biofeedback.live_signals import LiveSignals
from biofeedback.session.commands import Command
from biofeedback.session.runner import SessionRunner
from biofeedback.session.session_program import Session

PERIOD = 1 / 30
NAME = "session_calibration"


class CalibratedSession:
    """A session with the step, in virtual time."""

    def __init__(self, folder, file_checks=None):
        self.rig, self.events, self.calibration = FakeRig(), [], FakeCalibration()
        self.estimator, self.signals = FakeEstimator(), LiveSignals()
        self.session = Session(short_protocol(folder, baseline=60, more=CALIBRATED))
        self.now = 1000.0
        self.runner = SessionRunner(
            self.session,
            self.signals,
            self.rig,
            FakeSubject(),
            self.events.append,
            lambda: self.now,
            calibration=self.calibration,
            estimator=self.estimator,
            file_checks=file_checks,
        )
        self.runner.record(self.runner.checks.read_files(self.now))
        self.pass_time(0.1)

    def diagnose(self, at_once=False):
        """Start, and end the diagnosis; the estimator has the model and does not use it yet."""
        self.estimator.at_once = at_once
        self.start()
        self.calibration.finish(found="tissue friction")
        self.pass_time(0.1)

    def pass_time(self, seconds):
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            self.runner.hear_operator(self.now)
            self.runner.tick(self.now, self.now)

    def command(self, name, **values):
        asyncio.run(self.runner.carry_out(Command(1, name, values)))
        self.rig.state = {"arm": "armed", "start": "running"}.get(name, self.rig.state)

    def start(self):
        self.command("check", check="warm_up", act="begin")
        self.command("arm")
        self.command("start")
        self.pass_time(0.5)

    @property
    def check(self):
        checks = self.runner.checks.entries
        return checks.states[NAME], checks.results[NAME]
