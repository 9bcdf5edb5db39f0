"""Read logs from files: find them, map their columns to the robot's, and say what is wrong in one sentence.

Decisions taken here, each leaving a finding that pre-flight repeats:

- an output cell that is empty, NaN, infinite or beyond any physical size is "not measured" and masked;
- an input missing for a single sample is held from the sample before (zero-order hold), one that is written only now and
  then from row to row (`held_commands`); any other longer gap is an error, since what was applied is unknown;
- a few rows that were written later than their followers are put at their place; a row that repeats the row before it in every
  column, time included, is left out (the recorder wrote it twice); any other time that does not increase is an error.
"""

import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .channels import BY_COLUMNS, POSE, Channels, layout_of
from .counts import way_of
from .files import PathLike, files_of, named_files
from .finding import Finding, LogError, LogWarning
from .formats import format_of, read_recording
from .held_commands import held, now_and_then
from .log import ABSURD, Log, LogSet, channels_of, did_you_mean
from .mapping import Source, mapped_names, read_mapping, sources_of
from .rates import rate, whole_way
from .recorded import read_recorded
from .sums import with_summed_columns
from .supply import FALLING_SUPPLY, is_supply, said_fall
from .table import Table, read_table
from .times import SINCE_1970, order_of_late_rows, since_1970, with_seconds


def _where(table: Table, row: int) -> str:
    return f"sample {row} (line {table.lines[row]})" if row < len(table.lines) else f"sample {row}"


def _numbers(table: Table, column: str, path: Path) -> np.ndarray:
    """One column as floats; raises `LogError` at the first cell that is neither a number nor empty."""
    values = pd.Series(table.frame[column])
    if values.dtype.kind in "iuf":
        return values.to_numpy(dtype=float, na_value=np.nan)
    if values.dtype.kind in "bmMc":
        raise LogError(
            f"{path}: column {column!r} holds {values.dtype}, not numbers; convert it to numbers in SI units."
        )
    if values.dtype == object:  # integers beyond the largest float come as such
        values = values.map(lambda cell: str(cell) if isinstance(cell, int) else cell)
    parsed = pd.Series(pd.to_numeric(values, errors="coerce"))
    bad = np.flatnonzero(parsed.isna() & values.notna())
    if len(bad):
        k = int(bad[0])
        cell = str(values.iloc[k]).strip()[:40]
        remedy = "put a number there, or leave the cell empty where nothing was measured"
        if k == 0 and len(bad) == 1:
            remedy = "if that line holds units, delete it or start it with #"
        raise LogError(f"{path}: column {column!r} has {cell!r} at {_where(table, k)}, which is no number; {remedy}.")
    return parsed.to_numpy(dtype=float, na_value=np.nan)


def _sources(table: Table, channels: Channels, mapping: dict[str, Source], path: Path) -> dict[str, Source]:
    """The file's column for each channel it has; raises `LogError` for one that it must have and lacks."""
    columns = list(table.frame.columns)
    sources = sources_of(("t", *channels), mapping)
    sources |= {name: mapping[name] for name in POSE if name in mapping}  # unmapped poses simply stay as they are
    there = {name for name, source in sources.items() if source.column in columns or source.interval is not None}
    for name, source in sources.items():
        if name in there or (name not in mapping and (name in channels.optional or channels.stood_in(name, there))):
            continue
        what = f"column {source.column[:60]!r}" + (f" (mapped to {name!r})" if source.column != name else "")
        example = f'rename one of them or map it, such as {name} = "its name"'
        remedy = "correct the mapping" if name in mapping else example
        listed = ", ".join(map(repr, columns[:12])) + (f" and {len(columns) - 12} more" if len(columns) > 12 else "")
        near = did_you_mean(source.column, columns)
        if not near and name not in mapping and there & set(channels):
            remedy += "; where another table of the same run has it, give both as one log, THIS.csv+OTHER.csv"
        raise LogError(f"{path} has no {what}{near}; it has {listed:.400}: {remedy}.")
    sources = {name: source for name, source in sources.items() if name in there}
    users: dict[str, str] = {}
    for name, column in ((n, source.column) for n, source in sources.items() if source.interval is None):
        twin = users.setdefault(column, name)
        # One command may drive two motors; one sensor is one measurement.
        if twin != name and not {name, twin} <= set(channels.inputs):
            raise LogError(
                f"{path}: column {column!r} stands for both {twin!r} and {name!r}; map one of them elsewhere."
            )
    return sources


