"""Cells and columns whose numbers are none, cannot be right, or belong to another column."""

from collections.abc import Callable

import numpy as np

from .breakage import Corpus
from .good import Good, csv_text

CELLS = Corpus()
COLUMNS = Corpus()
WIRING = Corpus()
UNITS = Corpus()

_RAD = np.pi / 180


def put(good: Good, name: str, rows: list[int], cell: str) -> str:
    """The log with some cells of one column replaced."""
    lines = [list(row) for row in good.rows]
    for k in rows:
        lines[k][good.header.index(name)] = cell
    return csv_text([good.header, *lines])


def with_column(good: Good, name: str, values: np.ndarray) -> str:
    """The log with other numbers in one column."""
    lines = [list(row) for row in good.rows]
    for line, value in zip(lines, values, strict=True):
        line[good.header.index(name)] = repr(float(value))
    return csv_text([good.header, *lines])


def _some(good: Good, rng: np.random.Generator) -> int:
    return int(rng.integers(60, len(good.rows) - 60))


def _pick(names: tuple[str, ...] | list[str], rng: np.random.Generator) -> str:
    return str(rng.choice(list(names)))


def _cell(cell: str, count: int = 1):
    def make(good: Good, rng: np.random.Generator) -> str:
        k = _some(good, rng)
        return put(good, _pick(good.header, rng), list(range(k, k + count)), cell)

    return make


_NO_NUMBERS = {
    "text": "fast",
    "hex": "0x1F",
    "truth value": "True",
    "complex": "1+2j",
    "date": "2024-05-01",
    "time of day": "12:30:01.5",
    "unit after the number": "0.3 m/s",
    "percent": "30%",
    "thousands": '"1,234.5"',
    "two points": "1.2.3",
    "minus of another kind": "−0.3",
    "spreadsheet error": "#DIV/0!",
    "formula": "=A1+B1",
    "digits of another script": "٣",
    "digit groups": "1_000",
    "Fortran exponent": "1.0D-1",
    "question mark": "?",
    "an unprintable character": "0.\x0731",
    "non-breaking space": "\xa00.3",
    "400 digits": "1" + "0" * 400,
    "markup": "<b>0.3</b>",
}
CELLS.add_each("cell that is no number", [(name, _cell(cell)) for name, cell in _NO_NUMBERS.items()])
CELLS.add_each(
    "cell missing or infinite", [(name, _cell(name)) for name in ("NaN", "Inf", "-inf", "NA", "null", "1e400")]
)
CELLS.add_each(
    "cell missing or infinite",
    [(f"{name} five times", _cell(cell, 5)) for name, cell in {"NaN": "nan", "Inf": "inf", "empty": ""}.items()],
)
CELLS.add_each("cell missing or infinite", [("empty", _cell(""))])
CELLS.add_each("cell of absurd size", [(cell, _cell(cell)) for cell in ("1e300", "-1e300", "1e30", "1e15", "-1e12")])
CELLS.add_each(
    "cell of absurd size",
    [("99999999999999999999", _cell("99999999999999999999")), ("1e300 thrice", _cell("1e300", 3))],
)


def _spike(good: Good, rng: np.random.Generator) -> str:
    name = _pick((*good.inputs, *good.outputs), rng)
    peak = np.abs(good.column(name)).max()
    return put(
        good, name, [_some(good, rng)], f"{float(rng.choice([-1, 1])) * peak * float(rng.choice([10, 1000])):.4f}"
    )


CELLS.add_each("cell of absurd size", [("10 or 1000 times the largest", _spike)])


def _column(values: Callable[[np.ndarray, np.random.Generator], np.ndarray], inputs: bool = True, outputs: bool = True):
    def make(good: Good, rng: np.random.Generator) -> str:
        name = _pick((good.inputs if inputs else ()) + (good.outputs if outputs else ()), rng)
        return with_column(good, name, values(good.column(name), rng))

    return make


