"""Files that say what the good log says in another dialect: they must read as the same numbers."""

import bz2
import gzip
import io
import lzma
import zipfile

import numpy as np
import pandas as pd

from .breakage import Corpus
from .good import Good, csv_text

DIALECTS = Corpus()
DAMAGED = Corpus()
"""Bytes that are no text, or text in an encoding that cannot be told: they must be refused."""


def frame(good: Good) -> pd.DataFrame:
    """The log as a table of numbers."""
    return pd.DataFrame(good.values, columns=list(good.header))


def parquet(table: pd.DataFrame, **options: object) -> bytes:
    """A table as the bytes of a Parquet file."""
    stream = io.BytesIO()
    table.to_parquet(stream, **options)  # type: ignore[call-overload]
    return stream.getvalue()


def with_columns(good: Good, columns: dict[str, str]) -> str:
    """The log with further columns whose every cell is the same."""
    header = [*good.header, *columns]
    return csv_text([header, *([*row, *columns.values()] for row in good.rows)])


def _shuffled(good: Good, rng: np.random.Generator) -> str:
    order = rng.permutation(len(good.header))
    return csv_text([row[k] for k in order] for row in (good.header, *good.rows))


def _comments(good: Good, rng: np.random.Generator) -> str:
    lines = good.text.splitlines()
    for mark in ("# the battery was changed", "% 3,4,5", "// note"):
        lines.insert(int(rng.integers(len(lines) + 1)), mark)
    return "\n".join(lines)


def _mixed_ends(good: Good, rng: np.random.Generator) -> str:
    return "".join(line + str(rng.choice(["\n", "\r\n", "\n\n"])) for line in good.text.splitlines())


def _spaced(good: Good, rng: np.random.Generator) -> str:
    return "\n".join(line.replace(",", " , ") + " " for line in good.text.splitlines())


DIALECTS.add_each(
    "dialect",
    [
        ("unchanged", lambda good, rng: good.text),
        ("semicolons", lambda good, rng: good.text.replace(",", ";")),
        ("tabs", lambda good, rng: good.text.replace(",", "\t")),
        ("bars", lambda good, rng: good.text.replace(",", "|")),
        ("spaces", lambda good, rng: good.text.replace(",", " ")),
        ("aligned with spaces", lambda good, rng: good.text.replace(",", "    ")),
        ("decimal commas, semicolons", lambda good, rng: good.text.replace(",", ";").replace(".", ",")),
        ("decimal commas, tabs", lambda good, rng: good.text.replace(",", "\t").replace(".", ",")),
        ("decimal commas, bars", lambda good, rng: good.text.replace(",", "|").replace(".", ",")),
        ("decimal commas, spaces", lambda good, rng: good.text.replace(",", " ").replace(".", ",")),
        ("quoted numbers", lambda good, rng: _quoted(good, ".")),
        ("space around delimiters", _spaced),
        ("CRLF", lambda good, rng: good.text.replace("\n", "\r\n")),
        ("CR", lambda good, rng: good.text.replace("\n", "\r")),
        ("mixed line endings", _mixed_ends),
        ("leading blank lines", lambda good, rng: "\n \n\t\n" + good.text),
        ("trailing blank lines", lambda good, rng: good.text + "\n\n  \n"),
        ("no newline at the end", lambda good, rng: good.text.rstrip()),
        ("delimiter at each line's end", lambda good, rng: good.text.replace("\n", ",\n")),
        ("comments", _comments),
        ("header as a comment", lambda good, rng: "# " + good.text),
        ("columns in another order", _shuffled),
        ("extra columns", lambda good, rng: with_columns(good, {"battery": "12.1", "note": "ok", "empty": ""})),
        ("non-ASCII extra headers", lambda good, rng: with_columns(good, {"温度 °C": "20", "Größe": "1"})),
        ("braces in extra headers", lambda good, rng: with_columns(good, {"{0}": "1", "{t}": "2", "%s": "3", "{": ""})),
        ("Latin-1", lambda good, rng: with_columns(good, {"temp °C": "20"}).encode("latin-1")),
        ("exponents", lambda good, rng: csv_text([good.header, *([f"{float(c):.9e}" for c in r] for r in good.rows)])),
        (
            "plus signs",
            lambda good, rng: csv_text([good.header, *([f"{float(c):+.6f}" for c in r] for r in good.rows)]),
        ),
        ("BOM", lambda good, rng: b"\xef\xbb\xbf" + good.text.encode()),
        ("UTF-16", lambda good, rng: good.text.encode("utf-16")),
        ("UTF-16, big endian", lambda good, rng: b"\xfe\xff" + good.text.encode("utf-16-be")),
        ("gzip named csv", lambda good, rng: gzip.compress(good.text.encode(), mtime=0)),
        ("Parquet named csv", lambda good, rng: parquet(frame(good))),
    ],
    harmless=True,
)
DIALECTS.add_each(
    "dialect",
    [
        ("Parquet", lambda good, rng: parquet(frame(good))),
        ("Parquet with t as index", lambda good, rng: parquet(frame(good).set_index("t"))),
        (
            "Parquet of decimal texts",
            lambda good, rng: parquet(pd.DataFrame(list(good.rows), columns=list(good.header))),
        ),
        ("Parquet of nullable numbers", lambda good, rng: parquet(frame(good).convert_dtypes())),
    ],
    harmless=True,
    file="run.parquet",
)


