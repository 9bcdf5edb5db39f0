"""What pre-flight finds, one line each."""

from collections.abc import Iterable

from ..logs import LogSet
from ..logs.finding import Finding
from ..logs.useless import useless
from ..robots.robot import Robot
from .arguments import UnusableInput
from .console import say

_STYLE = {"error": "bold yellow", "warning": "yellow"}


def warn_of_findings(*sets: LogSet | None) -> None:
    """Errors and warnings of pre-flight on stderr, of what is found of a column in several logs that of the first and the names
    of the others; notes are for whoever asks `LogSet.preflight`."""
    kinds: dict[tuple[str, str, str | None], dict[str, list[str]]] = {}
    for found in (found for logs in sets if logs for found in logs.preflight() if found.severity in _STYLE):
        own = kinds.setdefault((found.severity, found.check, found.column), {}).setdefault(found.file, [])
        own += [str(found)] if str(found) not in own else []
    for (severity, _, column), files in kinds.items():
        (lines, *_), (_, *others) = files.values(), files
        for line in lines:
            say(line, style=_STYLE[severity])
        if others:
            of = f"column {column!r} of " if column else ""
            say(f"  likewise {of}{', '.join(others)}", style=_STYLE[severity])


def in_short(findings: Iterable[Finding]) -> list[str]:
    """A sentence on the first finding of each check, and how many there are."""
    kinds: dict[tuple[str, str], list[str]] = {}
    for found in findings:
        kinds.setdefault((found.severity, found.check), []).append(str(found))
    counted = ((first, len(set(others))) for first, *others in kinds.values())
    return [f"{first} ({more} more such.)" if more else first for first, more in counted]


def warn_of_unused(robot: Robot, *sets: LogSet | None) -> None:
    """Columns of the robot's own sensors that its logs hold and its fit has no use for, since others are measured."""
    used = robot.channels.measured
    there = {str(column) for logs in sets for log in logs or () for column in log.extra}
    unused = [name for name in robot.words if name in there and name not in used]
    # What cannot go sideways has other names for its speeds, in which upper and lower case are easily taken for one.
    misnamed = {name: name.swapcase() for name in unused if name.swapcase() in {*robot.velocities} - {name} - there}
    for name, own in misnamed.items():
        say(
            f"warning: {name}: not used, for the {robot.words.get(own, own)} of this robot is called {own}; rename the column, "
            "or map it.",
            style=_STYLE["warning"],
        )
    unused = [name for name in unused if name not in misnamed]
    if unused:
        held = ", ".join(robot.channels.outputs)
        say(
            f"warning: {', '.join(unused)}: not used, since {held} are; without these columns they are used in their place.",
            style=_STYLE["warning"],
        )


def refuse_useless(logs: LogSet) -> None:
    """Raise `UnusableInput` where pre-flight finds an error in every log, such as a robot that never moved."""
    if why := useless(logs):
        raise UnusableInput(why)