def _frozen(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    k = int(rng.integers(60, len(values) - 160))
    return np.where((np.arange(len(values)) >= k) & (np.arange(len(values)) < k + 100), values[k] or 0.1, values)


def _all(good: Good, names: tuple[str, ...], values: Callable[[np.ndarray], np.ndarray]) -> str:
    lines = np.array([list(row) for row in good.rows], dtype=object)
    for name in names:
        lines[:, good.header.index(name)] = [repr(float(v)) for v in values(good.column(name))]
    return csv_text([good.header, *lines])


COLUMNS.add_each(
    "column",
    [
        ("NaN throughout", _column(lambda v, rng: v * np.nan)),
        ("infinite throughout", _column(lambda v, rng: v + np.inf)),
        ("constant input", _column(lambda v, rng: np.full_like(v, 3.0), outputs=False)),
        ("constant output", _column(lambda v, rng: np.full_like(v, 0.3), inputs=False)),
        ("output zero throughout", _column(lambda v, rng: 0 * v, inputs=False)),
        ("frozen for 100 samples", _column(_frozen, inputs=False)),
        ("output is noise", _column(lambda v, rng: rng.normal(0, 0.1, len(v)), inputs=False)),
        ("output of another time", _column(lambda v, rng: v[::-1], inputs=False)),
        ("times 1e300", _column(lambda v, rng: v * 1e300)),
        ("times 1e150", _column(lambda v, rng: v * 1e150)),
        ("times 1e-150", _column(lambda v, rng: v * 1e-150)),
        ("times 1e-300", _column(lambda v, rng: v * 1e-300)),
        ("times 1e-320", _column(lambda v, rng: v * 1e-320)),
        ("truth values", lambda good, rng: _truth(good, rng)),
        ("every measurement zero", lambda good, rng: _all(good, good.outputs, lambda v: 0 * v)),
        ("every measurement constant", lambda good, rng: _all(good, good.outputs, lambda v: 0 * v + 0.7)),
        ("every input zero", lambda good, rng: _all(good, good.inputs, lambda v: 0 * v)),
        ("all zero", lambda good, rng: _all(good, (*good.inputs, *good.outputs), lambda v: 0 * v)),
        ("all times 1e200", lambda good, rng: _all(good, (*good.inputs, *good.outputs), lambda v: 1e200 * v)),
        ("all times 1e-200", lambda good, rng: _all(good, (*good.inputs, *good.outputs), lambda v: 1e-200 * v)),
        ("pose is text", lambda good, rng: _pose(good, "home")),
        ("pose is infinite", lambda good, rng: _pose(good, "inf")),
        ("pose of absurd size", lambda good, rng: _pose(good, "1e300")),
    ],
)


def _truth(good: Good, rng: np.random.Generator) -> str:
    name = _pick((*good.inputs, *good.outputs), rng)
    lines = [list(row) for row in good.rows]
    for line in lines:
        line[good.header.index(name)] = str(float(line[good.header.index(name)]) > 0)
    return csv_text([good.header, *lines])


def _pose(good: Good, cell: str) -> str:
    return csv_text([[*good.header, "theta"], *([*row, cell] for row in good.rows)])


def _swapped(good: Good, a: str, b: str) -> str:
    return csv_text([[{a: b, b: a}.get(name, name) for name in good.header], *good.rows])


def _signs(good: Good, names: tuple[str, ...]) -> str:
    return _all(good, names, lambda v: -v)


def _driven(good: Good) -> list[str]:
    return [name for name in good.inputs if np.ptp(good.column(name)) > 0]


def _wheels(good: Good, rng: np.random.Generator) -> str | None:
    """Two inputs exchanged, where they differ for at least a third of the log."""
    if len(good.inputs) < 2:
        return None
    a, b = (str(name) for name in rng.choice(list(good.inputs), 2, replace=False))
    return _swapped(good, a, b) if np.mean(good.column(a) != good.column(b)) > 0.3 else None


def _outputs(good: Good, rng: np.random.Generator) -> str | None:
    names = [name for name in good.outputs if name in good.channels.outputs]
    if len(names) < 2:
        return None
    a, b = (str(name) for name in rng.choice(names, 2, replace=False))
    return _swapped(good, a, b)


def _motion(good: Good, rng: np.random.Generator) -> str:
    return _pick([name for name in good.outputs if name in good.channels.mixing], rng)


def _flipped_output(good: Good, rng: np.random.Generator) -> str:
    return _signs(good, (_motion(good, rng),))


WIRING.add_each(
    "wiring",
    [
        ("wheels swapped", _wheels),
        ("outputs swapped", _outputs),
        (
            "an input and an output swapped",
            lambda good, rng: _swapped(good, _pick(good.inputs, rng), _motion(good, rng)),
        ),
        ("time and an output swapped", lambda good, rng: _swapped(good, "t", _pick(good.outputs, rng))),
        ("an input's sign flipped", lambda good, rng: _signs(good, (_pick(_driven(good), rng),))),
        ("all inputs' signs flipped", lambda good, rng: _signs(good, good.inputs)),
        ("an output's sign flipped", _flipped_output),
    ],
)


def _units(column_unit: str, factor: float):
    """One column of that SI unit in another one."""

    def make(good: Good, rng: np.random.Generator) -> str | None:
        # An axis may slide or turn.
        units = {column_unit, f"{column_unit} or rad/s", f"{column_unit} or rad"}
        names = [name for name in (*good.inputs, *good.outputs) if good.channels.units.get(name) in units]
        if not names:
            return None
        name = _pick(names, rng)
        return with_column(good, name, good.column(name) * factor)

    return make


UNITS.add_each(
    "units",
    [
        ("speed in mm/s", _units("m/s", 1e3)),
        ("speed in cm/s", _units("m/s", 1e2)),
        ("speed in encoder ticks", _units("m/s", 40960.0)),
        ("yaw rate in degrees", _units("rad/s", 1 / _RAD)),
        ("yaw rate in mrad/s", _units("rad/s", 1e3)),
        ("voltage in mV", _units("V", 1e3)),
        ("voltage as PWM counts", _units("V", 32767 / 12)),
        ("force in mN", _units("V or N", 1e3)),
        ("current in mA", _units("A", 1e3)),
        ("position in mm", _units("m", 1e3)),
        ("position in km", _units("m", 1e-3)),
        ("speed in km/s", _units("m/s", 1e-3)),
    ],
)