def _quoted(good: Good, point: str) -> str:
    rows = ([f'"{cell.replace(".", point)}"' for cell in row] for row in good.rows)
    return csv_text([good.header, *rows])


def _junk(good: Good, rng: np.random.Generator) -> bytes:
    return rng.integers(0, 256, int(rng.integers(1, 5000)), dtype=np.uint8).tobytes()


def _text_then_junk(good: Good, rng: np.random.Generator) -> bytes:
    return good.text.encode()[: int(rng.integers(100, 5000))] + b"\x00\xff" + _junk(good, rng)


def _nul_in_cell(good: Good, rng: np.random.Generator) -> bytes:
    data = good.text.encode()
    at = int(rng.integers(len(good.text) // 2, len(good.text)))
    return data[:at] + b"\x00" + data[at:]


def _flipped(data: bytes, rng: np.random.Generator, first: int = 0) -> bytes:
    broken = bytearray(data)
    broken[int(rng.integers(first, len(data)))] ^= 1 << int(rng.integers(8))
    return bytes(broken)


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: int(rng.integers(4, len(data) - 1))]


def _zip(good: Good, rng: np.random.Generator) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("run.csv", good.text)
    return stream.getvalue()


def _gzip(good: Good) -> bytes:
    return gzip.compress(good.text.encode(), mtime=0)


DAMAGED.add_each(
    "bytes",
    [
        ("binary junk", _junk),
        ("text, then junk", _text_then_junk),
        ("NUL in a cell", _nul_in_cell),
        ("NUL in a cell after a BOM", lambda good, rng: b"\xef\xbb\xbf" + _nul_in_cell(good, rng)),
        ("zeros", lambda good, rng: bytes(int(rng.integers(1, 5000)))),
        ("UTF-16 without BOM", lambda good, rng: good.text.encode("utf-16-le")),
        ("UTF-16, one byte short", lambda good, rng: good.text.encode("utf-16")[:-1]),
        ("UTF-32", lambda good, rng: good.text.encode("utf-32")),
        ("gzip, cut", lambda good, rng: _cut(_gzip(good), rng)),
        ("gzip, a bit flipped", lambda good, rng: _flipped(_gzip(good), rng, first=10)),
        ("gzip and junk after it", lambda good, rng: _gzip(good) + b"junk"),
        ("gzip of gzip", lambda good, rng: gzip.compress(_gzip(good), mtime=0)),
        ("zip", _zip),
        ("bzip2", lambda good, rng: bz2.compress(good.text.encode())),
        ("xz", lambda good, rng: lzma.compress(good.text.encode())),
        ("PNG", lambda good, rng: b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" + _junk(good, rng)),
        ("pickle", lambda good, rng: frame(good).__reduce__().__repr__().encode() + b"\x80\x04\x95."),
        ("decimal commas in quotes", lambda good, rng: _quoted(good, ",")),
        ("UTF-7 junk", lambda good, rng: b"+AD0-" * 50),
        ("control characters", lambda good, rng: good.text.replace("0", "\x02").encode()),
    ],
)
DAMAGED.add_each(
    "Parquet",
    [
        ("CSV named Parquet", lambda good, rng: good.text),
        ("gzip named Parquet", lambda good, rng: _gzip(good)),
        ("cut", lambda good, rng: _cut(parquet(frame(good)), rng)),
        ("first bytes only", lambda good, rng: b"PAR1"),
        ("junk between the marks", lambda good, rng: b"PAR1" + _junk(good, rng) + b"PAR1"),
        ("footer's length wrong", lambda good, rng: parquet(frame(good))[:-8] + b"\xff\xff\xff\x7fPAR1"),
        ("empty table", lambda good, rng: parquet(frame(good)[:0])),
        ("lists in cells", lambda good, rng: parquet(frame(good).assign(t=[[0.0, 1.0]] * len(good.rows)))),
        ("records in cells", lambda good, rng: parquet(frame(good).assign(t=[{"s": 1}] * len(good.rows)))),
        ("stamps as time", lambda good, rng: parquet(_stamped(good))),
        ("dates as time", lambda good, rng: parquet(_stamped(good).assign(t=lambda f: f.t.dt.date))),
        ("text as numbers", lambda good, rng: parquet(frame(good).assign(**{good.outputs[0]: "fast"}))),
        ("truth values as inputs", lambda good, rng: parquet(frame(good).assign(**{good.inputs[0]: True}))),
    ],
    file="run.parquet",
)


def _stamped(good: Good) -> pd.DataFrame:
    return frame(good).assign(t=lambda f: pd.Timestamp("2024-05-01") + pd.to_timedelta(f.t, unit="s"))
