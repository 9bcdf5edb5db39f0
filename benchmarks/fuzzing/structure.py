"""Rows and columns that are missing, doubled, out of order or of another kind, and clocks that cannot be right."""

import json

import numpy as np

from .breakage import Corpus
from .good import Good, csv_text

STRUCTURE = Corpus()
CLOCK = Corpus()
_OTHER = {"pioneer": "t,u1,u2,u3,u4,V,Vn,W", "omni": "t,V2,V3,eta1,eta2", "axis": "t,V2,V3,eta1,eta2"}


def _row(good: Good, rng: np.random.Generator, edge: int = 60) -> int:
    return int(rng.integers(edge, len(good.rows) - edge))


def _without(good: Good, names: tuple[str, ...]) -> str:
    kept = [k for k, name in enumerate(good.header) if name not in names]
    return csv_text([row[k] for k in kept] for row in (good.header, *good.rows))


def _renamed(good: Good, old: str, new: str) -> str:
    return csv_text([[new if name == old else name for name in good.header], *good.rows])


def needed(good: Good) -> list[str]:
    """Columns that this robot's log cannot do without."""
    return [name for name in ("t", *good.inputs, *good.outputs) if name not in good.channels.optional and name != "v"]


def _one(good: Good, rng: np.random.Generator) -> str:
    return str(rng.choice(needed(good)))


def _broken_row(good: Good, rng: np.random.Generator, change: int) -> str:
    lines = good.text.splitlines()
    k = _row(good, rng)
    cells = lines[k].split(",")
    lines[k] = ",".join(cells[:change] if change < 0 else [*cells, *["9"] * change])
    return "\n".join(lines)


def _cut_in_last_row(good: Good, rng: np.random.Generator) -> str:
    text = csv_text([good.header, *good.rows[: _row(good, rng)]]).rstrip()
    last = text.rindex("\n") + 1
    return text[: int(rng.integers(last + 1, text.rindex(",") + 1))]


def _unmatched_quotes(good: Good, rng: np.random.Generator) -> str:
    """Two cells of a remark's column open a quote and none closes it: a whole stretch becomes one cell."""
    rows = [[*row, "ok"] for row in good.rows]
    for k in sorted(int(k) for k in rng.integers(60, len(rows) - 60, 2)):
        rows[k][-1] = '"slipped'
    return csv_text([[*good.header, "remark"], *rows])


STRUCTURE.add_each(
    "structure",
    [
        ("empty", lambda good, rng: ""),
        ("white space only", lambda good, rng: " \n\t\n" * int(rng.integers(1, 20))),
        ("comments only", lambda good, rng: "# nothing\n" * 5),
        ("header only", lambda good, rng: csv_text([good.header])),
        ("one row", lambda good, rng: csv_text([good.header, good.rows[0]])),
        ("two rows", lambda good, rng: csv_text([good.header, *good.rows[:2]])),
        ("ten rows", lambda good, rng: csv_text([good.header, *good.rows[:10]])),
        ("forty rows", lambda good, rng: csv_text([good.header, *good.rows[:40]])),
        ("no header", lambda good, rng: csv_text(good.rows)),
        ("last row cut", _cut_in_last_row),
        ("a row short of fields", lambda good, rng: _broken_row(good, rng, -1)),
        ("a row with more fields", lambda good, rng: _broken_row(good, rng, 2)),
        ("header short of a field", lambda good, rng: csv_text([good.header[:-1], *good.rows])),
        ("units in a second line", lambda good, rng: csv_text([good.header, ["V"] * len(good.header), *good.rows])),
        (
            "header again halfway",
            lambda good, rng: csv_text([good.header, *good.rows[:300], good.header, *good.rows[300:]]),
        ),
        ("quotes never closed", _unmatched_quotes),
        ("a column missing", lambda good, rng: _without(good, (_one(good, rng),))),
        ("all measurements missing", lambda good, rng: _without(good, good.outputs)),
        ("a column twice", lambda good, rng: _renamed(good, good.inputs[-1], good.outputs[0])),
        ("a column in capitals", lambda good, rng: _renamed(good, name := _one(good, rng), name.swapcase())),
        ("a column misspelt", lambda good, rng: _renamed(good, name := _one(good, rng), name + "_")),
        ("a measured column misspelt", lambda good, rng: _renamed(good, good.outputs[-1], good.outputs[-1] + "?")),
        ("an optional column in capitals and braces", lambda good, rng: _optional(good, rng)),
        ("another robot's log", lambda good, rng: "\n".join([_OTHER[good.robot], *["0,0,0,0,0,0,0,0"] * 99])),
        ("JSON", lambda good, rng: json.dumps({name: list(good.column(name)) for name in good.header})),
        (
            "JSON lines",
            lambda good, rng: "\n".join(json.dumps(dict(zip(good.header, r, strict=True))) for r in good.rows),
        ),
        ("HTML", lambda good, rng: f"<!doctype html><table><tr><td>{good.text}</td></tr></table>"),
        ("prose", lambda good, rng: "Dear reader,\nthis is no log.\n" * int(rng.integers(1, 50))),
        ("one endless line", lambda good, rng: good.text.replace("\n", ",")),
        ("thousands of columns", lambda good, rng: (",".join(f"c{k}" for k in range(5000)) + "\n") * 3),
    ],
)


