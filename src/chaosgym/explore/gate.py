"""Requests that the page's server accepts, and what it does not print."""

import logging
from typing import Any
from urllib.parse import unquote_to_bytes

from bokeh.server.server import Server
from tornado.iostream import StreamClosedError
from tornado.web import ErrorHandler
from tornado.websocket import WebSocketClosedError

NAMES = ("localhost", "127.0.0.1", "[::1]")
"""Names of this computer, by which its own browser asks; any other name is a page of somebody else's."""

CLOSING = (
    *("bokeh.server.views.ws", "bokeh.server.protocol_handler", "bokeh.server.contexts", "bokeh.util.tornado"),
    *("tornado.application", "tornado.general", "tornado.access"),
)
"""Loggers that complain when a tab is closed."""


def guard(server: Server) -> None:
    """Serve browsers on this computer alone: 403 for other names in Host, 400 for a query that is no UTF-8."""
    app: Any = server._tornado
    found = app.find_handler
    hosts = {f"{name}:{server.port}" for name in NAMES}

    def find_handler(request: Any, **keywords: Any) -> Any:
        status = 403 if request.host.lower() not in hosts else 200 if _is_text(request.query) else 400
        if status != 200:
            return app.get_handler_delegate(request, ErrorHandler, {"status_code": status})
        return found(request, **keywords)

    app.find_handler = find_handler
    for name in CLOSING:
        logging.getLogger(name).addFilter(_is_news)


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
