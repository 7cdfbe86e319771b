"""The rules of who may open which page.

On the loopback address everybody at this computer may; what must be kept out are other web sites
that a browser here has open: they can send requests to the loopback address, and could command the
session through an operator's browser. So the names `Host` and `Origin` must be ours, and a page is
not opened by another site's link, frame or popup. Any other address needs a token, one for each
role.

A token is entered once. The browser then holds a cookie with a random key that this process has
made; neither token nor key is ever part of an address, and none is logged.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import secrets
import ssl
from pathlib import Path
from urllib.parse import urlsplit

from biofeedback.errors import AccessError

SHORTEST_TOKEN = 16
"""Least number of characters of a token: 16 of 64 kinds are 96 bits, out of reach of guessing over
a network."""
COOKIE = "ankle_session"
SUBJECT, OPERATOR = "subject", "operator"
ROLES = (SUBJECT, OPERATOR)
SUBJECT_TOKEN_LENGTH = 22
"""Number of characters of 6 bits in the subject's token: 132 bits, more than the shortest token of
the operator."""
_LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")
_FOREIGN_SITES = ("cross-site", "same-site")
"""Values of ``Sec-Fetch-Site`` for what another web site has started."""


def is_loopback(host: str) -> bool:
    """Return whether an address or name belongs to this computer only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def subject_token(token: str) -> str:
    """Return the subject's token, derived from the operator's without revealing it."""
    digest = hmac.new(token.encode(), b"subject's screen", hashlib.sha256).digest()
    alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
    return "".join(alphabet[byte % 64] for byte in digest)[:SUBJECT_TOKEN_LENGTH]


def tls_context(certificate: str, key: str) -> ssl.SSLContext | None:
    """Return what a TLS server needs; None where neither file is named.

    Parameters
    ----------
    certificate
        PEM file with the certificate chain.
    key
        PEM file with the private key.

    Raises
    ------
    AccessError
        Only one is named, one cannot be read, or they do not belong together.
    """
    if not certificate and not key:
        return None
    if not (certificate and key):
        raise AccessError("TLS needs both parameters, certificate and key")
    for name, path in (("certificate", certificate), ("key", key)):
        if not Path(path).is_file():
            raise AccessError(f"{name} = '{path}': there is no such file")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(certificate, key)
    except (ssl.SSLError, OSError) as error:
        raise AccessError(f"certificate '{certificate}' and key '{key}': {error}") from None
    return context


class Access:
    """Decides on each request.

    Parameters
    ----------
    host
        Address that is served.
    token
        Of the operator; needed where `host` is not a loopback address.

    Raises
    ------
    AccessError
        Another address without a long enough token.
    """

    def __init__(self, host: str, token: str) -> None:
        self._loopback = is_loopback(host)
        if (token or not self._loopback) and len(token) < SHORTEST_TOKEN:
            raise AccessError(
                f"host = '{host}' can be reached from other computers, so a token of at least "
                f"{SHORTEST_TOKEN} characters is needed "
                f"(it has {len(token)}): set the parameter token, or leave host at 127.0.0.1"
                if not self._loopback
                else f"a token of at least {SHORTEST_TOKEN} characters is needed (it has "
                f"{len(token)}), or none on this computer's own address"
            )
        self._host = host
        self._tokens = {OPERATOR: token, SUBJECT: subject_token(token)} if token else {}
        # Random keys of this process: a restart ends every login.
        self._keys = {role: secrets.token_urlsafe(32) for role in ROLES}

    @property
    def needs_token(self) -> bool:
        """Tell whether pages have to be opened with a token first."""
        return bool(self._tokens)

    def tokens(self) -> dict[str, str]:
        """Return the token of each role; empty where none is needed."""
        return dict(self._tokens)

    def enter(self, token: str) -> tuple[str, str] | None:
        """Return the role that a token opens and the cookie's value; None for a wrong token."""
        for role in (OPERATOR, SUBJECT):
            if role in self._tokens and _equal(token, self._tokens[role]):
                return role, self._keys[role]
        return None

    def roles(self, cookie: str) -> tuple[str, ...]:
        """Return the roles that a cookie opens.

        An operator may also look at the subject's screen.
        """
        if not self._tokens:
            return ROLES
        if _equal(cookie, self._keys[OPERATOR]):
            return ROLES
        return (SUBJECT,) if _equal(cookie, self._keys[SUBJECT]) else ()

    def refusal(self, host: str, origin: str | None, fetch_site: str | None = None) -> str | None:
        """Return why a request is refused whoever sends it; None where it is not.

        Parameters
        ----------
        host, origin
            The request's headers; browsers always send an origin with a WebSocket.
        fetch_site
            The header ``Sec-Fetch-Site`` of a page that is opened; ``none`` for a typed address.
        """
        try:
            name = urlsplit(f"//{host}").hostname or ""
            own = origin is None or urlsplit(origin).netloc == host
        except ValueError:
            return "Host or Origin is no address"
        if self._loopback and name not in (*_LOOPBACK_NAMES, self._host):
            return f"the host name '{name[:80]}' is not this computer's"
        if not own:
            return "the request comes from another web site"
        if fetch_site in _FOREIGN_SITES:
            return "another web site has opened this page; type its address or use a bookmark"
        return None


def _equal(given: str, wanted: str) -> bool:
    return hmac.compare_digest(given.encode("utf-8", "replace"), wanted.encode())
