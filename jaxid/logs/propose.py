"""What could be what: for each channel of a robot the signal of a file that looks like it, and a mapping file to be edited."""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .channels import Channels
from .look import Look
from .series import Series
from .supply import of_supply
from .units import HEADINGS, unit_in_name, words_in
from .wheel_pairs import LETTERS, of_one_side, unit_of, wheel_pair, wheel_positions


class Proposal(NamedTuple):
    """The field that could be a channel, its unit, why, and the runners-up; an empty field where there is none.

    `scale` makes numbers of the channel's unit of those of the field, `source` says what it was read from. It is NaN where
    only the robot's owner knows it (a duty, an encoder's counts), and `source` then says what it is a matter of. `hint`: a line
    for a mapping that makes the channel of two wheels, where it has no field of its own.
    """

    channel: str
    unit: str
    field: str
    why: str
    others: tuple[str, ...]
    scale: float = 1.0
    source: str = ""
    hint: str = ""
    optional: bool = False


# What people call things, by the words that a channel's meaning holds.
_SIDES = {
    "right": (
        *("r", "rr", "fr", "rh", "rw", "rechts", "rechte", "rechter", "rechtes", "droit", "droite"),
        *("derecha", "derecho", "destra", "destro", *(f"{one}r" for one in LETTERS)),
    ),
    "left": (
        *("l", "rl", "fl", "lh", "lw", "links", "linke", "linker", "linkes", "gauche"),
        *("izquierda", "izquierdo", "sinistra", "sinistro", *(f"{one}l" for one in LETTERS)),
    ),
}
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
_MEASURED = {"odom", "odometry", "meas", "measured", "actual", "est", "estimated", "body", "base"}
"""Words beside a channel's own name that leave it what it is (`odom_v` is no voltage)."""
_WANTED = ("cmd", "command", "setpoint", "desired", "target", "reference")
"""What is wanted was not measured."""
_FORWARDS = (["speed"], ["velocity"], ["vel"], ["geschwindigkeit"])
"""What the speed of a body is called where nothing says of what it is: the one forwards."""
_TWIST = re.compile(r"(.*)\.(?:linear\.x|angular\.z)$")


def _of_side(side: str, name: str) -> bool:
    """Whether a name bears a side: as a word, or as a letter of its own (`u_r`, `encR`)."""
    parts = {*re.split(r"[^a-z0-9]+", name.lower()), *words_in(name)}
    return side in name.lower() or not parts.isdisjoint(_SIDES[side])


def _side_score(said: str, name: str) -> float:
    """Whether a path bears the side that a channel is of, the other one, or (for the channel of a side) none."""
    for side, other in (("right", "left"), ("left", "right")):
        if side in said:
            own, wrong = _of_side(side, name), _of_side(other, name)
            return 3.0 if own and not wrong else -3.0 if wrong and not own else -1.0
    return 0.0


def _with_its_unit(channel: str, unit: str, series: Series) -> bool:
    """Whether a field is called as the channel is, with a unit of the channel's kind behind it: `vr_km_h` of vr [m/s]."""
    words, own, found = words_in(series.name), words_in(channel), unit_in_name(series.name)
    if not own or found is None or not found.si or found.si not in unit.split(" or "):
        return False
    return words[: len(own)] == own and "".join(words[len(own) :]) == re.sub("[^a-z]", "", found.said.lower())


