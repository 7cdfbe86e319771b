"""Damaged messages and headers from browsers, and sessions saved on disk."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np

from biofeedback.errors import CommandError, MalformedMessageError
from biofeedback.session import commands, saved_session
from biofeedback.session.protocol import load_protocol
from biofeedback.session.session_program import Session
from biofeedback.web.access import Access
from damaged_input.damage import (
    ROS,
    Case,
    text_of,
    word,
)


def page_messages(folder: Path) -> Case:
    """Messages on the WebSocket."""
    good = [
        {"id": 1, "command": "set_target", "torque[N.m]": -5.0, "lower": 1.0, "upper": 2.0},
        {"id": 2, "command": "note", "text": "calm"},
        {"id": 3, "command": "stop"},
    ]

    def case(random: np.random.Generator) -> bool:
        content = good[int(random.integers(len(good)))]
        text = text_of(content, random, json.dumps).decode("utf-8", "replace")
        try:
            command = commands.parse(text)
        except (CommandError, MalformedMessageError):
            return False
        for value in command.values.values():
            assert not isinstance(value, float) or math.isfinite(value)
        return True

    return case


def http_headers(folder: Path) -> Case:
    """Host, origin and cookie of a request."""
    access = Access("127.0.0.1", "a long and secret token")
    parts = (
        "127.0.0.1",
        "localhost",
        "[::1]",
        ":",
        "8080",
        "//",
        "http",
        "@",
        "[",
        "]",
        "evil.org",
    )

    def header(random: np.random.Generator) -> str:
        if random.random() < 0.3:
            return "127.0.0.1:8080"
        chosen = [parts[int(i)] for i in random.integers(0, len(parts), random.integers(0, 6))]
        return "".join(chosen) + (word(random) if random.random() < 0.3 else "")

    def case(random: np.random.Generator) -> bool:
        host, origin = header(random), None if random.random() < 0.2 else header(random)
        if origin is not None and random.random() < 0.5:
            origin = f"http://{host}"
        assert access.roles(word(random)) == ()
        assert access.enter(word(random)) is None
        if access.refusal(host, origin, None) is not None:
            return False
        assert any(name in host for name in ("127.0.0.1", "localhost", "::1"))
        assert origin is None or origin.endswith(host)
        return True

    return case


def saved_sessions(folder: Path) -> Case:
    """The file with a session's progress."""
    session = Session(load_protocol("van_t_veld_2018"))
    good = {"saved_at[s]": ROS, **session.saved()}
    path = folder / "progress.json"

    def case(random: np.random.Generator) -> bool:
        path.write_bytes(text_of(good, random, json.dumps))
        try:
            found = saved_session.load(path, ROS + 1.0, 3600.0)
            if found is None:
                return False
            resumed = Session(session.protocol)
            resumed.resume(found, ROS)
        except CommandError:
            return False
        assert resumed.state != "armed"
        assert math.isfinite(resumed.elapsed)
        resumed.saved()
        return True

    return case
