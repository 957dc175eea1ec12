"""Requests that the page's server accepts, and what it does not print.

Its address holds a secret, as that of a notebook does, so no page of another site can ask for it; what another site
sends all the same is refused, and the number of pages is bounded. Bokeh's further addresses are shut.
"""

import logging
import re
import secrets
from typing import Any
from urllib.parse import unquote_to_bytes

from bokeh.server.server import Server
from tornado.iostream import StreamClosedError
from tornado.web import OutputTransform, RequestHandler
from tornado.websocket import WebSocketClosedError

NAMES = ("localhost", "127.0.0.1")
"""Names of this computer, by which its own browser asks; any other name is a page of somebody else's."""

MOST_PAGES = 20
"""Pages that are open at a time; each holds some megabytes and may compute."""

HEADERS = {
    "Content-Security-Policy": "frame-ancestors 'none'",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}
"""Of every answer: no other page shows it in a frame, or learns its address."""

CLOSING = (
    *("bokeh.server.views.ws", "bokeh.server.protocol_handler", "bokeh.server.contexts", "bokeh.util.tornado"),
    *("tornado.application", "tornado.general", "tornado.access"),
)
"""Loggers that complain when a tab is closed."""


def new_secret() -> str:
    """A word of 128 random bits, for the address."""
    return secrets.token_urlsafe(16)


class Refused(RequestHandler):
    """An answer in one line of plain text, or in none."""

    def initialize(self, status: int, reason: str) -> None:
        """Take what to answer."""
        self.status, self.reason = status, reason

    def prepare(self) -> None:
        """Answer any method."""
        self.set_status(self.status)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(self.reason + "\n" if self.reason else None)


class Headers(OutputTransform):
    """Adds ``HEADERS`` to an answer."""

    def transform_first_chunk(self, status_code: int, headers: Any, chunk: bytes, finishing: bool) -> Any:
        """Return the answer with them."""
        for name, value in HEADERS.items():
            headers[name] = value
        return status_code, headers, chunk


def guard(server: Server) -> None:
    """Serve the pages of this server alone: to browsers on this computer that know its address."""
    app: Any = server._tornado
    handler_of = app.find_handler
    hosts = {f"{name}:{server.port}" for name in NAMES}
    app._websocket_origins = hosts

    def find_handler(request: Any, **keywords: Any) -> Any:
        status, reason = _objection(request, server, hosts, app.prefix)
        if status != 200:
            return app.get_handler_delegate(request, Refused, {"status": status, "reason": reason})
        return handler_of(request, **keywords)

    app.find_handler = find_handler
    app.add_transform(Headers)
    for name in CLOSING:
        logging.getLogger(name).addFilter(_is_news)


def _objection(request: Any, server: Server, hosts: set[str], prefix: str) -> tuple[int, str]:
    """(status, why) of a request: 200 where nothing speaks against it."""
    origin, site = request.headers.get("Origin"), request.headers.get("Sec-Fetch-Site", "none")
    if request.host.lower() not in hosts:
        return 403, f"this computer is {' or '.join(sorted(hosts))}"
    if (origin and origin.lower() not in {f"http://{host}" for host in hosts}) or site not in ("none", "same-origin"):
        return 403, "other sites are not answered; type the address that `chaosgym explore` printed"
    if request.path == "/favicon.ico":
        return 204, ""
    page, socket, static = prefix + "/", prefix + "/ws", prefix + "/static/"
    if request.path not in (prefix, page, socket) and not request.path.startswith(static):
        return 403, "open the address that `chaosgym explore` printed"
    if not _is_text(request.query) or _names_a_session(request.query):
        return 400, "a query is fields of a machine and their values, in UTF-8"
    if request.path in (prefix, page) and len(server.get_sessions()) >= MOST_PAGES:
        return 503, f"{MOST_PAGES} pages are open; close one, and open this one again after half a minute"
    return 200, ""


def _names_a_session(query: str) -> bool:
    """Whether a query would choose Bokeh's session, rather than a machine."""
    return re.search(r"(^|&)bokeh", query) is not None


def _is_text(query: str) -> bool:
    try:
        unquote_to_bytes(query).decode()
    except UnicodeDecodeError:
        return False
    return True


def _is_news(record: logging.LogRecord) -> bool:
    """False for messages about a tab that was closed."""
    error = record.exc_info[1] if record.exc_info else None
    gone = isinstance(error, WebSocketClosedError | StreamClosedError) or _asks_for_its_session(error)
    return not (gone or "connection was closed" in record.getMessage() or record.name == "tornado.access")


def _asks_for_its_session(error: BaseException | None) -> bool:
    """Whether Bokeh's connection found that its session has ended."""
    trace = error.__traceback__ if isinstance(error, AssertionError) else None
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return trace is not None and trace.tb_frame.f_code.co_name == "session"
