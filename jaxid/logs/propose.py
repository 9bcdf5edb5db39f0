"""What could be what: for each channel of a robot the signal of a file that looks like it, and a mapping file to be edited."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .channels import Channels
from .look import Look
from .series import Series


class Proposal(NamedTuple):
    """The field that could be a channel, its unit, why, and the runners-up; an empty field where there is none."""

    channel: str
    unit: str
    field: str
    why: str
    others: tuple[str, ...]
    derivative: bool = False


# What people call things, by the words that a channel's meaning holds.
_SIDES = {"right": ("r", "rr", "fr", "rh"), "left": ("l", "rl", "fl", "lh")}
_MEANINGS: Mapping[str, tuple[str, ...]] = {
    "m/s": ("twist.linear.x", "linear.x", "velocity", "speed", "vx"),
    "rad/s": ("angular_velocity.z", "twist.angular.z", "angular.z", "yaw_rate", "gyro", "omega"),
    "V": ("volt", "command", "cmd", "motor", "effort", "control", "data"),
    "A": ("current", "amp"),
    "N": ("force", "effort", "command"),
    "m": ("position", "distance", "translation"),
    "rad": ("yaw", "heading", "position", "angle"),
}
_COMMANDS = ("cmd", "command", "volt", "motor", "duty", "pwm", "control", "ref", "input", "output")


def _of_side(side: str, name: str) -> bool:
    return side in name or any(part in _SIDES[side] for part in re.split(r"[^a-z0-9]+", name))


def _side_score(said: str, name: str) -> float:
    """Whether a path bears the side that a channel is of, the other one, or (for the channel of a side) none."""
    for side, other in (("right", "left"), ("left", "right")):
        if side in said:
            own, wrong = _of_side(side, name), _of_side(other, name)
            return 3.0 if own and not wrong else -3.0 if wrong and not own else -1.0
    return 0.0


def _score(channel: str, unit: str, wanted: str, command: bool, series: Series, place: int) -> float:
    """How well a signal fits a channel: by its name, its promised unit, and the words in its path."""
    name, said = series.name.lower(), f"{channel} {wanted}".lower()
    score = 0.0
    last = re.split(r"[./\[\]]", series.name)[-1]
    # The w of a quaternion is no yaw rate.
    if series.name == channel or (last == channel and (len(channel) > 1 or not series.name.startswith("/"))):
        return 100.0
    units = [one for one in unit.split(" or ") if one]
    if series.unit and any(one in series.unit.split(" or ") for one in units):
        score += 4.0
    elif series.unit and units:
        return 0.0
    words = [word for one in units for word in _MEANINGS.get(one, ())] or [*_COMMANDS]
    found = next((k for k, word in enumerate(words) if word in name), None)
    score += 0.0 if found is None else 3.0 - 0.2 * found
    commanded = any(word in name for word in _COMMANDS)
    score += (2.0 if commanded else -1.0) if command else (-3.0 if commanded else 0.0)
    score += _side_score(said, name)
    index = re.search(r"\[(\d+)\]$", series.name)
    if index and command:
        score += 1.0 if int(index[1]) == place else -0.5
    if np.ptp(series.values) == 0:
        score -= 2.0
    return score


_LEAST = 3.0
"""Score below which a field is no proposal."""


def propose(seen: Look, channels: Channels, words: Mapping[str, str]) -> list[Proposal]:
    """For each channel the field that it could be; `words` say what a channel is, such as "yaw rate".

    By units, names and sides only: whoever knows the robot has to look it over.
    """
    usable = [series for series in seen.recording.series.values() if not series.fault and len(series) > 1]
    taken: set[str] = set()
    proposals = []
    for channel in channels:
        command = channel in channels.inputs
        place = channels.inputs.index(channel) if command else 0
        unit, wanted = channels.units.get(channel, ""), words.get(channel, "")
        scored = [
            (
                _score(channel, unit, wanted, command, series, place) - (2.0 if series.name in seen.doubts else 0.0),
                series,
            )
            for series in usable
        ]
        ranked = sorted(scored, key=lambda pair: (-pair[0], -len(pair[1]), pair[1].name))
        good = [(score, series) for score, series in ranked if score >= _LEAST and series.name not in taken]
        if not good:
            proposals.append(Proposal(channel, unit, "", wanted, ()))
            continue
        series = good[0][1]
        taken.add(series.name)
        why = ", ".join(
            filter(None, (wanted, series.unit and f"in {series.unit}", series.frame and f"frame {series.frame}"))
        )
        others = tuple(other.name for _, other in good[1:4])
        proposals.append(Proposal(channel, unit, series.name, why, others))
    return proposals


def mapping_text(path: Path, seen: Look, proposals: Sequence[Proposal], stamps: bool) -> str:
    """A mapping file that proposes a field for each channel, for a person to look over."""
    lines = [
        f"# Proposed by `jaxid look {path.name}`, by names and units alone: check every line, its unit and its sign.",
        "# value = scale * field + offset, in the unit of the channel; derivative = true makes a speed of a position.",
    ]
    if stamps:
        lines.append("# t = { stamp = \"receive\" }   # the recorder's clock instead of the messages' headers")
    for one in proposals:
        unit = f" [{one.unit}]" if one.unit else ""
        lines.append("")
        lines.append(f"# {one.channel}{unit}" + (f": {one.why}" if one.why else ""))
        if not one.field:
            lines.append(f'# {one.channel} = {{ field = "?", scale = 1.0 }}   # nothing here looks like it')
            continue
        lines.append(f'{one.channel} = {{ field = "{one.field}", scale = 1.0, offset = 0.0 }}')
        lines += [f'#   or "{other}"' for other in one.others]
    return "\n".join(lines) + "\n"
