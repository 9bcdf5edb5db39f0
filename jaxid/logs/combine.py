"""Signals with clocks of their own on the rows of one log.

- The rows are the instants at which something was measured, and those at which a command changed: nothing is resampled.
  Where a channel has no sample at a row, that cell is NaN, "not measured".
- Instants closer together than 2 % of the shortest sampling interval become one row, that of the fastest channel; by how much
  a sample was moved so at most is a finding.
- Commands are held from when they change (zero-order hold). Where they change oftener than anything is measured, as measured
  voltages do, each row has their mean until the next row instead, which gives the same impulse.
- The log begins with the first measurement at which every command is known and every output has begun. It ends with the last
  measurement, or where a command that used to come regularly stays away.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .finding import LogError, Severity

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

NEAR = 0.02
"""Share of the shortest sampling interval up to which two instants are one."""
_REGULAR = 3.0
"""Largest interval of a regular publisher, in usual ones; a longer silence of one says that it has stopped."""
_ENOUGH = 10
"""Messages from which on a publisher may be called regular."""
_EVEN = 0.9
"""Share of the intervals of a regular publisher that are no longer than one and a half times the usual one."""
_WORTH_SAYING = 1.0  # s of a recording that is not used

Note = tuple[Severity, str, str | None, str]
"""Severity, check, channel, and what to say, without the file's name and full stop."""


class Signal(NamedTuple):
    """One channel's samples: instants [ns], increasing, and finite values."""

    time: Stamps
    values: Array


class Silence(NamedTuple):
    """A stretch in which a regular command stayed away and was held: it is unknown from `begin` [s of the log] on; what to
    say."""

    command: str
    begin: float
    severity: Severity
    text: str


@dataclass(frozen=True)
class Rows:
    """`time` [T] s from the log's first row, at `begin` [ns]; `inputs` and `outputs` [T] by channel; what to say; when
    commands stayed away."""

    time: Array
    begin: int
    inputs: dict[str, Array]
    outputs: dict[str, Array]
    notes: tuple[Note, ...]
    silences: tuple[Silence, ...] = ()


def usual_interval(time: Stamps) -> float:
    """Median interval [ns]; infinite for a single sample."""
    return float(np.median(np.diff(time))) if len(time) > 1 else float("inf")


def _regular(time: Stamps) -> float:
    """The interval [ns] at which a publisher repeats itself whether anything changes or not; infinite for one that does not."""
    if len(time) < _ENOUGH:
        return float("inf")
    steps = np.diff(time)
    usual = float(np.median(steps))
    return usual if np.mean(steps <= 1.5 * usual) >= _EVEN else float("inf")


def _known_until(time: Stamps) -> float:
    """How long a command counts as held [ns]: of a regular publisher not much longer than its interval."""
    return float(time[-1] + _REGULAR * _regular(time))


def silences(inputs: dict[str, Signal], start: int, stop: int) -> tuple[Silence, ...]:
    """Stretches within the log in which a regular command stayed away, and was held."""
    found: list[Silence] = []
    for name, signal in inputs.items():
        usual = _regular(signal.time)
        gaps = np.flatnonzero(np.diff(signal.time) > _REGULAR * usual)
        for gap in gaps[(signal.time[gaps + 1] > start) & (signal.time[gaps] < stop)]:
            last = float(signal.time[gap] - start)
            silent = float(signal.time[gap + 1] - signal.time[gap])
            text = (
                f"no message of command {name!r}, which comes every {usual * 1e-9:.3g} s, came for {silent * 1e-9:.3g} s from "
                f"t = {last * 1e-9:.4g} s on, and {signal.values[gap]:.4g} was held; cut the log there if something else was "
                "applied"
            )
            severity: Severity = "warning" if signal.values[gap] else "note"
            found.append(Silence(name, (last + 1.5 * usual) * 1e-9, severity, text))
    return tuple(found)


def _rows(instants: list[Stamps], near: float) -> tuple[Stamps, list[NDArray[np.int64]]]:
    """Rows for the instants of several channels, the fastest first, and the row of each of their samples.

    Instants within `near` [ns] of the row's first one share it, if they are of different channels.
    """
    times = np.concatenate(instants)
    owners = np.repeat(np.arange(len(instants)), [len(own) for own in instants])
    order = np.lexsort((owners, times))
    row = np.empty(len(times), dtype=np.int64)
    stamps: list[int] = []
    begin, members = 0, set[int]()
    for k, time, owner in zip(order.tolist(), times[order].tolist(), owners[order].tolist(), strict=True):
        if not stamps or time - begin > near or owner in members:
            stamps.append(time)
            begin, members = time, {owner}
        else:
            if owner < min(members):
                stamps[-1] = time
            members.add(owner)
        row[k] = len(stamps) - 1
    cuts = np.cumsum([len(own) for own in instants])[:-1]
    return np.array(stamps, dtype=np.int64), np.split(row, cuts)


def _changes(signal: Signal) -> Stamps:
    """Instants from which a command is another one."""
    return signal.time[1:][np.diff(signal.values) != 0]


def _apart(instants: Stamps, near: float) -> Stamps:
    """The first of each group of instants that lie within `near` [ns] of it."""
    kept: list[int] = []
    for instant in instants:
        if not kept or instant - kept[-1] > near:
            kept.append(int(instant))
    return np.array(kept, dtype=np.int64)


def held(signal: Signal, at: Stamps) -> Array:
    """The command in force at the instants `at`, none of which is before its first one."""
    return signal.values[np.searchsorted(signal.time, at, side="right") - 1]


