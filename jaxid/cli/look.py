"""`jaxid look`: what a file holds, stream by stream, what is odd in it, and what could be what for a robot."""

import math
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .._atomic import write_text
from .._toml import read_toml
from ..logs import LogError, LogWarning, read_logs
from ..logs.files import named_files
from ..logs.look import Look, Stream, look
from ..logs.propose import Proposal, mapping_text, propose, proposed_mapping
from ..logs.series import Series
from ..report.tables import Cell, Table, to_text
from ..robots import Robot
from ..robots.wheel_angles import measuring_angles
from .arguments import UnusableInput, load_robot
from .console import say, show, step

_FIELDS = 60
"""Fields that are listed one by one."""


def _seconds(value: float) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value * 1e3:.3g} ms" if abs(value) < 1.0 else f"{value:.3g} s"


def _row(stream: Stream) -> tuple[Cell, ...]:
    rate = f"{1.0 / stream.interval:.4g} Hz" if stream.interval > 0 else "-"
    jitter = f"{stream.jitter:.1%}" if math.isfinite(stream.jitter) else "-"
    gaps = f"{stream.gaps} (longest {_seconds(stream.longest)})" if stream.gaps else "-"
    late = f"{_seconds(stream.late)} ({_seconds(stream.latest)})" if math.isfinite(stream.late) else "-"
    topic = stream.topic
    cells = (topic.kind.replace("/msg/", "/"), f"{topic.messages:,}", rate, jitter, gaps, late)
    marks = ("dim", "", "", "bad" if stream.jitter > 0.1 else "", "bad" if stream.gaps else "", "")
    return (Cell(topic.name), *(Cell(text, mark) for text, mark in zip(cells, marks, strict=True)))


def _streams(seen: Look) -> Table:
    header = ("topic", "type", "messages", "rate", "jitter", "gaps", "delay (largest)")
    notes = [f"{stream.topic.name}: {stream.topic.remark}." for stream in seen.streams if stream.topic.remark]
    notes += [f"warning: {text}." for _, text in seen.recording.notes]
    if any(math.isfinite(stream.late) for stream in seen.streams):
        notes.append("Delay: from a message's own stamp to its receipt, usual and largest.")
    return Table("Topics", header, tuple(map(_row, seen.streams)), tuple(notes))


def _constant(series: Series) -> bool:
    return not series.fault and len(series) > 0 and bool(np.all(series.values == series.values[0]))


def _fields(seen: Look) -> Table:
    rows = []
    constant = {name: series.values[0] for name, series in seen.recording.series.items() if _constant(series)}
    changing = [series for name, series in seen.recording.series.items() if name not in constant]
    for series in changing[:_FIELDS]:
        values = series.values
        span = f"{values.min():.4g} ... {values.max():.4g}" if len(values) else "-"
        doubt = seen.doubts.get(series.name, "")
        rows.append(
            (Cell(series.name), Cell(series.unit or "-", "dim"), Cell(span), Cell(doubt, "bad" if doubt else ""))
        )
    notes = []
    if len(changing) > len(rows):
        notes.append(f"{len(changing) - len(rows)} more fields change and are not listed.")
    if constant:
        listed = ", ".join(f"{name} ({value:.4g})" for name, value in list(constant.items())[:_FIELDS])
        more = f" and {len(constant) - _FIELDS} more" if len(constant) > _FIELDS else ""
        notes.append(f"Constant: {listed}{more}.")
    return Table("Fields", ("field", "unit", "range", "odd"), tuple(rows), tuple(notes))


def _proposals(proposals: Sequence[Proposal], robot: Robot) -> Table:
    channels = robot.channels
    rows = []
    found = {one.channel for one in proposals if one.field}
    stood_in = {name for name in channels.outputs if channels.stood_in(name, found)}
    for one in proposals:
        unknown = math.isnan(one.scale)
        scale = Cell("?" if unknown else f"{one.scale:.6g}" if one.field else "", "bad" if unknown else "")
        may_lack = one.optional or one.channel in stood_in
        of_several = "of a twist" if one.channel in channels.inputs else "of two wheels"
        nothing = "none, may be missing" if may_lack else of_several if one.hint else "?"
        field = Cell(one.field or nothing, "" if one.field else "dim" if may_lack else "bad")
        rows.append((Cell(one.channel), Cell(one.unit, "dim"), field, scale, Cell(one.why, "dim")))
    of_source: dict[str, list[str]] = {}
    for one in proposals:
        of_source.setdefault(one.source, []).append(one.channel)
    notes = [f"{', '.join(channels)}: {source}." for source, channels in of_source.items() if source]
    notes += [one.hint for one in proposals if one.hint and one.channel not in stood_in]
    notes += [robot.said_of_commands] if robot.said_of_commands else []
    notes.append("By names and units alone: look every line over, with its unit and its sign.")
    return Table("What could be what", ("channel", "unit", "field", "scale", "meaning"), tuple(rows), tuple(notes))


