"""Handlers of requests, and who has access."""

import asyncio
import hmac
import secrets
import socket
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from tornado.web import HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from rsea_extras.watch.desk import Desk, Runs

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


PARTS = Path(__file__).parent / "page"
KINDS = {"watch.css": "text/css", "watch.js": "text/javascript", "plot.js": "text/javascript"}


def routes(access: Access, desk: Desk, runs: Runs) -> Sequence[Any]:
    return [
        (r"/", Front, {"access": access}),
        (r"/(watch\.css|watch\.js|plot\.js)", PageFileHandler, {"access": access}),
        (r"/socket", Socket, {"access": access, "desk": desk}),
        (r"/report/([\w.-]+)/(\w+)", ReportHandler, {"access": access, "runs": runs}),
    ]


class TokenHandler(RequestHandler):
    """Answers only who has the token, by cookie."""

    access: Access

    def initialize(self, **given: Any) -> None:
        vars(self).update(given)

    def prepare(self) -> None:
        """Refuse who has no token. Raises HTTPError 403."""
        if not self.access.is_token(self.get_cookie(self.access.cookie)):
            raise HTTPError(403)

    def set_default_headers(self) -> None:
        self.clear_header("Server")
        for name, value in {**HEADERS, "Content-Security-Policy": PAGE_POLICY}.items():
            self.set_header(name, value)

    def write_error(self, status_code: int, **more: Any) -> None:
        message = "open the address that rsea watch printed: it has the token"
        self.finish(f"{status_code}: {message if status_code == 403 else self._reason}\n")


class Front(TokenHandler):
    """The page; the first visit brings the token in its address, which becomes a cookie.

    No redirection: a browser that came from another site would not send a strict cookie along.
    """

    def prepare(self) -> None:
        given = self.get_query_argument("token", None)
        if given is None:
            super().prepare()
        elif self.access.is_token(given):
            self.set_cookie(self.access.cookie, given, httponly=True, samesite="Strict")
        else:
            raise HTTPError(403)

    def get(self) -> None:
        self.finish((PARTS / "index.html").read_bytes())


class PageFileHandler(TokenHandler):
    """Style and scripts of the page."""

    def get(self, name: str) -> None:
        self.set_header("Content-Type", f"{KINDS[name]}; charset=utf-8")
        self.finish((PARTS / name).read_bytes())


class ReportHandler(TokenHandler):
    """A report that was made of a recording."""

    runs: Runs

    def get(self, recording: str, verb: str) -> None:
        page = self.runs.report(recording, verb)
        if page is None:
            raise HTTPError(404)
        self.set_header("Content-Security-Policy", REPORT_POLICY)
        self.finish(page.read_bytes())


class Socket(TokenHandler, WebSocketHandler):
    """The socket of a page: frames and state out, requests in. Closing it releases the page's command."""

    desk: Desk
    waiting = 0

    def check_origin(self, origin: str) -> bool:
        return same_origin(origin, self.request.host)

    def open(self, *args: str, **more: str) -> None:
        self.set_nodelay(True)
        if not self.desk.enter(self):
            self.close(1013, "too many pages are open")

    def on_message(self, message: str | bytes) -> None:
        self.desk.act(self, message)

    def on_close(self) -> None:
        self.desk.leave(self)

    def send(self, text: str) -> None:
        """Send a text; `waiting` counts those that are not out yet."""
        try:
            sending = asyncio.ensure_future(self.write_message(text))
        except WebSocketClosedError:
            return
        self.waiting += 1
        sending.add_done_callback(self._send)

    def _send(self, sending: asyncio.Future[Any]) -> None:
        self.waiting -= 1
        if not sending.cancelled():
            sending.exception()