def _held(values: np.ndarray, name: str, column: str, table: Table, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """An input held through gaps of one sample, and the rows where; raises `LogError` for any other gap."""
    missing = ~np.isfinite(values)
    rows = np.flatnonzero(missing)
    for k in rows:
        if k == 0 or missing[k - 1]:
            start = int(max(k - 1, 0))
            present = np.flatnonzero(~missing[start:])
            length = int(present[0]) if len(present) else len(values) - start
            raise LogError(
                f"{path}: input {name!r} (column {column!r}) has no value at {_where(table, start)}, in a gap of "
                f"{length} sample(s); fill in the command that was applied, or cut the log there"
                + (f", or, where it was only written when it changed, map {name} = {{ held = true }}." if k else ".")
            )
    return np.where(missing, np.roll(values, 1), values), rows


def _pose(name: str, values: np.ndarray | None, table: Table, path: Path) -> np.ndarray:
    """A pose column, whose first value is where the run starts; raises `LogError` where that is no pose."""
    values = _numbers(table, name, path) if values is None else values
    if abs(values[0]) > ABSURD:
        raise LogError(f"{path}: column {name!r} starts at {values[0]:.4g}; leave the cell empty if it is not known.")
    return values


def _rate(values: np.ndarray, time: np.ndarray, name: str, column: str, path: Path) -> tuple[np.ndarray, str]:
    """A speed from a column of positions, and what that costs; raises `LogError` for fewer than three of them."""
    there = np.isfinite(values)
    speed, text = rate(time[there], values[there], name, column, path)
    found = np.full(len(values), np.nan)
    found[there] = speed
    return found, text


def _overlooked(channels: Channels, there: Iterable[str], columns: list[str]) -> list[tuple[str, str]]:
    """(name, column) of optional channels and poses that the file lacks and columns that differ only in spelling."""

    def plain(name: str) -> str:
        return "".join(character for character in name.lower() if character.isalnum())

    wanted = [name for name in (*channels.measured, *POSE) if name not in (*there, *columns)]
    return [(name, column) for name in wanted for column in columns if plain(name) == plain(column)]


def _in_order(table: Table, time_column: str, path: Path) -> tuple[Table, int]:
    """The table with rows that came late at their place, and how many these were."""
    if time_column not in table.frame.columns:
        return table, 0
    time = _numbers(table, time_column, path)
    order = order_of_late_rows(time)
    if order is None:
        return table, 0
    lines = [table.lines[k] for k in order] if table.lines else []
    found = Table(table.frame.iloc[order].reset_index(drop=True), lines, table.notes)
    again, _ = _without_repeats(found, time_column, path)
    if np.any(np.diff(_numbers(again, time_column, path)) == 0):
        return table, 0  # two rows of one time that differ: the clock was set back
    return found, int(np.count_nonzero(time < np.maximum.accumulate(time)))


def _without_repeats(table: Table, time_column: str, path: Path) -> tuple[Table, np.ndarray]:
    """The table without rows that equal the row before them in every column, and which rows those were."""
    frame = table.frame
    if time_column not in frame.columns:
        return table, np.array([], dtype=int)
    time = _numbers(table, time_column, path)
    rows = 1 + np.flatnonzero(time[1:] == time[:-1])
    before, here = (frame.iloc[part].map(repr).to_numpy() for part in (rows - 1, rows))
    rows = rows[(before == here).all(axis=1)]
    kept = np.delete(np.arange(len(frame)), rows)
    lines = [table.lines[k] for k in kept] if table.lines else []
    return Table(frame.iloc[kept].reset_index(drop=True), lines, table.notes), rows


def _at_rest(table: Table, channels: Channels, mapping: dict[str, Source]) -> Table:
    """The table with every output that it lacks, zero in the first row and not measured from then on."""
    lacking = [mapping.get(name, Source(name)).column for name in channels.outputs]
    start = np.where(np.arange(len(table.frame)) == 0, 0.0, np.nan)
    new = {column: start for column in lacking if column not in table.frame.columns}
    return table._replace(frame=table.frame.assign(**new))


def _read(path: Path, name: str, channels: Channels, mapping: dict[str, Source], planned: bool = False) -> Log:
    """One file as a log called `name`; `planned`: it may be one that nobody has driven yet, without outputs."""
    if format_of(path) is not None:
        return read_recorded(path, name, channels, mapping)
    table = read_table(path)
    table = _at_rest(table, channels, mapping) if planned else table
    findings = [Finding(name, None, row, "warning", check, f"{name}: {text}.") for check, row, text in table.notes]

    def note(column: str, rows: np.ndarray, check: str, what: str, remedy: str) -> None:
        if len(rows):
            place = f"at {_where(table, int(rows[0]))}" + (f" and {len(rows) - 1} more" if len(rows) > 1 else "")
            message = f"{name}: {what} {place}; {remedy}."
            findings.append(Finding(name, column, int(rows[0]), "warning", check, message))

    plain = table
    table = with_summed_columns(plain, mapping, lambda column: _numbers(plain, column, path), path)
    sources = _sources(table, channels, mapping, path)
    if sources["t"].stamp is not None:
        raise LogError(
            f"{path} is a table with one clock; take t = {{stamp = ...}}, which is for bags, out of the mapping."
        )
    timed = sources["t"].interval is not None
    if not timed:
        dated = with_seconds(table.frame, sources["t"].column)
        if dated is not table.frame:
            text = f"{name}: {sources['t'].column!r} holds dates; the times are seconds since the first."
            findings.append(Finding(name, None, None, "note", "dates", text))
            table = table._replace(frame=dated)
        table, late = _in_order(table, sources["t"].column, path)
        what = f"{late} row(s) came after later ones and were put in the order of their times"
        if late:
            findings.append(Finding(name, "t", None, "warning", "out_of_order", f"{name}: {what}."))
        shorter, rows = _without_repeats(table, sources["t"].column, path)
        what = "a row repeats the one before in every column, time included, and was left out,"
        note(sources["t"].column, rows, "repeated_row", what, "check the recorder")
        table = shorter

    columns: dict[str, np.ndarray] = {}
    for standard, source in sources.items():
        if source.interval is not None:
            columns[standard] = source.interval * np.arange(len(table.frame), dtype=float)
            continue
        values = _numbers(table, source.column, path)
        turns = standard in channels.positions and not source.integral
        if turns or source.derivative:  # in the sensor's own unit, in which its turns are whole
            values, text = whole_way(columns["t"], values, standard, source.column)
            if text:
                findings.append(Finding(name, standard, None, "warning", "turns", f"{name}: {text}."))
        factor, unit = since_1970(values) if standard == "t" and source.scale == 1.0 else (source.scale, "")
        with np.errstate(over="ignore"):
            values = factor * values + source.offset
        if standard == "t" and len(values) and values[0] > SINCE_1970:
            values = values - values[0]
            counted = f"counts {unit}" if unit else "counts"
            text = f"{name}: {source.column!r} {counted} from 1970; the times are seconds since the first row."
            findings.append(Finding(name, None, None, "note", "dates", text))
        if source.derivative:
            values, text = _rate(values, columns["t"], standard, source.column, path)
            findings.append(Finding(name, standard, None, "warning", "differentiated", f"{name}: {text}."))
        if source.integral:
            values, text = way_of(values, columns["t"], standard, source.column, path)
            findings.append(Finding(name, standard, None, "note", "added_up", f"{name}: {text}."))
        absurd = (np.abs(values) > ABSURD) & (standard != "t")
        values = np.where(absurd, np.nan, values)
        if standard in channels.inputs:
            if now_and_then(values) or (source.held and np.isfinite(values[:1]).all()):
                values, severity, text = held(columns["t"], values, standard)
                findings.append(Finding(name, standard, None, severity, "held_command", f"{name}: {text}."))
            values, rows = _held(values, standard, source.column, table, path)
            what = f"input {standard!r} has no value and was held from the sample before"
            note(standard, rows, "held_input", what, "fill in what was applied")
        elif standard in channels.measured:
            what = f"output {standard!r} is beyond {ABSURD:.0e}, which counts as not measured,"
            note(standard, np.flatnonzero(absurd), "infinite", what, "repair what wrote it")
            empty = np.flatnonzero(np.isnan(values)) if np.isnan(values).all() else []
            what = f"column {source.column!r} is there and holds no usable number,"
            note(standard, np.array(empty), "empty_column", what, "fill it or take it out")
        columns[standard] = values

    taken = {source.column for source in sources.values() if source.interval is None}
    rest = [column for column in table.frame.columns if column not in taken]
    # A column that a mapping passed over keeps its numbers under a name that cannot be mistaken for the channel.
    clear = [f"{column} (file)" if column in columns else column for column in rest]
    extra = table.frame.loc[:, rest].set_axis(clear, axis="columns")
    poses = [pose for pose in POSE if pose not in channels.measured and pose in (*columns, *clear)]
    extra = extra.assign(**{pose: _pose(pose, columns.get(pose), table, path) for pose in poses})
    for wanted, column in _overlooked(channels, sources, clear):
        text = f"{name}: column {column!r} is not used, and {wanted!r} is missing; rename or map it if it is the same."
        findings.append(Finding(name, column, None, "warning", "unused_column", text))
    for column in clear:
        if pd.api.types.is_numeric_dtype(extra[column]) and is_supply(str(column)):
            if text := said_fall(extra[column].to_numpy(dtype=float)):
                said = f"{name}, column {column!r}: {text}."
                findings.append(Finding(name, column, None, "warning", FALLING_SUPPLY, said))
    absent = np.full(len(table.frame), np.nan)
    inputs = np.stack([columns[channel] for channel in channels.inputs], axis=-1)
    outputs = np.stack([columns.get(channel, absent) for channel in channels.measured], axis=-1)
    try:
        return Log(name, columns["t"], inputs, outputs, channels, extra, str(path), tuple(findings))
    except LogError as error:
        lost = [f.column for f in findings if f.check == "infinite"]
        why = f" In {lost[0]!r} numbers beyond {ABSURD:.0e} count as not measured; mind its unit." if lost else ""
        raise LogError(str(error).replace(name, str(path), 1) + why) from None


def read_logs(
    paths: PathLike | Iterable[PathLike],
    robot: Any,
    *,
    mapping: Mapping[str, Any] | PathLike | None = None,
) -> LogSet:
    """Read the logs of one robot: CSV, Parquet, ROS 1 and ROS 2 bags (`pip install jaxid-robots[bags]`), WPILib data logs
    (`pip install jaxid-robots[wpilog]`) and MATLAB files.

    **Arguments:**

    - `paths`: a file (or a ROS 2 bag's folder), a pattern (`"logs/*.csv"`), or a list of them; patterns are read in
      alphabetical order. `"odometry.csv+imu.csv"` is one run in two tables, each with its own rows, both by one clock.
      `"run.mcap[3:18.5]"` is what lies from 3 s up to 18.5 s of a log's own time, `"run.mcap[3:]"` what
      comes after 3 s (`Log.window`).
    - `robot`: `"pioneer"`, `"omni"`, `"axis"`, `"differential"`, a `Channels`, or any object with `.channels`. Logs without the
      speeds of a robot's body may hold the angles of its wheels (`phi2`, `phi3` of the Pioneer); the robot of such logs is
      `robot.for_columns(logs[0].measured)`, which has `wheel_angles=True`.
    - `mapping`: standard name to the file's column, as a dict or the path of a TOML file:
      `V2 = "right_volts"`, `eta1 = {column = "speed_mm_s", scale = 0.001}` (value = scale * column + offset), for
      recordings `eta2 = {field = "/imu.angular_velocity.z"}`, for a speed of which only the position was measured
      `derivative = true`, for angles of wheels of which only the speeds were recorded, as differences of counts,
      `integral = true`; and, for files without a time column, `t = {interval = 0.001}`. Of a bag the times are those in the
      messages' headers; `t = {stamp = "receive"}` takes the recorder's.

    Recorded signals keep their own clocks: `jaxid.logs.combine` says how they come to the rows of one log.
    Returns a `LogSet`; columns that belong to no channel are kept in `Log.extra`. Files of equal name get their
    folder in front.

    Raises `LogError`, one sentence with file, column, sample and remedy, for whatever cannot be used: a missing,
    empty or binary file, no header, a missing or non-numeric column, a time that does not increase, unknown commands.
    What is merely doubtful becomes a finding (`LogSet.preflight`), and a `LogWarning` if it is more than a note.
    """
    channels = channels_of(robot)

    def read(channels: Channels) -> LogSet:
        sources = read_mapping(mapping, channels)
        return LogSet(one.cut(_read(one.path, one.name, channels, sources)) for one in named_files(paths))

    try:
        logs = read(channels)
    except LogError:
        other = _other_layout(robot, paths, mapping)
        if other == channels:
            raise
        logs = read(other)
    for finding in logs.preflight():
        if finding.severity != "note":
            warnings.warn(str(finding), LogWarning, stacklevel=2)
    return logs


def _other_layout(
    robot: Any, paths: PathLike | Iterable[PathLike], mapping: Mapping[str, Any] | PathLike | None
) -> Channels:
    """The layout of a robot's logs that the mapping names, or else that the first log's columns have beside that; its own where
    that log cannot be read."""
    own = channels_of(robot)

    def of(names: set[str]) -> Channels:
        if isinstance(robot, str):
            return layout_of(BY_COLUMNS.get(robot, (own,)), names)
        asked = hasattr(robot, "for_columns") and not isinstance(robot, type)
        return robot.for_columns(names).channels if asked else own

    try:
        named = set(mapped_names(mapping))
        return of(named) if of(named) != own else of({*first_columns(paths), *named})
    except (OSError, ValueError):
        return own


def read_planned(path: PathLike, robot: Any, mapping: Mapping[str, Any] | PathLike | None = None) -> Log | None:
    """A table of inputs alone, which nobody has driven yet, as the log of a robot that starts at rest; None where the file has
    any of the robot's outputs or lacks one of its inputs, or is no table. Raises `LogError` as `read_logs` does."""
    channels = channels_of(robot)
    (one,) = named_files(path)[:1]
    if format_of(one.path) is not None:
        return None
    sources = read_mapping(mapping, channels)
    measured = {sources.get(name, Source(name)).column for name in channels.measured}
    measured |= {column for name in channels.measured if name in sources for column in sources[name].columns}
    columns = {str(column) for column in read_table(one.path).frame.columns}
    driven = [sources.get(name, Source(name)) for name in ("t", *channels.inputs)]
    needed = {column for source in driven if source.interval is None for column in source.columns}
    if measured & columns or not needed <= columns:
        return None
    return one.cut(_read(one.path, one.name, channels, sources, planned=True))


def first_columns(paths: PathLike | Iterable[PathLike]) -> tuple[str, ...]:
    """Names of the columns of the first file, or of a recording's signals; none of a bag, whose fields a mapping names.

    Raises `LogError` if it cannot be read.
    """
    path = files_of(paths)[0]
    kind = format_of(path)
    if kind in ("wpilog", "mat", "tables"):
        recording = read_recording(path)
        return tuple(recording.series) if recording is not None else ()
    return () if kind is not None else tuple(str(column) for column in read_table(path).frame.columns)
