"""Work of one page beside the event loop: a thread that computes the latest request of each kind."""

import gc
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

from bokeh.document import Document
from tornado.ioloop import IOLoop

GARBAGE_SECONDS = 1.0
"""Time after the end of a page when its memory is given back: models point at each other."""


class Worker:
    """A thread that computes for one page; a later question of the same kind takes the place of an earlier one.

    Parameters
    ----------
    document
        Of the page; answers are told on its event loop. The thread begins when a browser has connected and is ready,
        so that asking for the page alone computes nothing, and ends with its session.
    """

    def __init__(self, document: Document) -> None:
        self._document = document
        self._asked: dict[str, tuple[Callable[[], Any], Callable[[Any], None]]] = {}
        self._bell, self._ended = threading.Condition(), False
        document.on_session_destroyed(self._end)
        document.on_event("document_ready", self._start)
        self._begun = False

    def _start(self, event: Any) -> None:
        if not self._begun:
            self._begun, self._loop = True, IOLoop.current()
            threading.Thread(target=self._run, daemon=True).start()  # Ctrl-C does not wait for it

    def ask(self, kind: str, work: Callable[[], Any], tell: Callable[[Any], None]) -> None:
        """Call ``tell`` with the result of ``work``, unless a newer request of this kind has come."""
        with self._bell:
            self._asked[kind] = work, tell
            self._bell.notify()

    def _end(self, context: Any) -> None:
        with self._bell:
            self._ended = True
            self._asked.clear()
            self._bell.notify()
        timer = threading.Timer(GARBAGE_SECONDS, gc.collect)  # Ctrl-C is lost in what the collector calls
        timer.daemon = True
        timer.start()

    def _run(self) -> None:
        while True:
            with self._bell:
                self._bell.wait_for(lambda: self._asked or self._ended)
                if self._ended:
                    return
                kind = min(self._asked, key=len)  # the view before the diagram
                work, tell = self._asked.pop(kind)
            try:
                answer = work()
            except RuntimeError as error:
                if "interpreter shutdown" in str(error):  # Ctrl-C: no thread can begin any more
                    return
                raise
            self._loop.add_callback(self._tell, kind, tell, answer)

    def _tell(self, kind: str, tell: Callable[[Any], None], answer: Any) -> None:
        """On the event loop, where no session ends meanwhile: hand over an answer, unless a newer one is asked for."""
        context = self._document.session_context
        if not (self._ended or kind in self._asked or (context is not None and context.destroyed)):
            self._document.add_next_tick_callback(partial(tell, answer))
