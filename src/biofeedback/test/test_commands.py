"""What may come from a page: commands, their limits, and everything else."""

import json

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from biofeedback.errors import AccessError, CommandError, MalformedMessageError
from biofeedback.session.commands import BURST, COMMANDS, RATE, Command, RateLimit, parse
from biofeedback.web.access import Access, tls_context

TOKEN = "a-long-enough-token"


def test_a_command():
    assert parse('{"id": 3, "command": "set_target", "torque[N.m]": -5, "lower": null}') == Command(
        3, "set_target", {"torque[N.m]": -5.0, "lower": None}
    )


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (
            '{"id": 1, "command": "set_target", "torque[N.m]": 1e9}',
            r"torque\[N.m\] = 1e\+09 is refused; allowed: -30 to 30",
        ),
        ('{"id": 1, "command": "set_target", "torque[N.m]": NaN}', "is refused"),
        ('{"id": 1, "command": "set_target", "feedback": "B"}', "allowed: K, G"),
        ('{"id": 1, "command": "note", "text": "a\\nb"}', "printable"),
    ],
)
def test_values_out_of_range_are_answered_with_the_range(message, words):
    with pytest.raises(CommandError, match=words) as found:
        parse(message)
    assert found.value.number == 1


@pytest.mark.parametrize(
    "message",
    [
        "",
        "hello",
        "[]",
        "null",
        '{"command": "stop"}',
        '{"id": 1, "command": "format_disk"}',
        '{"id": true, "command": "stop"}',
        '{"id": 1, "command": "stop", "now": 1}',
        '{"id": 1, "command": "set_target", "torque[N.m]": "5"}',
        '{"id": 1, "command": "note"}',
        "[" * 3000,
        json.dumps({"id": 1, "command": "note", "text": "x" * 5000}),
    ],
)
def test_what_no_page_sends_is_malformed(message):
    with pytest.raises(MalformedMessageError):
        parse(message)


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=8,
)
nearly = st.fixed_dictionaries(
    {"id": st.integers(0, 9) | anything, "command": st.sampled_from(sorted(COMMANDS)) | anything},
    optional={key: anything for fields in COMMANDS.values() for key in fields},
)


@settings(max_examples=60, deadline=None)
@given(st.text() | nearly.map(json.dumps) | anything.map(json.dumps))
@example('{"id": 1, "command": "set_target", "torque[N.m]": Infinity}')
@example('{"id": 1, "command": "note", "text": "\\ud800"}')
def test_no_text_does_more_than_be_refused(message):
    try:
        command = parse(message)
    except (MalformedMessageError, CommandError):
        return
    assert command.name in COMMANDS
    assert set(command.values) <= set(COMMANDS[command.name])


def test_the_rate_of_a_page_is_limited_and_recovers():
    limit = RateLimit(0.0)
    assert sum(limit.allows(0.0) for _ in range(200)) == BURST
    assert not limit.allows(0.0)
    assert sum(limit.allows(1.0) for _ in range(200)) == RATE


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.7", "laboratory.example", "::"])
def test_another_address_needs_a_token(host):
    with pytest.raises(AccessError, match="token of at least 16"):
        Access(host, "short")
    assert Access(host, TOKEN).refusal("pc7:8765", "http://pc7:8765") is None
    assert Access(host, TOKEN).roles("") == ()


def test_a_token_opens_a_role_by_a_random_cookie_that_does_not_contain_it():
    access = Access("0.0.0.0", TOKEN)
    assert access.enter("guess" * 5) is None
    role, cookie = access.enter(TOKEN)
    assert role == "operator"
    assert TOKEN not in cookie
    assert access.roles(cookie) == ("subject", "operator")
    assert access.roles(TOKEN) == ()
    assert Access("0.0.0.0", TOKEN).roles(cookie) == ()  # a restart ends every login


def test_the_subjects_token_opens_the_subjects_screen_only():
    access = Access("0.0.0.0", TOKEN)
    role, cookie = access.enter(access.tokens()["subject"])
    assert role == "subject"
    assert access.roles(cookie) == ("subject",)
    assert access.tokens()["subject"] != TOKEN
    assert len(access.tokens()["subject"]) >= 16


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_a_page_that_another_site_opens_is_refused(site):
    access = Access("127.0.0.1", "")
    assert "another web site has opened" in access.refusal("127.0.0.1:8765", None, site)
    for own in ("none", "same-origin", None):
        assert access.refusal("127.0.0.1:8765", None, own) is None


@pytest.mark.parametrize(
    ("certificate", "key", "words"),
    [("a.pem", "", "both parameters"), ("nothing.pem", "nothing.key", "there is no such file")],
)
def test_tls_settings_that_cannot_work_are_refused(certificate, key, words):
    with pytest.raises(AccessError, match=words):
        tls_context(certificate, key)


@pytest.mark.parametrize(
    ("host", "origin", "words"),
    [
        ("localhost:8765", "http://localhost:8765", None),
        ("127.0.0.1:8765", None, None),
        ("[::1]:8765", "http://[::1]:8765", None),
        ("127.0.0.1:8765", "http://evil.example", "another web site"),
        ("evil.example:8765", "http://evil.example:8765", "not this computer's"),
        ("127.0.0.1:8765", "http://127.0.0.1:9999", "another web site"),
        ("127.0.0.1:8765", "null", "another web site"),
        ("", None, "not this computer's"),
    ],
)
def test_other_web_sites_are_kept_out_of_the_loopback_address(host, origin, words):
    refusal = Access("127.0.0.1", "").refusal(host, origin)
    assert refusal is None if words is None else words in refusal
