"""A laboratory without ROS: the served session, signals that a test makes, a rig that keeps what it
was asked for.
"""

import asyncio
import datetime
import ipaddress
import math
import threading
import time
from pathlib import Path

import numpy as np
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

from biofeedback.errors import CommandError
from biofeedback.live_signals import LiveSignals
from biofeedback.session.devices import CalibrationEnd
from biofeedback.session.protocol import load_protocol
from biofeedback.session.runner import SessionRunner
from biofeedback.session.session_program import Session
from biofeedback.web.access import Access
from biofeedback.web.presenter import Presenter
from biofeedback.web.server import Server
from emg_driver.muscles import MUSCLES

RATE = 2048.0
PROTOCOL = """
title: A short session
"baseline[s]": {baseline}
"reach[s]": {reach}
"hold[s]": {hold}
"break[s]": 1
"torque_half_width[N.m]": 1.0
"level_half_width[1]": 0.15
blocks:
  - feedback: G
    holds:
      - {{"torque_target[N.m]": 0, "level[1]": 1.0}}
      - {{"torque_target[N.m]": -5, "level[1]": 0.7}}
  - feedback: K
    holds:
      - {{"torque_target[N.m]": -5, "level[1]": 1.4}}
"""


CALIBRATED = """
check_list: [warm_up, session_calibration]
"calibration[s]": 90
"""


def short_protocol(folder, baseline=1, reach=1, hold=2, more=""):
    path = folder / "short.yaml"
    path.write_text(PROTOCOL.format(baseline=baseline, reach=reach, hold=hold) + more)
    return load_protocol(str(path))


class FakeRig:
    """Keeps what it was asked for; `answers` can be taken away."""

    def __init__(self):
        self.present, self.several = True, False
        self.requests, self.stopped_at, self.heartbeats = [], [], []
        self.refuses = self.state = ""
        self.answers = asyncio.Event()
        self.answers.set()
        self.unconfirmed = []

    @property
    def problem(self):
        if self.several:
            return "2 rig drivers are in this graph (a, b)"
        return "" if self.present else "no rig driver in this graph"

    def describe(self):
        return {
            "name": "test_rig" if self.present else None,
            "problem": self.problem,
            "state": self.state,
            "stop_unconfirmed": self.unconfirmed,
        }

    async def call(self, action):
        self.requests.append(action)
        while not self.answers.is_set():
            await asyncio.sleep(0.01)
        if self.refuses:
            raise CommandError(f"test_rig refuses to {action}: {self.refuses}")

    def stop(self):
        self.stopped_at.append(time.monotonic())
        self.requests.append("stop")

    def announce_operator(self, session_id):
        self.heartbeats.append((time.monotonic(), session_id))


class FakeSubject:
    def __init__(self):
        self.values = {"cocontraction": 0.3, "excitability": 0.5, "push": 0.0}

    def describe(self):
        return dict(self.values)

    async def set(self, values):
        self.values.update(values)


class FakeCalibration:
    """A calibration that ends when a test says so."""

    model = Path("S07.yaml")

    def __init__(self):
        self.begun, self.cancelled = [], []
        self.running = self.recording = False
        self.end = None

    def begin(self, seconds):
        self.begun.append(seconds)
        self.running = self.recording = True

    def progress(self):
        return "recording, 34 of 90 s" if self.recording else "diagnosing, 5 s so far"

    def cancel(self, reason):
        if self.running:
            self.cancelled.append(reason)
            self.recording, self.end = False, CalibrationEnd(reason, {})

    def ended(self):
        if self.end is None:
            return None
        end, self.end = self.end, None
        self.running = self.recording = False
        return end

    def finish(self, problem="", **figures):
        self.recording, self.end = False, CalibrationEnd(problem, figures)


class FakeEstimator:
    """An estimator that goes on with a model when a test says so, or at once."""

    def __init__(self, at_once=True):
        self.at_once, self.confirmed, self.handed = at_once, False, []
        self.refusal = self.problem = ""
        self.prepared = False

    def prepare(self):
        self.prepared = True

    def hand_over(self, model):
        self.handed.append(model)
        if self.problem:
            raise CommandError(self.problem)
        self.confirmed = self.at_once


