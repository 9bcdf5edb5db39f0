"""From a recording to a log: the fields that a mapping names, on the clock that it says, put together by `combine`.

Decisions taken here, each leaving a finding that pre-flight repeats: whose stamps count, samples that are not finite or beyond
any physical size (not measured), messages that repeat the one before, positions that were differentiated, joints that some
messages lack.
"""

from collections.abc import Collection, Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from .channels import POSE, Channels
from .combine import Note, Rows, Signal, combine
from .counts import way_of
from .finding import SILENT_COMMAND, Finding, LogError
from .formats import format_of, read_recording
from .log import ABSURD, Log, did_you_mean
from .mapping import Source, sources_of
from .rates import rate, whole_way
from .series import Recording, Series
from .sums import with_summed_fields
from .supply import FALLING_SUPPLY, is_supply, said_fall

_OTHER_CLOCK = 1.0  # s between a message's stamp and its receipt that no transport takes
_CLOCKS_APART = 0.05  # s between the usual delays of two topics that no transport explains
_OVERTAKEN = 0.1
"""Share of a topic's messages that may come after later ones; two programs that publish one topic make more."""
_LATE = 20.0
"""Usual intervals by which they may; a clock that was set goes back by more."""
_BAGS = ("bag", "mcap", "db3", "folder")


class Used(NamedTuple):
    """A channel's source, the series that it is, and its stamps [ns] by the clock that counts."""

    source: Source
    series: Series
    time: np.ndarray


def _wanted(path: Path, channels: Channels, mapping: dict[str, Source]) -> dict[str, Source]:
    """Sources of the channels and poses that are to be looked for. Raises `LogError` for a bag without a mapping."""
    wanted = sources_of(channels, mapping)
    wanted |= {name: mapping[name] for name in POSE if name in mapping}
    if format_of(path) not in _BAGS:
        return wanted
    for name in channels:
        if name in mapping or name in channels.optional or channels.stood_in(name, mapping):
            continue
        raise LogError(
            f'{path}: nothing says which field is {name!r}; map it, such as {name} = "/topic.field"; '
            f"`jaxid look {path.name} --robot ROBOT --write run_map.toml` lists the fields and proposes a mapping."
        )
    return {name: source for name, source in wanted.items() if name in mapping}


def found(recording: Recording, field: str, name: str, path: Path) -> Series:
    """The series called `field`. Raises `LogError` where there is none, or one that cannot be used."""
    series = recording.series.get(field)
    if series is None:
        topic = recording.topics.get(field.split("[")[0].split(".")[0])
        if topic is not None and topic.remark:
            raise LogError(f"{path}: topic {topic.name!r} ({topic.kind}) has {topic.remark}; map {name!r} to another.")
        known = [other for other in recording.series if topic is None or recording.series[other].topic == topic.name]
        listed = ", ".join(known[:12]) + (f" and {len(known) - 12} more" if len(known) > 12 else "")
        near = did_you_mean(field, known)
        raise LogError(
            f"{path} has no field {field!r} (for {name!r}){near}; it has {listed:.600}: correct the mapping."
        )
    if series.fault:
        raise LogError(f"{path}: field {field!r} cannot be used, for {series.fault}; map {name!r} to a sound one.")
    return series


def _there(
    recording: Recording, path: Path, channels: Channels, wanted: dict[str, Source], mapping: dict[str, Source]
) -> dict[str, Series]:
    """The series of each channel that the recording has. Raises `LogError` for one that it must have and lacks."""
    there: dict[str, Series] = {}
    held = {name for name, source in wanted.items() if source.column in recording.series}
    for name, source in wanted.items():
        may_lack = name in channels.optional or channels.stood_in(name, held)
        if name not in mapping and source.column not in recording.series and may_lack:
            continue
        there[name] = found(recording, source.column, name, path)
    users: dict[tuple[str, bool, bool], str] = {}
    for name, series in there.items():
        twin = users.setdefault((series.name, wanted[name].derivative, wanted[name].integral), name)
        if twin != name and not {name, twin} <= set(channels.inputs):
            raise LogError(
                f"{path}: field {series.name!r} stands for both {twin!r} and {name!r}; map one of them elsewhere."
            )
    return there


