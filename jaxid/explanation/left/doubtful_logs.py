"""What pre-flight doubts in the logs themselves, beside the name of what is missing, or where none was found.

A clock that jitters, rows that were lost with the commands in them, or a channel that was clipped leave a complete model with
errors that follow the motion, as a missing effect does.
"""

from ...logs import LogSet

_MOST = 3
"""Kinds of doubts that are told, those of most logs first."""
_HARMLESS = frozenset({"short_log", "idle", "moving_start", "unused_column", "empty_column"})
"""Doubts of what logs leave open, and not of what they hold."""

_TOLD = frozenset({"receive_stamps"})
"""Notes that are doubts once something is missing: commands by another clock than what was measured act too late or early."""


def doubtful_logs(logs: LogSet, held_out: LogSet) -> str:
    """A sentence on the doubts, one of each kind in the words of the first log that has it; empty where there are none."""
    kinds: dict[str, dict[str, str]] = {}
    for finding in (*logs.preflight(), *held_out.preflight()):
        if finding.check in _TOLD or (finding.severity != "note" and finding.check not in _HARMLESS):
            kinds.setdefault(finding.check, {}).setdefault(finding.file, finding.message.rstrip("."))
    if not kinds:
        return ""
    most = sorted(kinds.values(), key=len, reverse=True)[:_MOST]
    count = len(logs) + len(held_out)
    told = [next(iter(own.values())) + (f" (in {len(own)} of {count} logs)" if len(own) > 1 else "") for own in most]
    return (
        f"Pre-flight doubts these logs themselves, which may be all that is missing, or part of it: {'; '.join(told)}."
    )