class Laboratory:
    """Serves in a thread of its own and streams what `K`, `G`, `torque`, `valid` say, in real time,
    until it is closed.
    """

    def __init__(
        self,
        protocol,
        host="127.0.0.1",
        token="",
        port=0,
        tls=None,
        next_of_course=None,
        calibration=None,
    ):
        self.signals = LiveSignals(emg_names=MUSCLES)
        self.rig, self.subject, self.events = FakeRig(), FakeSubject(), []
        self.session = Session(protocol, next_of_course)
        self.runner = SessionRunner(
            self.session,
            self.signals,
            self.rig,
            self.subject,
            self.events.append,
            time.time,
            calibration=calibration,
            estimator=FakeEstimator(),
        )
        self.presenter = Presenter(self.signals)
        self.server = Server(self.runner, self.presenter, Access(host, token), time.time, tls=tls)
        self.K, self.G, self.torque, self.valid = 80.0, 8.0, 0.0, True
        self.estimator_says = "running"
        self.streaming = True
        self._ready, self._stop = threading.Event(), threading.Event()
        self._loop, self._stopped = asyncio.new_event_loop(), asyncio.Event()
        self.failure = None
        self._threads = [
            threading.Thread(target=self._serve, args=(host, port)),
            threading.Thread(target=self._stream),
        ]
        self.runner.start()
        for thread in self._threads:
            thread.start()
        assert self._ready.wait(10.0)

    def _serve(self, host, port):
        def ready(number):
            self.port = number
            self._ready.set()

        try:
            self._loop.run_until_complete(self.server.run(host, port, ready, self._stopped))
        except Exception as error:
            self.failure = error
            self._ready.set()

    def _stream(self):
        random = np.random.default_rng(1)
        began = time.time()
        sent = 0
        while not self._stop.wait(1 / 64):
            n = int((time.time() - began) * RATE) - sent
            t = began + (sent + np.arange(n)) / RATE
            sent += n
            if not self.streaming or not n:
                continue
            heard = time.monotonic()
            x = 0.04 * ((t % 1.1) < 0.5)
            velocity = np.zeros(n)
            torque = -self.torque + self.K * x + 0.05 * random.standard_normal(n)
            self.signals.feed_samples(np.column_stack([t, x, velocity, torque]), RATE, heard)
            emg = [2e-6 * k * random.standard_normal(n) for k in range(1, 5)]
            self.signals.feed_emg(np.column_stack([t, *emg]), RATE, heard)
            self.signals.feed_estimates(
                np.array([[t[-1], self.K, self.G, float(self.valid)]]), heard
            )
            if sent % 2048 < n:
                self.signals.feed_status("impedance_estimator", 0, self.estimator_says, {}, heard)
                figures = {
                    "messages": str(sent),
                    "free disk [MB]": "182000",
                    "missing samples": "0",
                    "ready": "True",
                }
                self.signals.feed_status("record", 0, "running", figures, heard)

    def url(self, path="/"):
        return f"http://127.0.0.1:{self.port}{path}"

    def close(self):
        self._stop.set()
        self._loop.call_soon_threadsafe(self._stopped.set)
        for thread in self._threads:
            thread.join(10.0)
        self.runner.close()


def own_certificate(folder):
    """A certificate of 127.0.0.1 and its key, as a laboratory would give them."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "laboratory")])
    now = datetime.datetime.now(datetime.UTC)
    made = (
        x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + datetime.timedelta(days=1))
        .add_extension(
            x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]), False
        )
        .sign(key, hashes.SHA256())
    )
    certificate, private = folder / "certificate.pem", folder / "key.pem"
    certificate.write_bytes(made.public_bytes(serialization.Encoding.PEM))
    private.write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    return certificate, private


def until(condition, what, seconds=30.0):
    """Wait for something that must come about."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"not within {seconds:g} s: {what}"
        time.sleep(0.02)


def close_to(value, wanted, tolerance):
    return value is not None and math.isfinite(value) and abs(value - wanted) <= tolerance
