"""What can be wrong with a log: an error that stops the work, or a finding that the user should know about."""

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "note"]
SILENT_COMMAND = "silent_command"
"""Check that finds what lies between the sample that it names and the one before."""


class LogError(ValueError):
    """A log, or a request about logs, that cannot be used. The message is one sentence that ends with the remedy."""


class LogWarning(UserWarning):
    """What pre-flight finds doubtful in a log that has been read: look before you trust an estimate from it."""


@dataclass(frozen=True)
class Finding:
    """One thing that pre-flight (or the reader) saw in a log.

    **Fields:**

    - `file`: the log's name; `column`: the channel concerned, or `None` for the whole log.
    - `sample`: row index (from 0) at which it starts, or `None`.
    - `severity`: `"error"` (an estimate from this log would mean nothing), `"warning"` (doubtful: look before you trust
      the result) or `"note"` (good to know).
    - `check`: stable identifier of the check, such as `"sign_flipped"`.
    - `message`: one sentence with file, column, sample and remedy.
    """

    file: str
    column: str | None
    sample: int | None
    severity: Severity
    check: str
    message: str

    def __str__(self) -> str:
        return f"{self.severity}: {self.message}"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """`", did you mean 'eta1'?"`-style suffix, or nothing: the closest of `known`, also ignoring case."""
    known = list(known)
    lower = {other.lower(): other for other in known}
    close = [lower[name.lower()]] if name.lower() in lower else []
    close += difflib.get_close_matches(name, known, n=2, cutoff=0.6)
    close += [lower[other] for other in difflib.get_close_matches(name.lower(), list(lower), n=2, cutoff=0.6)]
    close = list(dict.fromkeys(close))[:2]
    return f" (close: {', '.join(map(repr, close))})" if close else ""
