"""Tables of a report: one description, rendered for a terminal here and for pages and notebooks by `page.html.jinja`."""

import io
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap
from types import MappingProxyType

from rich import box
from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

from .._table import columns
from ..estimate.confidence.agreement import Agreement
from ..estimate.residual_tests import FALSE_ALARM, ResidualTest
from ..estimate.result import Estimate

_STYLES = {"good": "green", "bad": "bold red", "dim": "dim"}
_STATUS = {"not_identifiable": "not identifiable", "at_bound": "at its bound", "fixed": "fixed"}
_REJECTED = (
    "Not white: dynamics are missing, or the sensor's noise is coloured. Follows an input: part of what that input "
    "does is not in the model. Not Gaussian: outliers, or errors that depend on the motion (a coloured residual often "
    "is not)."
)
Estimates = Mapping[str, Mapping[str, Estimate | None]]


@dataclass(frozen=True)
class Mark:
    """An estimate in a drawn interval: `low`, `value` and `high` across it [%], how far down it stands, and its colour."""

    low: float
    value: float
    high: float
    at: float
    colour: str


@dataclass(frozen=True)
class Interval:
    """95 % intervals drawn side by side, and in words."""

    marks: tuple[Mark, ...]
    words: str


@dataclass(frozen=True)
class Cell:
    """Text with a `mark`: "good", "bad" or "dim", with "value" (never wrapped) or "words" (aligned left), or nothing. Pages
    show `detail` below it, small, and an `interval` in its place."""

    text: str
    mark: str = ""
    detail: str = ""
    interval: Interval | None = None


@dataclass(frozen=True)
class Table:
    """A titled table; the first column is left-aligned, the others right. `notes` stand below it."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()


def title_of(label: str) -> str:
    """A method's label in words: "output_error" becomes "output error"."""
    return label.replace("_", " ")


def number(value: float, digits: int = 4) -> str:
    """A number with `digits` significant digits, "-" for NaN."""
    if not math.isfinite(value):
        return "-" if math.isnan(value) else str(value)
    text = f"{value:#.{digits}g}"  # "1.00": trailing zeros are digits that were computed
    return text.rstrip(".")


def constant(value: float) -> str:
    """A given number, as short as it is; "-" for NaN."""
    return f"{value:.6g}" if math.isfinite(value) else "-"


_DIGITS = 14
"""Decimals of a number near one that mean anything."""


def with_error(value: float, std_error: float) -> str:
    """ "0.3184 ± 0.0012": both to two significant digits of the standard error; the value alone where there is none."""
    if not math.isfinite(value):
        return "-"
    if not (math.isfinite(std_error) and std_error > 0):
        return number(value)
    power = math.floor(math.log10(max(abs(value), std_error)))
    # Powers of ten only where plain decimals would be hard to read.
    shift = power if power < -3 or power > 5 else 0
    value, std_error = value / 10.0**shift, std_error / 10.0**shift
    decimals = max(1 - math.floor(math.log10(std_error)), 0)
    if decimals > _DIGITS:  # more than a double has: the error of what diverged
        return f"{number(value * 10.0**shift)} ± {number(std_error * 10.0**shift, 2)}"
    text = f"{value:.{decimals}f} ± {std_error:.{decimals}f}"
    return f"({text})e{shift}" if shift else text


def percent(value: float) -> str:
    """ "+0.35 %"; "-" for NaN."""
    if not math.isfinite(value):
        return "-"
    if abs(value) >= 1e5:
        return f"{value:+.1e} %"
    decimals = 2 if abs(value) < 1 else 1 if abs(value) < 100 else 0
    return f"{value:+.{decimals}f} %"


_UNLIMITED = 10_000
"""Columns of a screen on which every table has room."""


_HEADINGS = (_UNLIMITED, 10, 1)
"""Columns that headings take at most, but for their longest word and their cells: the first with which a table has room."""


_CROWDED = 0.8
"""Share of a screen's width that the longest words of a table's columns take, from which on some are broken where it is too
wide: the widest columns are made narrower, whatever they hold."""


def _rich(table: Table, least: int) -> RichTable:
    """The table as Rich shows it, headings but the first wrapped between their words at `least` columns or their cells'."""
    shown = RichTable(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), show_edge=False)
    for position, name in enumerate(table.header):
        # Names must stay whole: a wrapped symbol cannot be read. Of a path that is too long no part is left out.
        justify, overflow = ("right", "fold") if position else ("left", "ellipsis")
        if position:
            cells = (len(row[position].text) for row in table.rows if position < len(row))
            name = "\n".join(wrap(name, max(least, *cells, *map(len, name.split()), 1), break_long_words=False))
        shown.add_column(Text(name), justify=justify, no_wrap=position == 0, overflow=overflow)
    for row in table.rows:
        shown.add_row(
            *(Text(cell.text, style=" ".join(_STYLES.get(mark, "") for mark in cell.mark.split())) for cell in row)
        )
    return shown


