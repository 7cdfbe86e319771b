"""Whom a running server lets in: no strangers, nobody without a token, no page of another site."""

import ssl

import aiohttp
import pytest
from laboratory import Laboratory, own_certificate, short_protocol
from page_client import of_kind, talk

from biofeedback.errors import AccessError
from biofeedback.web.access import subject_token, tls_context

pytestmark = [pytest.mark.live, pytest.mark.untimed]


def test_strangers_are_refused(laboratory):
    async def scenario(session):
        for headers in ({"Origin": "http://evil.example"}, {"Host": "evil.example"}):
            with pytest.raises(aiohttp.WSServerHandshakeError) as found:
                await session.ws_connect(laboratory.url("/ws?role=operator"), headers=headers)
            assert found.value.status == 403
        async with session.get(laboratory.url("/"), headers={"Host": "evil.example"}) as answer:
            assert answer.status == 403
        for path in (
            "/pages/../server.py",
            "/pages/..%2fserver.py",
            "/etc/passwd",
            "/pages/nothing.js",
        ):
            async with session.get(laboratory.url(path)) as answer:
                assert answer.status == 404

    talk(laboratory, scenario)


def test_a_token_opens_another_address_and_nothing_else_does(tmp_path):
    token = "0123456789abcdef0123"
    with pytest.raises(AccessError):
        Laboratory(short_protocol(tmp_path), host="0.0.0.0", token="short")
    laboratory = Laboratory(short_protocol(tmp_path), host="0.0.0.0", token=token)

    async def enter(session, text):
        async with session.post(
            laboratory.url("/enter"), data={"token": text}, allow_redirects=False
        ) as answer:
            return answer.status, answer.headers.get("Set-Cookie", "").split(";")[0]

    async def scenario(session):
        for path in ("/", "/operator", f"/operator?token={token}"):
            async with session.get(laboratory.url(path), allow_redirects=False) as answer:
                assert (answer.status, answer.headers["Location"]) == (302, "/enter")
        async with session.post(laboratory.url("/stop")) as answer:
            assert answer.status == 403
        for cookie in ("", f"ankle_session={token}"):
            with pytest.raises(aiohttp.WSServerHandshakeError):
                await session.ws_connect(
                    laboratory.url("/ws?role=operator"), headers={"Cookie": cookie}
                )
        async with session.post(laboratory.url("/enter"), data={"token": "wrong"}) as answer:
            page = await answer.text()
            assert answer.status == 403
            assert "That token is wrong" in page
            assert page.index("That token is wrong") < page.index('name="token"')
        status, cookie = await enter(session, token)
        assert status == 303
        assert token not in cookie
        page = await session.ws_connect(
            laboratory.url("/ws?role=operator"), headers={"Cookie": cookie}
        )
        await of_kind(page, "state")
        _, cookie = await enter(session, subject_token(token))
        with pytest.raises(aiohttp.WSServerHandshakeError):
            await session.ws_connect(
                laboratory.url("/ws?role=operator"), headers={"Cookie": cookie}
            )
        page = await session.ws_connect(
            laboratory.url("/ws?role=subject"), headers={"Cookie": cookie}
        )
        await of_kind(page, "state")

    try:
        talk(laboratory, scenario)
    finally:
        laboratory.close()


def test_no_page_may_be_framed_or_opened_by_another_site(laboratory):
    async def scenario(session):
        for path in ("/", "/operator", "/enter"):
            async with session.get(laboratory.url(path)) as answer:
                assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
                assert answer.headers["X-Frame-Options"] == "DENY"
                assert answer.headers["Cross-Origin-Opener-Policy"] == "same-origin"
            async with session.get(
                laboratory.url(path), headers={"Sec-Fetch-Site": "cross-site"}
            ) as answer:
                assert answer.status == 403

    talk(laboratory, scenario)


def test_the_laboratorys_certificate_serves_the_pages_encrypted(tmp_path):
    certificate, key = own_certificate(tmp_path)
    laboratory = Laboratory(short_protocol(tmp_path), tls=tls_context(str(certificate), str(key)))
    context = ssl.create_default_context(cafile=certificate)

    async def scenario(session):
        url = laboratory.url("/ws?role=subject").replace("http:", "https:")
        await of_kind(await session.ws_connect(url, ssl=context), "state")
        with pytest.raises(aiohttp.ClientError):
            await session.get(laboratory.url("/"))

    try:
        talk(laboratory, scenario)
    finally:
        laboratory.close()
