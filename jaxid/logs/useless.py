"""Sets of logs that nothing can be learned from, as pre-flight sees them."""

from .log import LogSet


def useless(logs: LogSet) -> str:
    """What pre-flight says of the first log where it finds an error in every one, such as a robot that never moved; else
    empty."""
    found = {finding.file: finding.message for finding in logs.preflight() if finding.severity == "error"}
    return next(iter(found.values())) if len(found) == len(logs) else ""
