"""Pre-flight checks of the clock and of each column by itself: gaps, frozen and dead stretches, spikes, steps."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..logs.finding import Finding, Severity
from ..logs.log import Log
from ..logs.noise import sensor_step
from ..logs.rates import unwrapped
from ..logs.times import unit_doubt
from ..logs.unusable import at_the_end
from .motion import is_position
from .own_rows import as_measured, nothing_else_changes, on_several_clocks, placed

Array = NDArray[np.float64]

_FEW = 60
"""Samples below which most checks have nothing to go by."""
_BRIEF = 1.0  # s
_MUCH = 0.1
"""Change of an input, in shares of its range, that shows in one sample of a quick robot."""
_LITTLE = 0.03
"""The same, from which on it is a change at all."""


def finding(log: Log, column: str | None, sample: int | None, severity: Severity, check: str, text: str) -> Finding:
    """A `Finding` whose sentence starts with file, column, sample and time; `text` says what and gives the remedy."""
    place = [log.name]
    if column is not None:
        place.append(f"column {column!r}")
    if sample is not None:
        place.append(f"sample {sample} (t = {log.time[sample]:.6g} s)")
    return Finding(log.name, column, sample, severity, check, f"{', '.join(place)}: {text}.")


def quantum(values: Array) -> float:
    """The step between neighbouring levels of a quantised signal; 0 where the values are not quantised."""
    levels = np.unique(values)
    if len(levels) < 3:
        return float(np.ptp(levels))
    # Rounding (of scales, of text) leaves copies of a level that differ in late digits: merge them first.
    steps = np.diff(levels)
    steps = steps[steps > 1e-6 * np.ptp(levels)]
    step = float(np.min(steps))
    multiple = steps / step
    return step if np.all(np.abs(multiple - np.round(multiple)) < 0.05) and np.ptp(levels) / step < 2000 else 0.0


def runs(same: NDArray[np.bool_]) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Starts and lengths of the stretches over which `same` is True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]])))
    return edges[::2], edges[1::2] - edges[::2]


def _clock(log: Log, measured: str = "") -> Iterator[Finding]:
    """Findings about the times of a log; of those of one channel, `measured`, where commands have clocks of their own."""
    steps = np.diff(log.time)
    usual = log.sampling_interval
    gaps = np.flatnonzero(steps > 2.5 * usual)
    if len(gaps):
        longest = int(gaps[np.argmax(steps[gaps])])
        unknown = "the input there is unknown; cut the log at the gap unless the input was held through it"
        if measured:
            unknown = "nothing compares the simulation there with the robot; look at what lost them, or cut the log at the gap"
        text = (
            f"the clock jumps by {steps[longest]:.4g} s where {usual:.4g} s is usual ({len(gaps)} gap(s) in all), and "
            f"{unknown}"
        )
        yield finding(log, "t", longest, "warning", "time_gap", text)
    skipped = np.flatnonzero((steps > 1.5 * usual) & (steps <= 2.5 * usual))
    if len(skipped) and np.median(np.abs(steps - usual)) < 0.02 * usual:
        text = (
            f"an otherwise even clock skips a sample ({len(skipped)} time(s)), so a row is missing; look at what lost it, "
            "and cut the log there if the input changed"
        )
        yield finding(log, "t", int(skipped[0]), "note", "skipped_row", text)
    uneven = np.abs(steps - usual) > 0.1 * usual
    uneven[gaps] = False
    if uneven.mean() > 0.05:
        text = (
            f"{uneven.mean():.0%} of the sampling intervals differ by more than 10 % from {usual:.4g} s; make sure "
            "that the times are those of the measurement and not of its arrival"
        )
        yield finding(log, "t", int(np.argmax(uneven)), "warning", "clock_jitter", text)
    if doubt := unit_doubt(log.time):
        text = f"{doubt}; map t with the scale that gives seconds (counted rows: the sampling interval)"
        yield finding(log, "t", None, "warning", "time_unit", text)


def _missing(log: Log, name: str, values: Array) -> Iterator[Finding]:
    missing = np.isnan(values)
    if not missing.any():
        return
    first = int(np.argmax(missing))
    spacing = np.diff(np.flatnonzero(~missing))
    usual = np.median(spacing) if len(spacing) else 1.0
    even = len(spacing) > 3 and spacing.min() > 1 and np.ptp(spacing) <= 1
    if even or (
        len(spacing) > 3 and usual > 1 and np.mean(np.abs(spacing - usual) < 1) > 0.9 and spacing.max() <= 3.5 * usual
    ):
        lost = int(np.sum(np.round(spacing / usual) - 1))
        left = f" ({lost} sample(s) of it left out)" if lost and not even else ""
        text = f"measured at one row in {usual:.0f}, the others do not count{left}; nothing to do if it is slower"
        yield finding(log, name, first, "note", "slow_sensor", text)
        return
    text = (
        f"{missing.sum()} of {len(missing)} samples are not measured and do not count; look for the cause if they come "
        "in stretches"
    )
    yield finding(log, name, first, "warning", "missing_samples", text)


def _turns(log: Log, name: str, values: Array) -> Iterator[Finding]:
    """An angle that jumps back at every turn, which the state of no model does."""
    turn = {"rad": 2.0 * np.pi, "deg": 360.0}.get(log.channels.units.get(name, ""), np.inf)
    jumps = np.flatnonzero(np.abs(np.diff(unwrapped(values) - values)) > 0.5 * turn)
    if len(jumps):
        text = (
            f"jumps by a whole turn {len(jumps)} time(s), which no model's angle does; put the turns together before "
            "(numpy.unwrap)"
        )
        row = int(np.flatnonzero(np.isfinite(log.output(name)))[jumps[0] + 1])
        yield finding(log, name, row, "warning", "turns", text)


def _answers(log: Log, name: str, steps: Array, away: Array) -> NDArray[np.bool_]:
    """Whether a sample that jumps `away` [T - 2] and back answers inputs that were there for one interval: it is no larger
    than the changes [T - 1] that follow other changes of the inputs in one sample, as those of a robot quicker than its log.
    What is neither a speed nor a position, such as a motor's current, may change with the inputs at once."""
    changes = np.abs(np.diff(log.inputs, axis=0))
    changed, moved = ((changes > share * np.ptp(log.inputs, axis=0)).any(axis=1) for share in (_MUCH, _LITTLE))
    if name not in log.channels.mixing and changed.any():
        usual = float(np.quantile(np.abs(steps[changed]), 0.9))
        return ((moved[:-1] & changed[1:]) | (changed[:-1] & moved[1:])) & (away <= usual)
    if not changed[:-1].any():
        return np.zeros(len(away), bool)
    usual = float(np.quantile(np.abs(steps[1:][changed[:-1]]), 0.9))
    return np.append(False, changed[:-2] & changed[1:-1]) & (away <= usual)