def _score(channel: str, unit: str, wanted: str, command: bool, series: Series, place: int) -> float:
    """How well a signal fits a channel: by its name, its promised unit, and the words in its path."""
    name, said = series.name.lower(), f"{channel} {wanted}".lower()
    score = 0.0
    last = re.split(r"[./\[\]]", series.name)[-1]
    # The w of a quaternion is no yaw rate.
    if series.name == channel or (last == channel and (len(channel) > 1 or not series.name.startswith("/"))):
        return 100.0
    if _with_its_unit(channel, unit, series):
        return 60.0
    words = words_in(last)
    if not command and len(words) > 1 and [word for word in words if word not in _MEASURED] == [channel]:
        return 50.0
    units = [one for one in unit.split(" or ") if one]
    si, factor, measure = unit_of(series)
    if si and any(one in si.split(" or ") for one in units):
        score += 4.0 if series.unit else 3.0
    elif si and any(one in _MEANINGS for one in units):
        return 0.0
    if command and of_supply(name):
        return 0.0
    if not command and any(word in name for word in _WANTED):
        return 0.0
    if command and _TWIST.search(name) and ("right" in said or "left" in said):
        return 0.0  # of the body, and no side's
    if math.isnan(factor) and command != (measure == "duty"):
        return 0.0  # a duty is no measurement, and a count no command
    meant = [word for one in units for word in _MEANINGS.get(one, ())] or [*_COMMANDS]
    found = next((k for k, word in enumerate(meant) if word in name), None)
    score += 0.0 if found is None else 3.0 - 0.2 * found
    commanded = any(word in name for word in _COMMANDS) or (command and si == "V")
    score += (2.0 if commanded else -1.0) if command else (-3.0 if commanded else 0.0)
    # Called by what the channel is, in one word, it needs no unit (not `speed` for the speed of one side among others).
    if words == words_in(wanted) or (wanted.startswith("forward") and words in _FORWARDS):
        score += 1.0 if not series.name.startswith("/") else 0.0
    side = _side_score(said, series.name)
    score += side
    # Nor does it where it begins with the channel's own letter, and bears its side (uR of u_right).
    score += 2.0 if side > 0 and words[:1] == words_in(channel)[:1] else 0.0
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
    wheels = wheel_pair(series for series in usable if not any(word in series.name.lower() for word in _WANTED))
    sides = of_one_side(series.name for series in usable) if len(channels.outputs) > 1 else set()
    proposals = []
    places = wheel_positions(usable, len(channels.positions)) if len(channels.positions) > 1 else ()
    by_name = {series.name: series for series in usable}
    of_wheels = {name: by_name[field] for name, field in zip(channels.positions, places, strict=False)}
    for channel in channels:
        if len(channels.positions) > 1 and channel in channels.positions:
            proposals.append(_of_wheel(channel, channels.units.get(channel, ""), words, of_wheels.get(channel)))
            continue
        command = channel in channels.inputs
        place = channels.inputs.index(channel) if command else 0
        unit, wanted = channels.units.get(channel, ""), words.get(channel, "")
        scored = [
            (
                _score(channel, unit, wanted, command, series, place) - (2.0 if series.name in seen.doubts else 0.0),
                series,
            )
            for series in usable
            # What one wheel does is not what the body does.
            if command
            or series.name == channel
            or series.name not in sides
            or _of_side("right", wanted)
            or _of_side("left", wanted)
            or _with_its_unit(channel, unit, series)
        ]
        ranked = sorted(scored, key=lambda pair: (-pair[0], -len(pair[1]), pair[1].name))
        good = [(score, series) for score, series in ranked if score >= _LEAST and series.name not in taken]
        if not good and command and not _of_twist(channel, wanted, usable) and {*channels.outputs} <= {*by_name}:
            # All that is to be measured is there by its name: what is left of this side is what commanded it.
            left = (one for score, one in ranked if score > 0 and _side_score(wanted, one.name) > 0)
            spare = next((one for one in left if one.name not in {*taken, *channels}), None)
            if spare is not None:
                taken.add(spare.name)
                said = "by its side alone; make sure that it is the command and no measurement"
                proposals.append(Proposal(channel, unit, spare.name, wanted, (), *_scale(unit, spare)[:1], said))
                continue
        if not good and command:
            hint = _of_twist(channel, wanted, usable)
            proposals.append(Proposal(channel, unit, "", wanted, (), 1.0, "", hint, False))
            continue
        if not good:
            hint = _of_heading(channel, unit, usable) or (wheels.hint(channel, unit) if wheels is not None else "")
            proposals.append(Proposal(channel, unit, "", wanted, (), 1.0, "", hint, channel in channels.optional))
            continue
        series = good[0][1]
        taken.add(series.name)
        others = tuple(other.name for _, other in good[1:] if np.ptp(other.values) > 0)[:3]
        scale, source = _scale(unit, series)
        if command and series.name.endswith("]") and not _side_score(wanted, series.name) > 0:
            source = ", ".join(filter(None, (source, "by its place in the array alone")))
        inside = series.said or series.unit
        why = ", ".join(filter(None, (wanted, inside and f"in {inside}", series.frame and f"frame {series.frame}")))
        proposals.append(Proposal(channel, unit, series.name, why, others, scale, source))
    return proposals


def _of_heading(channel: str, unit: str, usable: Sequence[Series]) -> str:
    """A line that makes a yaw rate of a heading; empty where there is none."""
    if unit != "rad/s":
        return ""
    angles = (one for one in usable if not HEADINGS.isdisjoint(words_in(one.name)) and unit_of(one).si == "rad")
    found = next((one for one in angles if np.ptp(one.values) > 0), None)
    if found is None:
        return ""
    return f'{channel} = {{ field = "{found.name}", scale = {unit_of(found).factor!r}, derivative = true }}   # of a heading'


def _of_twist(channel: str, wanted: str, usable: Sequence[Series]) -> str:
    """A line that makes a side's command of a commanded twist, with half the track left open; empty where there is none."""
    names = {series.name for series in usable if any(word in series.name.lower() for word in _COMMANDS)}
    stems = (found[1] for name in sorted(names) if (found := _TWIST.match(name)))
    stem = next((one for one in stems if {f"{one}.linear.x", f"{one}.angular.z"} <= names), None)
    sign = "" if "right" in wanted else "-" if "left" in wanted else None
    if stem is None or sign is None:
        return ""
    fields = f'"{stem}.linear.x" = 1.0, "{stem}.angular.z" = {sign}b'
    return f"{channel} = {{ fields = {{ {fields} }} }}   # b half the track [m]"


