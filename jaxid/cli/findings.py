"""What pre-flight finds, one line each."""

from ..logs import LogSet
from ..logs.useless import useless
from .arguments import UnusableInput
from .console import say

_STYLE = {"error": "bold yellow", "warning": "yellow"}


def warn_of_findings(*sets: LogSet | None) -> None:
    """Errors and warnings of pre-flight on stderr, each once; notes are for whoever asks `LogSet.preflight`."""
    findings = [str(f) for logs in sets if logs for f in logs.preflight() if f.severity in _STYLE]
    for line in dict.fromkeys(findings):
        say(line, style=_STYLE[line.partition(":")[0]])


def refuse_useless(logs: LogSet) -> None:
    """Raise `UnusableInput` where pre-flight finds an error in every log, such as a robot that never moved."""
    if why := useless(logs):
        raise UnusableInput(why)
