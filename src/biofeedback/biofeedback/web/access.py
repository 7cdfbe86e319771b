"""Who may open the pages.

On the loopback address everybody at this computer may; what must be kept out are other web sites
that a browser here has open: they can send requests to the loopback address, and could steer the
session through an operator's browser. So the names `Host` and `Origin` must be ours. Any other
address needs a token.
"""

from __future__ import annotations

import hmac
import ipaddress
from urllib.parse import urlsplit

from biofeedback.errors import AccessError

SHORTEST_TOKEN = 16
"""Characters: 16 of 64 kinds are 96 bits, out of reach of guessing over a network."""
COOKIE = "ankle_token"
_LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")


def is_loopback(host: str) -> bool:
    """Whether an address or name is of this computer only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class Access:
    """Decides on each request.

    Parameters
    ----------
    host
        Address that is served.
    token
        Needed where `host` is not a loopback address.

    Raises
    ------
    AccessError
        Another address without a long enough token.
    """

    def __init__(self, host: str, token: str) -> None:
        self._loopback = is_loopback(host)
        if not self._loopback and len(token) < SHORTEST_TOKEN:
            raise AccessError(
                f"host = '{host}' can be reached from other computers, so a token of at least "
                f"{SHORTEST_TOKEN} characters is needed "
                f"(it has {len(token)}): set the parameter token, or leave host at 127.0.0.1"
            )
        self._host = host
        self.token = token

    def refusal(self, host: str, origin: str | None, token: str) -> str | None:
        """Why a request is refused; None where it is not.

        Parameters
        ----------
        host, origin
            The request's headers; browsers always send an origin with a WebSocket.
        token
            From cookie or address line; empty where there is none.
        """
        name = urlsplit(f"//{host}").hostname or ""
        if self._loopback and name not in (*_LOOPBACK_NAMES, self._host):
            return f"the host name '{name[:80]}' is not this computer's"
        if origin is not None and urlsplit(origin).netloc != host:
            return "the request comes from another web site"
        if self.token and not hmac.compare_digest(
            token.encode("utf-8", "replace"), self.token.encode()
        ):
            return "the token is missing or wrong; open the address that the node has printed"
        return None
