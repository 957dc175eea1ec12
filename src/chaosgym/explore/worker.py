"""Work of one page beside the event loop: a thread that computes the latest request of each kind."""

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

from bokeh.document import Document


class Worker:
    """A thread that computes for one page; a later question of the same kind takes the place of an earlier one.

    Parameters
    ----------
    document
        Of the page; answers are told on its event loop. The thread ends with its session.
    """

    def __init__(self, document: Document) -> None:
        self._document = document
        self._asked: dict[str, tuple[Callable[[], Any], Callable[[Any], None]]] = {}
        self._bell, self._ended = threading.Condition(), False
        document.on_session_destroyed(self._end)
        threading.Thread(target=self._run, daemon=True).start()  # Ctrl-C does not wait for it

    def ask(self, kind: str, work: Callable[[], Any], tell: Callable[[Any], None]) -> None:
        """Call ``tell`` with the result of ``work``, unless a newer request of this kind has come."""
        with self._bell:
            self._asked[kind] = work, tell
            self._bell.notify()

    def _end(self, context: Any) -> None:
        with self._bell:
            self._ended = True
            self._bell.notify()

    def _run(self) -> None:
        while True:
            with self._bell:
                self._bell.wait_for(lambda: self._asked or self._ended)
                if self._ended:
                    return
                kind = min(self._asked, key=len)  # the view before the diagram
                work, tell = self._asked.pop(kind)
            answer = work()
            with self._bell:
                if self._ended:
                    return
                if kind not in self._asked:
                    self._document.add_next_tick_callback(partial(tell, answer))
