"""What the pages' server answers to HTTP requests, beside the WebSocket of the pages.

| path | what |
| --- | --- |
| `/` | the subject's screen |
| `/operator` | the operator's page |
| `/enter` | where a token is entered, if one is needed |
| `/entrance?role=operator` | whether this browser has entered: status 204, else 401 |
| `/stop` | a POST stops: the other way where the WebSocket hangs |
| `/pages/...` | style, modules and texts; `/pages/schemas.json` describes the messages |
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from importlib import resources

from aiohttp import web

from biofeedback.web import messages
from biofeedback.web.access import COOKIE, OPERATOR, ROLES, Access

ENTER_PAUSE = 1.0
"""[s] Pause after a wrong token: with 96 bits, guessing is hopeless at this rate."""
_BEFORE_FIELD = b"<label>"
_WRONG_TOKEN = (
    b'<p class="wrong" role="alert">That token is wrong. Copy all of it, without a space.</p>\n    '
)
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'self'",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    # Without any referrer a browser sends "Origin: null" with the form of /enter.
    "Referrer-Policy": "same-origin",
    "Cache-Control": "no-cache",
}
_KINDS = {
    "html": "text/html",
    "css": "text/css",
    "js": "text/javascript",
    "svg": "image/svg+xml",
    "json": "application/json",
}
_PATHS = {"/": "subject.html", "/operator": "operator.html", "/enter": "enter.html"}


class HttpRequests:
    """Answers requests: the pages' files, the entrance with a token, and a stop.

    Parameters
    ----------
    access
        Decides who may come in.
    stop
        Stops the rig at once; called with who stops.
    secure
        Whether the pages are served over TLS, and cookies are for TLS only.
    """

    def __init__(self, access: Access, stop: Callable[[str], None], secure: bool) -> None:
        self._access, self._stop, self._secure = access, stop, secure
        self._files = _page_files()

    def routes(self) -> list[web.RouteDef]:
        """Return what is answered here."""
        return [
            *(web.get(path, self._serve) for path in (*_PATHS, "/pages/{name}")),
            web.post("/enter", self._enter),
            web.get("/entrance", self._entrance),
            web.post("/stop", self._stop_by_request),
        ]

    def refusal(self, request: web.Request, page: bool = False) -> str | None:
        """Return why a request is not answered, as for another site's; None where it is."""
        headers = request.headers
        return self._access.refusal(
            headers.get("Host", ""),
            headers.get("Origin"),
            headers.get("Sec-Fetch-Site") if page else None,
        )

    def roles(self, request: web.Request) -> tuple[str, ...]:
        """Return whose pages the browser may open that sent a request."""
        return self._access.roles(request.cookies.get(COOKIE, ""))

    async def _serve(self, request: web.Request) -> web.Response:
        page = request.path in _PATHS
        name = _PATHS.get(request.path) or request.match_info["name"]
        refusal = self.refusal(request, page)
        if refusal is not None:
            return refused(refusal)
        role = OPERATOR if request.path == "/operator" else ROLES[0]
        if page and name != "enter.html" and role not in self.roles(request):
            return web.Response(status=302, headers={**HEADERS, "Location": "/enter"})
        if name not in self._files:
            return web.Response(status=404, text="There is no such page.\n", headers=HEADERS)
        kind = _KINDS.get(name.rpartition(".")[2], "application/octet-stream")
        return web.Response(
            body=self._files[name], content_type=kind, charset="utf-8", headers=HEADERS
        )

    async def _enter(self, request: web.Request) -> web.Response:
        """Exchange a token for a cookie."""
        refusal = self.refusal(request, page=True)
        if refusal is not None:
            return refused(refusal)
        found = self._access.enter(str((await request.post()).get("token", "")))
        if found is None:
            await asyncio.sleep(ENTER_PAUSE)
            again = self._files["enter.html"].replace(_BEFORE_FIELD, _WRONG_TOKEN + _BEFORE_FIELD)
            return web.Response(
                status=403,
                body=again,
                content_type=_KINDS["html"],
                charset="utf-8",
                headers=HEADERS,
            )
        role, key = found
        target = "/operator" if role == OPERATOR else "/"
        answer = web.Response(status=303, headers={**HEADERS, "Location": target})
        answer.set_cookie(COOKIE, key, httponly=True, samesite="Strict", secure=self._secure)
        return answer

    async def _entrance(self, request: web.Request) -> web.Response:
        """Say whether this browser may open a page: a page then knows why it is not connected."""
        if self.refusal(request) is not None:
            return web.Response(status=403, headers=HEADERS)
        known = request.query.get("role", "") in self.roles(request)
        return web.Response(status=204 if known else 401, headers=HEADERS)

    async def _stop_by_request(self, request: web.Request) -> web.Response:
        """Stop by an HTTP request, for a page whose WebSocket hangs."""
        refusal = self.refusal(request)
        if refusal is None and not self.roles(request):
            refusal = "enter the token at /enter"
        if refusal is not None:
            return refused(refusal)
        self._stop("a page's request")
        return web.Response(text="stopped\n", headers=HEADERS)


def refused(reason: str) -> web.Response:
    """Return the answer to a request that is refused."""
    return web.Response(status=403, text=f"Refused: {reason}.\n", headers=HEADERS)


def _page_files() -> dict[str, bytes]:
    """Return everything under `/pages/`, by name."""
    files = {}
    for folder in ("pages", "pages/texts"):
        for entry in (resources.files("biofeedback") / folder).iterdir():
            if "." in entry.name:
                files[entry.name] = entry.read_bytes()
    files["schemas.json"] = json.dumps(messages.schemas()).encode()
    return files