def _words(robot: Robot) -> Mapping[str, str]:
    """What every channel is, in words; an input that drives one side is told by its side."""
    # The input of a side pushes forwards, and turns the robot to the left from the right, to the right from the left.
    inputs = robot.channels.inputs
    turning = robot.channels.mixing.get(robot.turning)
    sides = {}
    if len(inputs) == 2 and turning:
        sides = {
            name: f"{'right' if turn > 0 else 'left'} side's command"
            for name, turn in zip(inputs, turning, strict=True)
            if turn
        }
    return {**sides, **robot.words}


def _proposed(robot: Robot, seen: Look) -> tuple[Robot, Sequence[Proposal]]:
    """What could be what, and the robot that measures it: its wheels' positions where they are there and its speeds are not."""
    proposals = propose(seen, robot.channels, _words(robot))
    other = measuring_angles(robot)
    if other is robot or all(one.field for one in proposals if one.channel in robot.channels.outputs):
        return robot, proposals
    others = propose(seen, other.channels, _words(other))
    found = {one.channel for one in others if one.field}
    return (other, others) if set(other.measured_angles) <= found else (robot, proposals)


def run_look(file: str, spec: str | None, mapping: Path | None, write: Path | None, overwrite: bool = False) -> None:
    """Print the file's streams, fields and, for a robot, proposals; write these to `write` as a mapping."""
    meant = named_files(file)
    path = meant[0].path
    if len(meant) > 1:
        raise UnusableInput(f"{file} matches {len(meant)} files; look at one after the other.")
    if write is not None and spec is None:
        raise UnusableInput(
            "--write needs the robot whose channels are to be mapped; give --robot, such as --robot pioneer."
        )
    if write is not None and write.exists() and not overwrite:
        raise UnusableInput(
            f"{write} is there already, and may have been edited; name another file, or give --overwrite."
        )
    robot = load_robot(spec) if spec is not None else None
    with step(f"Reading {path}"):
        seen = look(path, _time_field(mapping))
    tables = [_streams(seen), _fields(seen)]
    proposals: Sequence[Proposal] = ()
    if robot is not None:
        robot, proposals = _proposed(robot.for_columns(seen.recording.series), seen)
        tables.append(_proposals(proposals, robot))
        if write is not None:
            stamped = any(series.stamped is not None for series in seen.recording.series.values())
            other = measuring_angles(robot)
            angles = {} if other is robot else {name: other.channels.units[name] for name in other.measured_angles}
            write_text(write, mapping_text(path, seen, proposals, stamped, robot.channels, angles))
    show(to_text(tables, ()))
    if robot is not None:
        own = mapping or proposed_mapping(seen, proposals, robot.channels)
        if own is not None:
            _preflight(file, robot, own, "your mapping" if mapping else "these proposals")
    if write is not None:
        say(f"{write}: a proposed mapping; check every line, then give it by --map {write}")


def _preflight(path: str, robot: Robot, mapping: Mapping[str, Any] | Path, whose: str) -> None:
    """Print what pre-flight finds in the file as the mapping reads it: signs, sides and sizes that contradict one another."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LogWarning)
            found = [str(f) for f in read_logs(path, robot, mapping=mapping).preflight() if f.severity != "note"]
    except LogError as error:
        found = [str(error)]
    said = [*found] or ["nothing; signs, sides and sizes agree."]
    show("\n".join([f"\nWith {whose} pre-flight finds", *said]))


def _time_field(mapping: Path | None) -> str | None:
    """The name that a mapping gives the column of times."""
    if mapping is None:
        return None
    try:
        entry = read_toml(mapping).get("t")
    except (OSError, ValueError) as error:
        raise LogError(f"The mapping {mapping} cannot be read ({error}); correct it.") from None
    return entry.get("column", entry.get("field")) if isinstance(entry, dict) else entry
