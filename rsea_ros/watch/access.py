"""Access to the page: clients with the token of this start, from the page itself."""

from __future__ import annotations

import hmac
import secrets
import socket
from collections.abc import Sequence
from dataclasses import dataclass, field
from urllib.parse import urlsplit

PAGE_POLICY = (
    "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
REPORT_POLICY = (
    "sandbox allow-scripts allow-downloads; default-src 'unsafe-inline' data: blob:; connect-src 'none'; "
    "frame-ancestors 'none'"
)
"""Content security policies. A report runs its script, but as of no site: it has no cookie to command by."""
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
}
_BYTES = 16


@dataclass(frozen=True)
class Access:
    """The token of this start. A visit with it in the address gets a cookie of that name."""

    cookie: str
    token: str = field(default_factory=lambda: secrets.token_urlsafe(_BYTES))

    def is_token(self, given: str | None) -> bool:
        """Return whether a text is the token, in constant time."""
        return hmac.compare_digest((given or "").encode(), self.token.encode())


def same_origin(origin: str | None, host: str) -> bool:
    """Return whether a request comes from a page of this server. host: addressee of the request."""
    if not origin:
        return False
    parts = urlsplit(origin)
    return parts.scheme in ("http", "https") and parts.netloc.lower() == host.lower()


def addresses(host: str, port: int, token: str) -> Sequence[str]:
    """Return the addresses under which a server that listens on a host is reached, for people to open."""
    names = [host]
    if host in ("0.0.0.0", "::"):
        names = ["localhost", *_own_addresses()]
    return [f"http://{f'[{n}]' if ':' in n else n}:{port}/?token={token}" for n in names]


def _own_addresses() -> Sequence[str]:
    """Return the address of this machine in its network, where it has one; nothing is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # an address of documentation: the route to the outside
            return [probe.getsockname()[0]]
        except OSError:
            return []
