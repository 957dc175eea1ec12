"""The server of the page: on this computer alone, with every script and font from this computer."""

from collections.abc import Callable
from functools import partial
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers import FunctionHandler
from bokeh.server.server import Server

from chaosgym.explore.page import open_page
from chaosgym.explore.point import link_of
from chaosgym.machines import Machine

LOOPBACK = "127.0.0.1"


def serve(machine: Machine, port: int, ready: Callable[[str], object]) -> None:
    """Serve the page until Ctrl-C.

    Parameters
    ----------
    machine
        What it shows first.
    port
        0 for any that is free.
    ready
        Called with the address when the page can be opened.

    Raises
    ------
    OSError
        If the port is taken.
    """
    application = Application(FunctionHandler(partial(open_page, machine=machine)))
    # only pages from localhost and this port may open its websocket, which is Bokeh's default
    server: Any = Server({"/": application}, address=LOOPBACK, port=port)
    server.start()
    ready(f"http://localhost:{server.port}/?{link_of(machine)}")
    try:
        server.io_loop.start()
    finally:
        server.stop()
