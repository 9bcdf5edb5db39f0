"""What pre-flight doubts in the logs themselves, beside the name of what is missing, or where none was found.

A clock that jitters, rows that were lost with the commands in them, or a channel that was clipped leave a complete model with
errors that follow the motion, as a missing effect does.
"""

from ...checks.in_words import of_kinds
from ...logs import LogSet

_HARMLESS = frozenset({"short_log", "idle", "moving_start", "unused_column", "empty_column"})
"""Doubts of what logs leave open, and not of what they hold."""

_TOLD = frozenset({"receive_stamps"})
"""Notes that are doubts once something is missing: commands by another clock than what was measured act too late or early."""


def doubtful_logs(logs: LogSet, held_out: LogSet) -> str:
    """A sentence on the doubts, one of each kind in the words of the first log that has it; empty where there are none."""
    told = of_kinds(
        logs, held_out, chosen=lambda f: f.check in _TOLD or (f.severity != "note" and f.check not in _HARMLESS)
    )
    return (
        f"Pre-flight doubts these logs themselves, which may be all that is missing, or part of it: {told}."
        if told
        else ""
    )