def _clock(path: Path, used: dict[str, Series], stamp: str | None) -> tuple[dict[str, np.ndarray], list[Note]]:
    """Stamps [ns] of each channel's samples. Raises `LogError` where senders and recorder are on clocks of different epochs."""
    if stamp == "receive":
        return {name: series.received for name, series in used.items()}, []
    delays = {s.topic: float(np.median(s.received - s.stamped)) * 1e-9 for s in used.values() if s.stamped is not None}
    without = [name for name, series in used.items() if series.stamped is None]
    notes: list[Note] = []
    if not delays:
        text = 'no message says when it was measured (stamp "header"); the recorder\'s times count'
        return {n: s.received for n, s in used.items()}, [("note", "receive_stamps", None, text)] if stamp else []
    others = {**delays, **({used[without[0]].topic: 0.0} if without else {})}
    late, early = max(others, key=others.__getitem__), min(others, key=others.__getitem__)
    if without and max(map(abs, delays.values())) > _OTHER_CLOCK:
        far = max(delays, key=lambda topic: abs(delays[topic]))
        raise LogError(
            f"{path}: topic {far!r} has stamps {abs(delays[far]):.4g} s from the recorder's clock, and "
            f'{used[without[0]].topic!r} has none; write t = {{stamp = "receive"}} into the mapping, so that one clock counts.'
        )
    if others[late] - others[early] > _CLOCKS_APART:
        text = (
            f"messages of {late!r} usually arrive {others[late] * 1e3:.3g} ms after their stamps and those of {early!r} "
            f"{others[early] * 1e3:.3g} ms, so that their clocks may differ; synchronise them, or try "
            't = {stamp = "receive"}'
        )
        notes.append(("warning", "clocks_apart", None, text))
    if without:
        topics = ", ".join(dict.fromkeys(used[name].topic for name in without))
        usual = max(delays.values(), key=abs)
        text = (
            f"{topics} has no stamps of its own (for {', '.join(without)}), so that the recorder's count there, and the "
            f'senders\' for the rest, which it had {usual * 1e3:.3g} ms later; t={{stamp = "receive"}} takes one clock for all'
        )
        notes.append(("note", "receive_stamps", without[0], text))
    return {n: s.received if s.stamped is None else s.stamped for n, s in used.items()}, notes


def _late(time: np.ndarray) -> bool:
    """Whether stamps run backwards as messages do that others overtook on their way: few of them, by a few intervals."""
    step = np.diff(time)
    back, usual = step < 0, float(np.median(np.abs(step)))
    return bool(back.any() and np.mean(back) <= _OVERTAKEN and -step.min() <= _LATE * usual)


def _ordered(path: Path, name: str, one: Used, values: np.ndarray, command: bool) -> tuple[Signal, int, int]:
    """Samples in increasing time, how many repeated the one before, and how many came after later ones. Of commands with one
    stamp the last counts.

    Raises `LogError` for stamps that run backwards, or repeat with another value.
    """
    time, late = one.time, 0
    if one.series.stamped is not None and time is not one.series.received and _late(time):
        late = int(np.count_nonzero(np.diff(time) < 0))
        order = np.argsort(time, kind="stable")
        time, values = time[order], values[order]
    step = np.diff(time)
    same = step == 0
    bad = np.flatnonzero((step < 0) | (same & (values[1:] != values[:-1]) & (not command)))
    if len(bad):
        k = int(bad[0])
        kind = (
            "repeats the stamp before with another value" if step[k] == 0 else "is stamped earlier than the one before"
        )
        where = f"{(time[k] - time[0]) * 1e-9:.6f} s, then {(time[k + 1] - time[0]) * 1e-9:.6f} s after its first"
        other = "header" if time is one.series.received else "receive"
        if one.series.stamped is None:
            remedy = "cut the recording there if the clock restarted"
        else:
            remedy = f't = {{stamp = "{other}"}} takes the other clock, unless two programs publish it'
        raise LogError(
            f"{path}: message {k + 1} of topic {one.series.topic!r} ({name!r}) {kind} ({where}; {len(bad)} such "
            f"place(s)); {remedy}."
        )
    keep = np.append(~same, True) if command else np.append(True, ~same)
    return Signal(time[keep], values[keep]), 0 if command else int(same.sum()), late


