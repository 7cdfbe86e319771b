"""What a page can show: the presenter fills all fields of the messages, and the pages read them."""

import dataclasses
import re
import time
from importlib import resources

import pytest
from laboratory import FakeRig, FakeSubject, short_protocol

from biofeedback.live_signals import LiveSignals
from biofeedback.session.runner import SessionRunner
from biofeedback.session.session_program import Session
from biofeedback.web.messages import Pages, schemas
from biofeedback.web.presenter import Presenter
from emg_driver.muscles import MUSCLES

KINDS = {
    "string": str,
    "number": (int, float),
    "integer": int,
    "boolean": bool,
    "array": (list, tuple),
    "object": dict,
    "null": type(None),
}
FOR_PROGRAMS = {
    "frame.age",
    "state.session.stop_reason",
    "state.axes.set_by_operator",
    "state.trials.sessions",
    "state.trials.last_success",
}
"""Fields for programs that lead or watch a session by the pages' messages; no page shows them."""


def wrong(value, schema, name):
    """Return what of a value is not as its schema says."""
    if "anyOf" in schema:
        found = [wrong(value, one, name) for one in schema["anyOf"]]
        return [] if [] in found else found[0]
    if not isinstance(value, KINDS.get(schema.get("type"), object)):
        return [f"{name} = {value!r} is no {schema['type']}"]
    fields = schema.get("properties")
    if fields is None:
        return []
    if set(fields) != set(value):
        return [f"{name}: {sorted(set(fields) ^ set(value))}"]
    return [line for key in fields for line in wrong(value[key], fields[key], f"{name}.{key}")]


def fields_of(schema, name):
    """Yield every field of a message and of what it holds, as ``state.rig.name``."""
    for part in (*schema.get("anyOf", ()), schema.get("items"), schema.get("additionalProperties")):
        if part:
            yield from fields_of(part, name)
    for key, field in schema.get("properties", {}).items():
        yield f"{name}.{key}"
        yield from fields_of(field, f"{name}.{key}")


@pytest.fixture
def shown(tmp_path):
    """Return the frame and the state of a session that has begun, as the pages receive them."""
    signals = LiveSignals(emg_names=MUSCLES)
    session = Session(short_protocol(tmp_path))
    runner = SessionRunner(session, signals, FakeRig(), FakeSubject(), print, time.time)
    runner.tick(time.time(), time.monotonic())
    presenter, now = Presenter(signals), time.monotonic()
    return {
        "frame": dataclasses.asdict(presenter.frame(runner.view, time.time(), now)),
        "state": dataclasses.asdict(presenter.state(runner.view, now, Pages(1, 1, True))),
    }


@pytest.mark.parametrize("kind", ["frame", "state"])
def test_the_presenter_fills_every_field_with_what_it_is_declared_to_hold(shown, kind):
    assert wrong(shown[kind], schemas()[kind], kind) == []


def test_a_page_reads_every_field_that_is_not_for_programs_alone():
    files = (resources.files("biofeedback") / "pages").iterdir()
    pages = "\n".join(file.read_text() for file in files if file.name.endswith((".js", ".html")))
    unread = {
        name
        for kind, schema in schemas().items()
        for name in fields_of(schema, kind)
        if not re.search(rf"""[.\[{{,"'-]\s*{name.rpartition(".")[2]}\b""", pages)
    }
    assert unread == FOR_PROGRAMS