def _fitting(table: Table, console: Console, width: int) -> RichTable:
    """The table with headings as long as it has room for."""
    # Rich would fold a heading within its words before it makes any other column narrower.
    options = console.options.update(width=_UNLIMITED)
    tried = [_rich(table, least) for least in _HEADINGS]
    return next((own for own in tried if console.measure(own, options=options).maximum <= width), tried[1])


def _parts(table: Table, console: Console, width: int) -> list[Table]:
    """The table, or, where it has more columns than `width` has room for, parts of it with the first column in each: a number
    that is broken within a cell is read as another one."""

    def broken(columns: Sequence[int]) -> bool:
        own = _with_columns(table, columns)
        measured = console.measure(_rich(own, _HEADINGS[-1]), options=console.options.update(width=_UNLIMITED))
        return measured.maximum > width and measured.minimum > _CROWDED * width

    left, parts = list(range(1, len(table.header))), []
    while left:
        taken = next(n for n in range(len(left), 0, -1) if n == 1 or not broken(left[:n]))
        parts.append(_with_columns(table, left[:taken]))
        left = left[taken:]
    return parts or [table]


def _with_columns(table: Table, columns: Sequence[int]) -> Table:
    """The table with its first column and these alone, without notes."""
    kept = (0, *columns)
    rows = tuple(tuple(row[k] for k in kept if k < len(row)) for row in table.rows)
    return Table(table.title, tuple(table.header[k] for k in kept), rows)


def to_text(tables: Sequence[Table], before: Sequence[str] = (), width: int | None = None) -> str:
    """Plain text, at most `width` columns wide (by default `columns`): the paragraphs `before`, then the tables."""
    width = width or columns()
    console = Console(file=io.StringIO(), force_jupyter=False, width=width, color_system=None, legacy_windows=False)
    for paragraph in before:
        console.print(Text(paragraph))
    for table in tables:
        console.print()
        console.print(Text(table.title, style="bold"))
        for place, part in enumerate(_parts(table, console, width)):
            if place:
                console.print()
            console.print(_fitting(part, console, width))
        for note in table.notes:
            console.print(Text(note))
    lines = console.file.getvalue().splitlines()  # type: ignore[attr-defined]
    return "\n".join(line.rstrip() for line in lines)


def value_cell(e: Estimate | None, doubtful: bool = False) -> Cell:
    """An estimate with its standard error, or why it has none; marked where its model is a `doubtful` one."""
    if e is None:
        return Cell("-", "dim")
    if e.status == "identified":
        return Cell(with_error(e.value, e.std_error) + (" ?" if doubtful else ""), "bad" if doubtful else "")
    return Cell(f"{constant(float(f'{e.value:.4g}'))} ({_STATUS[e.status]})", "dim")


def _error(e: Estimate | None, known: float | None, sure: bool) -> Cell:
    """Deviation in percent, marked where the reference is `sure` and more than three standard errors away."""
    if e is None or not known:
        return Cell("-", "dim")
    far = sure and e.status == "identified" and abs(e.value - known) > 3 * e.std_error
    return Cell(percent(100.0 * (e.value - known) / abs(known)), "bad" if far else "")


DOUBT = (
    "?: of a model that leaves more than noise, whose residual follows the motion, or that noise in its regressors biases, or "
    "of a search that ended at no minimum; it may be far off."
)
"""What the mark behind an estimate of a doubtful model means."""


def parameter_tables(
    estimates: Estimates, references: Mapping[str, float], kind: str, doubtful: Collection[str] = ()
) -> tuple[Table, ...]:
    """`estimates[method][name]` side by side; errors beside them or, with more than two methods, in their own table.

    `references` are the values that errors are relative to and `kind` says what they are: "true" or "published".
    `doubtful` are the methods whose fits were judged poor or failed.
    """
    names = list(next(iter(estimates.values())))
    methods = [title_of(label) for label in estimates]
    known = any(name in references for name in names)
    beside = known and len(methods) <= 2
    header = ["parameter", "unit", *([kind] if known else [])]
    header += [title for method in methods for title in ((method, "error") if beside else (method,))]
    rows, errors = [], []
    for name in names:
        own = [found[name] for found in estimates.values()]
        error = [_error(e, references.get(name), kind == "true") for e in own]
        unit = next((e.unit for e in own if e and e.unit), "")
        cells = [Cell(name), Cell(unit, "dim")]
        cells += [Cell(constant(references.get(name, math.nan)))] if known else []
        for label, e, cell in zip(estimates, own, error, strict=True):
            shown = value_cell(e, label in doubtful)
            cells += [shown, cell] if beside else [shown]
        rows.append(tuple(cells))
        errors.append((Cell(name), *error))
    relative = f"rror is relative to the {kind} value."
    note = "± is one standard error" + (f"; e{relative}" if beside else ".")
    notes = (note, DOUBT) if doubtful else (note,)
    found = Table("Parameters", tuple(header), tuple(rows), notes)
    if not known or beside:
        return (found,)
    return found, Table("Errors of the parameters", ("parameter", *methods), tuple(errors), (f"E{relative}",))