def _speed(signal: Signal, source: Source, name: str, path: Path) -> tuple[Signal, Note]:
    """A speed from a measured position, and what that costs."""
    seconds = (signal.time - signal.time[0]) * 1e-9
    speed, text = rate(seconds, signal.values, name, source.column, path)
    return Signal(signal.time[1:-1], speed[1:-1]), ("warning", "differentiated", name, text)


def _signals(
    path: Path, channels: Channels, wanted: dict[str, Source], there: dict[str, Series], clock: dict[str, np.ndarray]
) -> tuple[dict[str, Signal], list[Note]]:
    """Samples by channel, in SI units. Raises `LogError` for commands that are not finite and for stamps out of order."""
    signals: dict[str, Signal] = {}
    notes: list[Note] = []
    for name, series in there.items():
        source, command = wanted[name], name in channels.inputs
        with np.errstate(over="ignore"):
            values = source.scale * series.values + source.offset
        bad = ~(np.abs(values) <= ABSURD)
        if bad.any() and command:
            raise LogError(
                f"{path}: field {series.name!r} (input {name!r}) is {values[bad][0]:.4g} in message {np.flatnonzero(bad)[0]}; "
                "cut the recording there, since nobody knows what was applied."
            )
        infinite = bad & ~np.isnan(values)
        if infinite.any():
            text = f"{series.name!r} is beyond {ABSURD:.0e} in {infinite.sum()} message(s), which count as not measured"
            notes.append(("warning", "infinite", name, text))
        if bad.all():
            raise LogError(f"{path}: field {series.name!r} (for {name!r}) holds no usable number; map another one.")
        one = Used(source, series, clock[name])
        whole, repeated, late = _ordered(path, name, one, series.values, command)
        if late:
            text = (
                f"{late} message(s) of {series.topic!r} came after later ones and were put in the order of their stamps"
            )
            notes.append(("warning", "out_of_order", name, text))
        if repeated:
            text = f"{repeated} message(s) of {series.topic!r} repeat the one before, stamp included, and were left out"
            notes.append(("warning", "repeated_row", name, text))
        values, text = whole.values, ""
        turns = name in channels.positions and not source.integral
        if turns or source.derivative:  # in the sensor's own unit, in which its turns are whole
            values, text = whole_way(1e-9 * (whole.time - whole.time[0]), values, name, source.column)
        if text:
            notes.append(("warning", "turns", name, text))
        with np.errstate(over="ignore"):
            values = source.scale * values + source.offset
        fine = np.abs(values) <= ABSURD
        signal = Signal(whole.time[fine], values[fine])
        if source.derivative:
            signal, note = _speed(signal, source, name, path)
            notes.append(note)
        if source.integral:
            way, text = way_of(values, 1e-9 * (whole.time - whole.time[0]), name, source.column, path)
            signal = Signal(whole.time, way)
            notes.append(("note", "added_up", name, text))
        signals[name] = signal
    return signals, notes


def _absent(recording: Recording, there: dict[str, Series]) -> Iterable[Note]:
    """Joints and frames that only some of their topic's messages have."""
    for name, series in there.items():
        topic = recording.topics.get(series.topic)
        if topic is None or "[" not in series.name or not topic.kind.endswith(("JointState", "TFMessage")):
            continue
        if len(series) < topic.messages:
            text = f"{series.name!r} is in {len(series)} of {topic.messages} messages; in the others it counts as not measured"
            yield ("note", "not_in_every_message", name, text)


def _falling(recording: Recording, used: Collection[str]) -> Iterable[Note]:
    """Supplies whose voltage falls, one of every topic; a field that is a channel's is looked at as such."""
    topics = set()
    for series in recording.series.values():
        if series.fault or series.name in used or series.topic in topics or not is_supply(series.name, series.unit):
            continue
        if text := said_fall(series.values):
            topics.add(series.topic)
            yield ("warning", FALLING_SUPPLY, None, f"{series.name!r} {text}")


