"""A session in virtual time: a runner without its thread."""

import asyncio
from dataclasses import replace

from laboratory import FakeRig, FakeSubject, short_protocol

from biofeedback.live_signals import LiveSignals
from biofeedback.session.commands import Command
from biofeedback.session.runner import SessionRunner
from biofeedback.session.session_program import RUNNING, Session

PERIOD = 1 / 30


class VirtualSession:
    """A runner without its thread, in virtual time, with an operator's page that can close.

    Parameters
    ----------
    protocol
        Of the session.
    parts
        Further arguments of the runner.
    """

    def __init__(self, protocol, **parts):
        self.rig, self.events = FakeRig(), []
        self.session = Session(protocol)
        self.now, self.signals = 1000.0, LiveSignals()
        self.runner = SessionRunner(
            self.session,
            self.signals,
            self.rig,
            FakeSubject(),
            self.events.append,
            lambda: self.now,
            **parts,
        )
        self.operator = True

    def pass_time(self, seconds):
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            if self.operator:
                self.runner.hear_operator(self.now)
            self.runner.tick(self.now, self.now)

    def command(self, name, **values):
        asyncio.run(self.runner.carry_out(Command(1, name, values)))
        self.rig.state = {"arm": "armed", "start": "running"}.get(name, self.rig.state)

    def run(self):
        self.command("arm")
        self.command("start")
        self.pass_time(2.0)
        assert self.session.state == RUNNING
        assert self.rig.requests == ["arm", "start"]


def short_session(folder, check_list=()):
    """A session of a short protocol, a tenth of a second old."""
    protocol = replace(short_protocol(folder, baseline=60), check_list=check_list)
    session = VirtualSession(protocol)
    session.pass_time(0.1)
    return session