def held_out_table(
    held_out: Mapping[str, Agreement],
    fitted: Mapping[str, Agreement],
    noise: Mapping[str, float],
    units: Mapping[str, str],
) -> Table:
    """Normalised RMS, and fit and RMS of every channel of `units`, by method; the noise in the last row."""
    header = ["method", "normalised RMS", *(["on fitted logs"] if fitted else [])]
    header += [f"fit {channel} [%]" for channel in units]
    header += [f"RMS {channel}" + (f" [{unit}]" if unit else "") for channel, unit in units.items()]
    rows, count = [], 0
    notes = ["The noise is estimated from the held-out logs alone, so the floor of 1 is known to a few per cent."]
    for label, v in held_out.items():
        count = len(v.by_log)
        # A number that leaves logs out must not pass for one that does not.
        part = f" on {count - len(v.diverged)} of {count} logs" if v.diverged else ""
        cells = [Cell(title_of(label)), Cell(number(v.normalised_rms, 3) + part, "bad" if part else "")]
        cells += [Cell(number(fitted[label].normalised_rms, 3))] if fitted else []
        cells += [Cell("-" if math.isnan(v.fit_percent[c]) else f"{v.fit_percent[c]:.2f}") for c in units]
        cells += [Cell(number(v.rms[c], 3)) for c in units]
        rows.append(tuple(cells))
        if v.diverged:
            notes.append(
                f"{title_of(label)}: the simulation diverges on {', '.join(v.diverged)}; its numbers leave "
                f"{'that log' if len(v.diverged) == 1 else 'those logs'} out."
            )
    floor = Cell("noise floor", "dim"), Cell("1", "dim"), *([Cell("1", "dim")] if fitted else [])
    blank = tuple(Cell("") for _ in units)
    rows.append((*floor, *blank, *(Cell(number(noise[c], 3), "dim") for c in units)))
    title = f"Prediction of {count} held-out log{'s' if count > 1 else ''}"
    return Table(title, tuple(header), tuple(rows), tuple(notes))


def log_table(held_out: Mapping[str, Agreement]) -> Table:
    """Normalised RMS of every log by method."""
    names = next(iter(held_out.values())).by_log
    rows = []
    for name in names:
        own = [v.by_log[name] for v in held_out.values()]
        cells = [Cell("diverges", "bad") if f.diverged else Cell(number(f.normalised_rms, 3)) for f in own]
        rows.append((Cell(name), *cells))
    return Table("Normalised RMS of each held-out log", ("log", *map(title_of, held_out)), tuple(rows))


def ahead_table(ahead: Mapping[str, Mapping[int, Agreement]], held_out: Mapping[str, Agreement]) -> Table:
    """Normalised RMS by horizon of the models that predict from what was measured, and of their free simulations."""
    horizons = next(iter(ahead.values()))
    header = ("method", *(f"{k} sample{'s' * (k > 1)} ahead" for k in horizons), "free simulation")
    rows = [
        (
            Cell(title_of(label)),
            *(Cell(number(v.normalised_rms, 3)) for v in own.values()),
            Cell(number(held_out[label].normalised_rms, 3)),
        )
        for label, own in ahead.items()
    ]
    note = (
        "Predictions start from what was measured until then; their floor lies above 1 where the motion is disturbed."
    )
    return Table("Normalised RMS of predictions of the held-out logs", header, tuple(rows), (note,))


def chance(p: float) -> str:
    """A p value: "p 0.40", "p < 0.0001"."""
    return "" if math.isnan(p) else "p < 0.0001" if p < 1e-4 else f"p {p:.1g}" if p < 0.01 else f"p {p:.2f}"


def _test(test: ResidualTest, left: str, none: str) -> Cell:
    """A test's outcome in words: what is `left` where it was rejected."""
    if math.isnan(test.p_value):
        return Cell("not tested", "dim")
    return Cell(left, "bad", chance(test.p_value)) if test.rejected else Cell(none, "good", chance(test.p_value))


def test_table(held_out: Mapping[str, Agreement], words: Mapping[str, str] = MappingProxyType({})) -> Table:
    """What the residual tests say, by method and channel, in words; what was rejected at length below. `words`: of channels."""
    rows, notes, inputs = [], [], []
    for label, v in held_out.items():
        for channel, tests in v.tests.items():
            inputs = list(tests.cross_correlation)
            cells = [_test(tests.whiteness, "a pattern is left", "no pattern left")]
            cells += [_test(test, f"follows {name}", "no") for name, test in tests.cross_correlation.items()]
            cells.append(_test(tests.normality, "not Gaussian", "like noise"))
            rows.append((Cell(title_of(label)), Cell(channel, detail=words.get(channel, "")), *cells))
            if found := tests.summary:
                notes.append(f"{title_of(label)}: the residual of {channel} {found}.")
    header = ("method", "residual of", "over time", *(f"follows {name}?" for name in inputs), "its sizes")
    first = f"Every test alone finds something in pure noise in {100 * FALSE_ALARM:g} % of cases."
    notes += [_REJECTED] if notes else []
    return Table("Is the residual nothing but noise?", header, tuple(rows), (first, *notes))
