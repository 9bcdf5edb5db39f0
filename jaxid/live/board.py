"""What a live view shows at the moment, shared between who works and who looks."""

import threading
from dataclasses import dataclass
from typing import Any, Literal

State = Literal["waiting", "running", "done", "failed"]
PARTS = ("logs", "fit", "gap", "explanation")
"""The parts of the page, in the order in which one follows from another."""


@dataclass
class _Part:
    """A part of the page: its HTML and how often that has changed, whether it is being worked on, and what is said of it."""

    html: str = ""
    number: int = 0
    state: State = "waiting"
    words: str = ""


class Board:
    """The parts of the page by name. Whoever looks waits for the next change."""

    def __init__(self) -> None:
        self._parts = {name: _Part() for name in PARTS}
        self._reports: dict[str, str] = {}
        self._changed = threading.Condition()
        self._version, self.closed = 0, False

    def _change(self) -> None:
        self._version += 1
        self._changed.notify_all()

    def tell(self, name: str, state: State, words: str = "", html: str | None = None) -> None:
        """A part's state, what is said of it, and its new HTML, where it has one."""
        with self._changed:
            part = self._parts[name]
            part.state, part.words = state, words
            if html is not None and html != part.html:
                part.html, part.number = html, part.number + 1
            self._change()

    def keep_report(self, name: str, page: str) -> None:
        """A whole report, as a page of its own; an empty one takes it away."""
        with self._changed:
            self._reports[name] = page

    def report(self, name: str) -> str:
        """The whole report; empty where there is none."""
        with self._changed:
            return self._reports.get(name, "")

    def html(self, name: str) -> str:
        """A part's HTML. Raises `KeyError` for a part that there is not."""
        with self._changed:
            return self._parts[name].html

    def seen(self, since: int, seconds: float) -> dict[str, Any] | None:
        """What there is to see, once that is not version `since` any more; None if nothing changes for so many seconds."""
        with self._changed:
            self._changed.wait_for(lambda: self._version != since or self.closed, seconds)
            if self._version == since:
                return None
            parts = {n: {"number": p.number, "state": p.state, "words": p.words} for n, p in self._parts.items()}
            return {"version": self._version, "parts": parts}

    def close(self) -> None:
        """Let everybody who waits go."""
        with self._changed:
            self.closed = True
            self._changed.notify_all()