def _of_wheel(channel: str, unit: str, words: Mapping[str, str], series: Series | None) -> Proposal:
    """A wheel's position and its scale: by the name, or one that only the owner knows."""
    wanted = words.get(channel, "")
    if series is None:
        return Proposal(channel, unit, "", wanted, (), optional=True)
    said = unit_of(series)
    scale, source = said.factor, f"the name says {said.said}" if said.said and said.factor != 1.0 else ""
    if not said.si:
        per = "2 pi / counts per turn" if unit == "rad" else "the way per turn / counts per turn"
        scale, source = math.nan, f"an encoder's counts; give the {unit} that one of them is, {per}"
    elif unit == "m" and "rad" in said.si.split(" or "):
        scale, source = math.nan, "an angle; give the m per rad, which is the wheel's radius"
        if said.factor != 1.0:
            source = f"an angle in {said.said}; give the m per {said.said}, the wheel's radius times {said.factor:.9g}"
    return Proposal(channel, unit, series.name, wanted, (), scale, source, "", True)


def _scale(unit: str, series: Series) -> tuple[float, str]:
    """The factor from a field to a channel's `unit`, and what says so; empty where nothing does."""
    if unit and not any(one in _MEANINGS for one in unit.split(" or ")):
        # A command in whatever unit the robot's owner likes; where its name says which, in that without thousandths.
        si, factor, said = unit_of(series)
        if si not in ("V", "A", "N") or factor == 1.0:
            return 1.0, ""
        return factor, f"{'the file' if series.said else 'the name'} says {said}, which makes it {si}"
    _, factor, said = unit_of(series)
    if math.isnan(factor):
        if said == "duty":
            return math.nan, f"a duty; give the {unit or 'command'} that one unit of it stands for"
        return math.nan, f"an encoder's counts; give the {unit or 'way'} that one of them is"
    if factor != 1.0:
        return factor, f"{'the file' if series.said else 'the name'} says {said}"
    return 1.0, "" if said or series.unit else "nothing says the unit"


def _times(seen: Look) -> dict[str, Any]:
    """The entry of a mapping for a table's times; none where it has them as t in seconds."""
    found = seen.recording.time
    if found is None or (found.column == "t" and found.scale == 1.0):
        return {}
    return {"t": {"column": found.column, "scale": found.scale}}


def proposed_mapping(seen: Look, proposals: Sequence[Proposal], channels: Channels) -> dict[str, Any] | None:
    """The proposals as a mapping; None where one that is needed has no field, or a scale that only the owner knows."""
    usable = {one.channel: one for one in proposals if one.field and math.isfinite(one.scale)}
    stand_ins = {name for name in channels.outputs if channels.stood_in(name, usable)}
    if not set(channels) <= {*usable, *channels.optional, *stand_ins}:
        return None
    return {name: {"field": one.field, "scale": one.scale} for name, one in usable.items()} | _times(seen)


def mapping_text(
    path: Path, seen: Look, proposals: Sequence[Proposal], stamps: bool, channels: Channels, angles: Mapping[str, str]
) -> str:
    """A mapping file that proposes a field for each channel, for a person to look over.

    `angles`: units by name of angles of wheels which the robot may measure in the place of outputs that nothing looks like.
    """
    found = {one.channel for one in proposals if one.field}
    lines = [
        f"# Proposed by `jaxid look {path.name}`, by names and units alone: check every line, its unit and its sign.",
        "# value = scale * field + offset, in the unit of the channel; derivative = true makes a speed of a position.",
    ]
    if stamps:
        lines.append("# t = { stamp = \"receive\" }   # the recorder's clock instead of the messages' headers")
    for entry in _times(seen).values():
        said = seen.recording.time.said if seen.recording.time else ""
        lines += ["", "# t [s]: times", f't = {{ column = "{entry["column"]}", scale = {entry["scale"]!r} }}']
        lines[-1] += f"   # {said}" if said else "   # nothing says the unit"
    for one in proposals:
        unit = f" [{one.unit}]" if one.unit else ""
        lines.append("")
        lines.append(f"# {one.channel}{unit}" + (f": {one.why}" if one.why else ""))
        if not one.field and channels.stood_in(one.channel, found):
            lines.append(f"# {' and '.join(channels.stand_ins(one.channel))} stand in for it")
            lines += [f"# or {one.hint}"] if one.hint else []
            continue
        if not one.field and one.optional:
            lines.append(f"# {one.channel} may be missing, and nothing here looks like it")
            continue
        if not one.field:
            nothing = f'{one.channel} = {{ field = "?", scale = 1.0 }}   # nothing here looks like it'
            lines.append(f"# {one.hint or nothing}")
            continue
        # Not a number: whoever has not looked it up is told so when the mapping is read.
        scale = '"?"' if math.isnan(one.scale) else repr(one.scale)
        remark = f"   # {one.source}" if one.source else ""
        lines.append(f'{one.channel} = {{ field = "{one.field}", scale = {scale}, offset = 0.0 }}{remark}')
        lines += [f'#   or "{other}"' for other in one.others]
    if angles and any(not one.field for one in proposals if one.channel in channels.outputs):
        lines += ["", "# In the place of its speeds the robot may measure the positions of its wheels:"]
        lines += [f'# {name} = {{ field = "?", scale = 1.0 }}   # [{unit}]' for name, unit in angles.items()]
    return "\n".join(lines) + "\n"
