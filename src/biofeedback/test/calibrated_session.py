"""A session with the step of calibration, in virtual time."""

from laboratory import CALIBRATED, FakeCalibration, FakeEstimator, short_protocol
from virtual_session import VirtualSession

NAME = "session_calibration"


class CalibratedSession(VirtualSession):
    """A session with the step, in virtual time."""

    def __init__(self, folder, file_checks=None):
        self.calibration, self.estimator = FakeCalibration(), FakeEstimator()
        super().__init__(
            short_protocol(folder, baseline=60, more=CALIBRATED),
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

    def start(self):
        self.command("check", check="warm_up", act="begin")
        self.command("arm")
        self.command("start")
        self.pass_time(0.5)

    @property
    def check(self):
        checks = self.runner.checks.entries
        return checks.states[NAME], checks.results[NAME]