def _optional(good: Good, rng: np.random.Generator) -> str | None:
    there = [name for name in good.outputs if name in good.channels.optional]
    return _renamed(good, name := str(rng.choice(there)), f"{{{name.swapcase()}}}") if there else None


def with_time(good: Good, time: np.ndarray, rows: np.ndarray | None = None) -> str:
    """The log under other times (and with only some rows)."""
    rows = np.arange(len(good.rows)) if rows is None else rows
    at = good.header.index("t")
    lines = [list(good.rows[k]) for k in rows]
    for line, t in zip(lines, time, strict=True):
        line[at] = repr(float(t))
    return csv_text([good.header, *lines])


def _rows(good: Good, rows: np.ndarray) -> str:
    return csv_text([good.header, *(good.rows[k] for k in rows)])


def _gap(good: Good, rng: np.random.Generator, rows: int) -> str:
    k = _row(good, rng, edge=rows + 1)
    return _rows(good, np.delete(np.arange(len(good.rows)), np.arange(k, k + rows)))


def _swapped_rows(good: Good, rng: np.random.Generator) -> str:
    order, k = np.arange(len(good.rows)), _row(good, rng)
    order[[k, k + 1]] = k + 1, k
    return _rows(good, order)


def _stalled(good: Good, rng: np.random.Generator) -> str:
    time, k = good.column("t"), _row(good, rng)
    time[k : k + int(rng.integers(2, 30))] = time[k]
    return with_time(good, time)


def _lost(good: Good, rng: np.random.Generator) -> str:
    return _rows(good, np.flatnonzero(np.r_[True, rng.random(len(good.rows) - 2) > 0.2, True]))


def _jittery(good: Good, rng: np.random.Generator) -> str:
    time = good.column("t")
    step = time[1] - time[0]
    return with_time(good, time + rng.uniform(-0.4, 0.4, len(time)) * step)


def _jump(good: Good, rng: np.random.Generator) -> str:
    time, k = good.column("t"), _row(good, rng)
    return with_time(good, time + np.where(np.arange(len(time)) >= k, float(rng.choice([3600.0, 0.1, 1e6])), 0.0))


def _scaled(good: Good, factor: float) -> str:
    return with_time(good, good.column("t") * factor)


CLOCK.add_each(
    "clock",
    [
        ("a time twice", lambda good, rng: _stalled_once(good, rng)),
        ("stalled", _stalled),
        ("constant", lambda good, rng: with_time(good, np.full(len(good.rows), 1.0))),
        ("reversed rows", lambda good, rng: _rows(good, np.arange(len(good.rows))[::-1])),
        ("reversed times", lambda good, rng: with_time(good, good.column("t")[::-1])),
        ("negative", lambda good, rng: with_time(good, -good.column("t"))),
        ("unsorted", lambda good, rng: _rows(good, rng.permutation(len(good.rows)))),
        ("two rows swapped", _swapped_rows),
        (
            "restarted halfway",
            lambda good, rng: with_time(good, good.column("t") % good.column("t")[len(good.rows) // 2]),
        ),
        ("every row twice", lambda good, rng: _rows(good, np.arange(len(good.rows)).repeat(2))),
        ("a row lost", lambda good, rng: _gap(good, rng, 1)),
        ("three rows lost", lambda good, rng: _gap(good, rng, 3)),
        ("a second lost", lambda good, rng: _gap(good, rng, 50)),
        ("a fifth of the rows lost", _lost),
        ("jittery", _jittery),
        ("jumps ahead", _jump),
        ("in milliseconds", lambda good, rng: _scaled(good, 1e3)),
        ("in microseconds", lambda good, rng: _scaled(good, 1e6)),
        ("in nanoseconds", lambda good, rng: _scaled(good, 1e9)),
        ("in minutes", lambda good, rng: _scaled(good, 1 / 60)),
        ("in hours", lambda good, rng: _scaled(good, 1 / 3600)),
        ("in days", lambda good, rng: _scaled(good, 1 / 86400)),
        ("huge", lambda good, rng: _scaled(good, 1e300)),
        ("tiny", lambda good, rng: _scaled(good, 1e-300)),
        ("row numbers", lambda good, rng: with_time(good, np.arange(len(good.rows)))),
        ("in seconds since 1970, single precision", lambda good, rng: with_time(good, _single(good))),
    ],
)


def _stalled_once(good: Good, rng: np.random.Generator) -> str:
    time, k = good.column("t"), _row(good, rng)
    time[k] = time[k - 1]
    return with_time(good, time)


def _single(good: Good) -> np.ndarray:
    return (1.7e9 + good.column("t")).astype(np.float32).astype(float)
