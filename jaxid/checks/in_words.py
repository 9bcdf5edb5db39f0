"""What pre-flight found in several logs, as a sentence for whoever reads results and not the logs."""

from collections.abc import Callable

from ..logs import Finding, LogSet

_MOST = 3
"""Kinds of findings that are told, those of most logs first."""
_UNITS = frozenset({"time_unit", "unit"})
"""Findings on what the numbers are in, which no model's agreement with them removes."""


def doubtful_units(*sets: LogSet | None) -> str:
    """A sentence on logs whose numbers no robot reaches in these units, however well a model follows them; empty where none
    are."""
    told = of_kinds(*sets, chosen=lambda finding: finding.check in _UNITS and finding.severity != "note")
    return f"Pre-flight doubts the units of these logs, and every number here is in them: {told}." if told else ""


def of_kinds(*sets: LogSet | None, chosen: Callable[[Finding], bool]) -> str:
    """The chosen findings of pre-flight, one of each kind in the words of the first log that has it."""
    kinds: dict[str, dict[str, str]] = {}
    every = [log for logs in sets if logs is not None for log in logs]
    for finding in (finding for logs in sets if logs is not None for finding in logs.preflight()):
        if chosen(finding):
            kinds.setdefault(finding.check, {}).setdefault(finding.file, finding.message.rstrip("."))
    most = sorted(kinds.values(), key=len, reverse=True)[:_MOST]
    of = f"of {len(every)} logs"
    return "; ".join(next(iter(own.values())) + (f" (in {len(own)} {of})" if len(own) > 1 else "") for own in most)