def _mean_held(signal: Signal, rows: Stamps) -> Array:
    """The mean of a held command from each row to the next."""
    inside = (signal.time > rows[0]) & (signal.time < rows[-1])
    edges = np.unique(np.concatenate([rows, signal.time[inside]]))
    impulse = np.concatenate([[0.0], np.cumsum(held(signal, edges[:-1]) * np.diff(edges))])
    at = np.searchsorted(edges, rows)
    means = np.diff(impulse[at]) / np.diff(rows)
    return np.append(means, held(signal, rows[-1:]))


def _span(inputs: dict[str, Signal], outputs: dict[str, Signal], needed: set[str]) -> tuple[int, int, list[Note]]:
    """First and last instant [ns] of the log, and what is said of them."""
    known = max(signal.time[0] for signal in inputs.values())
    begun = max([signal.time[0] for name, signal in outputs.items() if name in needed], default=known)
    first = min(signal.time[0] for signal in outputs.values())
    last = max(signal.time[-1] for signal in outputs.values())
    start, stop, notes = max(known, begun), last, []
    for name, signal in inputs.items():
        until = _known_until(signal.time)
        if until < stop:
            lost = (last - until) * 1e-9
            text = f"command {name!r} stays away for the last {lost:.3g} s, which are left out; nobody knows what was applied"
            notes.append(("warning" if lost > _WORTH_SAYING else "note", "cut_end", name, text))
            stop = int(until)
        elif (silent := (last - signal.time[-1]) * 1e-9) > _WORTH_SAYING:
            text = f"command {name!r} is held for the last {silent:.3g} s, in which no message of it came"
            notes.append(("note", "held_to_the_end", name, text))
    if (lost := (start - first) * 1e-9) > _WORTH_SAYING:
        late = next(n for n, s in {**inputs, **outputs}.items() if s.time[0] == start and (n in inputs or n in needed))
        text = f"the first {lost:.3g} s are left out, since {late!r} begins only then"
        notes.append(("note", "cut_start", late, text))
    return int(start), int(stop), notes


def combine(inputs: dict[str, Signal], outputs: dict[str, Signal], needed: set[str]) -> Rows:
    """Signals by channel on one log's rows. `needed` are the outputs that have to have begun when the log begins.

    Raises `LogError` (a sentence without the file's name) where the channels have no time in common.
    """
    start, stop, notes = _span(inputs, outputs, needed)
    inside = {name: (signal.time >= start) & (signal.time <= stop) for name, signal in outputs.items()}
    parts = {name: Signal(s.time[inside[name]], s.values[inside[name]]) for name, s in outputs.items()}
    parts = {name: part for name, part in parts.items() if len(part.time)}
    if not needed <= set(parts) or max((len(part.time) for part in parts.values()), default=0) < 2:
        spans = ", ".join(
            f"{name} from {signal.time[0] * 1e-9:.6f} to {signal.time[-1] * 1e-9:.6f} s"
            for name, signal in {**inputs, **outputs}.items()
        )
        raise LogError(
            f"the channels have no time in common ({spans}); record them together, or choose the other clock by "
            't = {stamp = "receive"} or t = {stamp = "header"}.'
        )
    # Channels of one message have the same instants, and are one clock.
    ranked = sorted(parts, key=lambda name: usual_interval(parts[name].time))
    near = NEAR * usual_interval(parts[ranked[0]].time)
    near = 0.0 if not np.isfinite(near) else near
    rows, places = _rows([parts[name].time for name in ranked], near)
    measured = len(rows)

    changes = np.unique(np.concatenate([_changes(signal) for signal in inputs.values()]))
    changes = changes[(changes > rows[0]) & (changes < rows[-1])]
    before = np.searchsorted(rows, changes, side="right") - 1
    away = np.minimum(changes - rows[before], rows[before + 1] - changes) if len(changes) else changes
    own = _apart(changes[away > near], near)
    averaged = len(own) > measured
    if averaged:
        text = (
            f"commands change {len(own) / measured:.1f} times between two measurements; each row has their mean until the "
            "next, so that the impulse is right"
        )
        notes.append(("note", "mean_commands", None, text))
        columns = {name: _mean_held(signal, rows) for name, signal in inputs.items()}
    else:
        kept, rows = rows, np.union1d(rows, own)
        shift = np.searchsorted(rows, kept)
        places = [shift[place] for place in places]
        # A change just after its row counts from the row on.
        reach = np.minimum(rows + int(near), np.append(rows[1:] - 1, rows[-1]))
        columns = {name: held(signal, np.maximum(reach, signal.time[0])) for name, signal in inputs.items()}

    filled = {name: np.full(len(rows), np.nan) for name in outputs}
    moved, farthest = 0, ""
    for name, place in zip(ranked, places, strict=True):
        filled[name][place] = parts[name].values
        most = int(np.max(np.abs(rows[place] - parts[name].time)))
        if most > moved:
            moved, farthest = most, name
    if moved:
        share = moved / (near / NEAR)
        text = (
            f"samples within {NEAR:.0%} of the shortest sampling interval share a row: {farthest!r} is moved by up to "
            f"{moved * 1e-6:.3g} ms, {share:.1%} of it"
        )
        notes.append(("note", "moved_samples", farthest, text))
    clocks = {part.time.tobytes() for part in parts.values()}
    if len(clocks) > 1 or len(rows) > measured:
        text = (
            f"{len(clocks)} clock(s) of measurement and commands of their own gave {len(rows)} rows, {measured} of them with a "
            "measurement; a cell without one is NaN, and nothing was resampled"
        )
        notes.append(("note", "several_clocks", None, text))
    return Rows(
        (rows - rows[0]) / 1e9, int(rows[0]), columns, filled, tuple(notes), silences(inputs, int(rows[0]), stop)
    )
