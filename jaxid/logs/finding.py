"""What can be wrong with a log: an error that stops the work, or a finding that the user should know about."""

from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "note"]


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