def _answers_at_the_end(log: Log, sizes: Array) -> bool:
    """Whether the last change, of those of these `sizes` [T - 1], answers a change of the inputs just before: it is not far
    larger than others that do."""
    changes = np.abs(np.diff(log.inputs, axis=0))
    changed = (changes > _MUCH * np.ptp(log.inputs, axis=0)).any(axis=1)
    after = sizes[1:-1][changed[:-2]]
    return bool(changed[-2] and after.size and sizes[-1] <= 2.0 * after.max())


def _spikes(log: Log, name: str, values: Array) -> Iterator[Finding]:
    """Isolated samples that jump away from both neighbours and back, far beyond every change nearby."""
    if len(values) < 16:
        return
    steps = np.diff(values)
    away = np.where(steps[:-1] * steps[1:] < 0, np.minimum(np.abs(steps[:-1]), np.abs(steps[1:])), 0.0)
    # The largest change among four steps before and four after, those that touch the sample itself left out.
    around = np.lib.stride_tricks.sliding_window_view(np.pad(np.abs(steps), 4), 10)[: len(away)]
    nearby = np.delete(around, (4, 5), axis=1).max(axis=1)
    spread = 1.4826 * np.median(np.abs(steps - np.median(steps)))
    low, high = np.quantile(values, [0.01, 0.99])
    least = max(7 * spread, 4.5 * quantum(values), 0.05 * (high - low))
    spikes = 1 + np.flatnonzero((away > 3 * nearby) & (away > least))
    # Of a robot quicker than its log, an input that was there for one sample makes one, too.
    spikes = spikes[~_answers(log, name, steps, away)[spikes - 1]]
    # The first and last sample have one neighbour; a start or stop changes on over the next samples, or, of a robot quicker
    # than its log, is over before the next one: then it is from rest, or to it.
    sizes = np.abs(steps)
    moving = np.abs(values) > 3 * spread
    if moving[0] and sizes[0] > max(6 * sizes[1:5].max(), 2 * least):
        spikes = np.append(0, spikes)
    last = moving[-1] and sizes[-1] > max(6 * sizes[-5:-1].max(), 2 * least)
    if last and not _answers_at_the_end(log, sizes):
        spikes = np.append(spikes, len(values) - 1)
    if len(spikes):
        first = int(spikes[0])
        off = np.abs(values[first] - values[first - 1 if first else 1])
        text = (
            f"{values[first]:.4g} lies {off:.3g} off its neighbours ({len(spikes)} such spike(s)); leave the cell empty, "
            "or run prepare(outliers=True)"
        )
        yield finding(log, name, first, "warning", "spike", text)