def _poses(rows: Rows, signals: dict[str, Signal]) -> tuple[pd.DataFrame, list[Note]]:
    """Poses at their own rows, their nearest sample at the first."""
    columns, notes = {}, []
    stamps = rows.begin + np.round(rows.time * 1e9).astype(np.int64)
    for name, signal in signals.items():
        nearest = int(np.argmin(np.abs(signal.time - rows.begin)))
        column = np.full(len(stamps), np.nan)
        at = np.searchsorted(stamps, signal.time)
        exact = (at < len(stamps)) & (stamps[np.minimum(at, len(stamps) - 1)] == signal.time)
        column[at[exact]] = signal.values[exact]
        column[0] = signal.values[nearest]
        apart = (signal.time[nearest] - rows.begin) * 1e-9
        if apart:
            text = f"the run starts at the {name!r} that was measured {abs(apart):.3g} s {'after' if apart > 0 else 'before'}"
            notes.append(("note" if abs(apart) < 0.2 else "warning", "pose_at_start", name, text))
        columns[name] = column
    return pd.DataFrame(columns), notes


def _once(notes: Iterable[Note]) -> list[Note]:
    """Notes without those that say of another channel of the same topic what was said."""
    kept: dict[tuple[str, str, str], Note] = {}
    for severity, check, channel, text in notes:
        kept.setdefault((severity, check, text), (severity, check, channel, text))
    return list(kept.values())


def _after(rows: Rows, begin: float) -> int:
    """The first row later than `begin` [s]."""
    return min(int(np.searchsorted(rows.time, begin, side="right")), len(rows.time) - 1)


def read_recorded(path: Path, name: str, channels: Channels, mapping: dict[str, Source]) -> Log:
    """A recording (a bag, a data log, a MATLAB file) as a log called `name`.

    Raises `LogError`, one sentence with file, topic and remedy, for whatever cannot be used.
    """
    time = mapping.get("t", Source("t"))
    if time.interval is not None:
        raise LogError(f"{path} has time stamps of its own; take t = {{interval = ...}} out of the mapping.")
    wanted = _wanted(path, channels, mapping)
    fields = [field for source in wanted.values() for field in source.columns]
    recording = read_recording(path, fields, time.column if "t" in mapping else None)
    assert recording is not None  # the caller has looked
    plain = recording
    recording, summed = with_summed_fields(plain, wanted, lambda field, name: found(plain, field, name, path), path)
    there = _there(recording, path, channels, wanted, mapping)
    clock, notes = _clock(path, there, time.stamp)
    # Of tables the times are seconds already, by what the column's name or size says.
    scale = time.scale / (recording.time.scale if recording.time is not None else 1.0)
    if time.scale != 1.0 and scale != 1.0:
        clock = {n: np.round(scale * stamps).astype(np.int64) for n, stamps in clock.items()}
    signals, more = _signals(path, channels, wanted, there, clock)
    notes = [*(("warning", check, None, text) for check, text in recording.notes), *notes, *more]
    notes += [("note", check, None, text) for check, text in dict.fromkeys(summed)]
    notes += _absent(recording, there)
    notes += _falling(recording, {series.name for series in there.values()})
    try:
        inputs = {n: signals[n] for n in channels.inputs}
        outputs = {n: signals[n] for n in channels.measured if n in signals}
        rows = combine(inputs, outputs, {n for n in channels.outputs if n in outputs})
        poses, more = _poses(rows, {n: s for n, s in signals.items() if n in POSE and n not in channels.measured})
        absent = np.full(len(rows.time), np.nan)
        columns = np.stack([rows.outputs.get(n, absent) for n in channels.measured], axis=-1)
        commands = np.stack([rows.inputs[n] for n in channels.inputs], axis=-1)
        told = [
            Finding(name, channel, None, severity, check, f"{name}: {text}.")
            for severity, check, channel, text in _once([*notes, *rows.notes, *more])
        ]
        told += [
            Finding(name, one.command, _after(rows, one.begin), one.severity, SILENT_COMMAND, f"{name}: {one.text}.")
            for one in rows.silences
        ]
        return Log(name, rows.time + time.offset, commands, columns, channels, poses, str(path), tuple(told))
    except LogError as error:
        said = str(error)
        raise LogError(said.replace(name, str(path), 1) if said.startswith(name) else f"{path}: {said}") from None