def _stood(values: Array, start: int, length: int, step: float) -> bool:
    """Whether a position that stays the same may be one where the robot stood: it came to rest before, by smaller and smaller
    changes, and went on from there. One that froze stops in the middle of its motion, or has a way to make up for after."""
    end = start + length
    before = abs(values[start] - values[start - 1]) if start else 0.0
    after = abs(values[end + 1] - values[end]) if end + 1 < len(values) else 0.0
    return after <= 8 * step and not before >= step > 3 * sensor_step(values)


def _frozen(log: Log, name: str, values: Array, still: NDArray[np.bool_]) -> Iterator[Finding]:
    """Stretches without any change while the rest of the log changes (`still[k]`: nothing else changed after k)."""
    equal = np.diff(values) == 0
    starts, lengths = runs(equal)
    changes = np.flatnonzero(~equal)
    if not len(starts) or not len(changes):
        return
    held, position = np.diff(changes), is_position(log, name)
    step = np.median(np.abs(np.diff(values)[changes]))
    counts = position and step < 1.5 * sensor_step(values)  # of a counter that creeps each step takes its time
    if len(held) > 8 and not counts and np.median(held) >= 2 and np.mean(np.abs(held - np.median(held)) <= 1) > 0.9:
        text = (
            f"changes only every {np.median(held):.0f} samples; leave the repeated cells empty, so that each "
            "measurement counts once and at its own time"
        )
        yield finding(log, name, int(changes[0]) + 1, "warning", "slow_sensor", text)
        return
    typical = np.quantile(held, 0.95) if len(held) else 1.0
    enough = max(10.0, 8 * typical)
    found = []
    for start, length in zip(starts, lengths, strict=True):
        if length < enough or still[start : start + length].mean() > 0.5:
            continue
        if start and abs(values[start] - values[start - 1]) < 1e-4 * np.nanmax(np.abs(values)):
            continue  # settled there smoothly, as only a simulation without noise can
        # A robot that stands still reads a true zero; a sensor that drops out gets there in one jump.
        jump = abs(values[start] - values[start - 1]) if start else 0.0
        if _stood(values, int(start), int(length), step) if position else values[start] == 0 and jump <= 8 * step:
            continue
        found.append((int(start), int(length)))
    if found:
        start, length = max(found, key=lambda stretch: stretch[1])
        # A wheel that sticks while the other turns reads zero, too, coming to it from a speed that counts make coarse.
        stood = (
            "" if position or values[start] else ", unless what it measures stood still, where nothing is to be done"
        )
        text = (
            f"stays at exactly {values[start]:.4g} for {length + 1} samples while other channels change ({len(found)} "
            f"such stretch(es)), so the sensor was frozen{stood}; leave those cells empty or cut the log"
        )
        yield finding(log, name, start, "warning", "frozen_sensor", text)


def _saturated(log: Log, name: str, values: Array) -> Iterator[Finding]:
    """A signal of many levels that keeps returning to exactly its extreme: clipped, unlike a two-level sequence."""
    at = at_the_end(values)
    if at.any():
        text = (
            f"{at.mean():.0%} of the samples lie at exactly ±{np.max(np.abs(values)):.4g}; if that is a limit of the supply or "
            "sensor, log what was really applied or measured, or drive less hard"
        )
        # A command may well be held at its largest value; a sensor that keeps returning to one exact value is clipped.
        commanded = name in log.channels.inputs
        yield finding(log, name, int(np.flatnonzero(at)[0]), "note" if commanded else "warning", "saturated", text)


def _resolution(log: Log, name: str, values: Array) -> Iterator[Finding]:
    step = quantum(values)
    low, high = np.quantile(values, [0.05, 0.95])
    if len(np.unique(values)) > 2 and step > 0.02 * (high - low) > 0:
        text = (
            f"steps of {step:.3g} are coarse against a range of {high - low:.3g}; take this column's noise as at least "
            f"{step / np.sqrt(12):.2g}"
        )
        yield finding(log, name, None, "note", "quantisation", text)


def _idle(log: Log) -> Iterator[Finding]:
    """Rows that repeat the row before. A simulation without noise also does so once it has settled: not counted."""
    outputs = np.nan_to_num(log.outputs)
    change = np.diff(outputs, axis=0)
    same = np.all(change == 0, axis=1) & np.all(np.diff(log.inputs, axis=0) == 0, axis=1)
    same &= np.isfinite(log.outputs[1:]).any(axis=1)  # a row between the samples of slower sensors repeats nothing
    settled = 1e-4 * np.maximum(np.ptp(outputs, axis=0), 1e-300)
    for start, length in zip(*runs(same), strict=True):
        if start and change[start - 1].any() and np.all(np.abs(change[start - 1]) < settled):
            same[start : start + length] = False
    share = same.mean()
    if share > 0.25:
        starts, lengths = runs(same)
        longest = int(starts[np.argmax(lengths)])
        text = (
            f"{share:.0%} of the rows repeat the row before ({len(starts)} stretch(es), the longest "
            f"{lengths.max() + 1} rows from here), so the robot idled or the recorder repeated itself; cut these "
            "stretches, and check the clock where they occur in motion"
        )
        yield finding(log, None, longest, "warning" if share > 0.4 else "note", "idle", text)


def _pulses(log: Log, name: str, values: Array) -> Iterator[Finding]:
    """One or two samples of an input far beyond all that it ever holds: hardly a command."""
    usual = np.quantile(np.abs(values), 0.99)
    starts, lengths = runs(np.abs(values) > 3 * usual)
    short = starts[lengths <= 2]
    if usual > 0 and len(short):
        first = int(short[0])
        text = (
            f"{values[first]:.4g} lies far beyond the {usual:.4g} that the input else stays below ({len(short)} such "
            "place(s)); put in what was really applied"
        )
        yield finding(log, name, first, "warning", "spike", text)


def _inputs(log: Log) -> Iterator[Finding]:
    seen: dict[bytes, str] = {}
    for name in log.channels.inputs:
        values = log.input(name)
        if np.ptp(values) == 0:
            text = f"is {values[0]:.4g} throughout; take care that other logs vary it"
            yield finding(log, name, None, "note", "constant_input", text)
        elif (other := seen.setdefault(values.tobytes(), name)) != name:
            text = (
                f"is the same as {other!r} throughout, to the last digit; if one column was recorded for both, map each "
                "input to its own"
            )
            yield finding(log, name, None, "note", "equal_inputs", text)
        yield from _pulses(log, name, values)
        yield from _saturated(log, name, values)


def _on_their_own_rows(log: Log) -> Iterator[Finding]:
    """Each measured column on its own clock."""
    for name in log.measured:
        alone = as_measured(log, name)
        if alone is None:
            continue
        own, rows = alone
        values = own.output(name)
        found = [*_clock(own, name)]
        if np.ptp(values) > 0:
            yield from _turns(log, name, values)
            found += [*_frozen(own, name, values, nothing_else_changes(log, name, rows)), *_spikes(own, name, values)]
            found += [*_saturated(own, name, values), *_resolution(own, name, values)]
        yield from placed(found, rows, name)


def check_samples(log: Log, also: tuple[str, ...]) -> Iterator[Finding]:
    """Findings about the clock, the inputs, and each measured column (and each of `also`, extra columns)."""
    if len(log) < _FEW:
        text = (
            f"{len(log)} samples over {log.duration:.3g} s are too few to look for faults, and to identify much from; "
            "record a longer run"
        )
        yield finding(log, None, None, "warning", "short_log", text)
    elif log.duration < _BRIEF:
        text = f"the run lasts {log.duration:.3g} s only; if that is not so, map t with the scale that gives seconds"
        yield finding(log, None, None, "note", "short_log", text)
    yield from _inputs(log)
    if on_several_clocks(log):
        yield from _on_their_own_rows(log)
        return
    yield from _clock(log)
    yield from _idle(log)
    columns = {name: log.output(name) for name in log.measured}
    columns |= {name: np.asarray(log.extra[name], dtype=float) for name in also}
    everything = np.concatenate([log.inputs, np.nan_to_num(np.stack(list(columns.values()), axis=-1))], axis=1)
    changed = np.diff(everything, axis=0) != 0
    for position, (name, values) in enumerate(columns.items()):
        yield from _missing(log, name, values)
        there = np.isfinite(values)
        if not there.any() or np.ptp(values[there]) == 0:
            continue
        if name in log.measured:
            yield from _turns(log, name, values[there])
        values = np.interp(log.time, log.time[there], values[there])
        others = np.delete(changed, log.inputs.shape[1] + position, axis=1)
        yield from _frozen(log, name, np.where(there, values, np.nan), ~others.any(axis=1))
        yield from _spikes(log, name, values)
        yield from _saturated(log, name, values)
        yield from _resolution(log, name, values)
