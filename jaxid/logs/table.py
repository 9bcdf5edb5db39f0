"""From a file's bytes to a table of columns, whatever wrote it: CSV in its dialects, gzip of it, or Parquet."""

import csv
import gzip
import io
import re
import zlib
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from .finding import LogError

_ENCODINGS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")
_COMMENT = ("#", "%", "//")


class Table(NamedTuple):
    """Columns as read; `lines[k]` is the line of the file (from 1) that row k stood on (empty for Parquet); `notes`
    are `(check, row, message)` of whatever had to be decided while reading.
    """

    frame: pd.DataFrame
    lines: list[int]
    notes: list[tuple[str, int | None, str]]


def _cause(error: Exception) -> str:
    """A library's message on one line, without what it quotes of a damaged file."""
    text = "".join(character if character.isprintable() else " " for character in str(error))
    return " ".join(text.split())[:120]


def _text(data: bytes, path: Path) -> str:
    if data[:2] == b"\x1f\x8b":
        try:
            data = gzip.decompress(data)
        except (OSError, EOFError, zlib.error) as error:
            raise LogError(f"{path}: the gzip stream is damaged ({error}); copy or compress the file again.") from None
    encoding = next((name for mark, name in _ENCODINGS if data.startswith(mark)), None)
    if encoding is None and b"\x00" in data:
        raise LogError(f"{path} is not a text file (byte {data.index(0)} is zero); export the log as CSV or Parquet.")
    for candidate in (encoding or "utf-8", "cp1252"):
        try:
            text = data.decode(candidate)
        except UnicodeDecodeError:
            continue
        if "\x00" in text:
            break  # after a byte-order mark, where the bytes alone did not show it
        if sum(not (character.isprintable() or character in "\t\r\n") for character in text[:4096]) > 4:
            break
        return text
    raise LogError(f"{path} is not a text file; export the log as CSV or Parquet.")


def _number(cell: str) -> bool:
    try:
        float(cell.strip().strip('"'))
    except ValueError:
        return bool(_DECIMAL_COMMA.fullmatch(cell.strip()))
    return True


def _delimiter(header: str) -> str | None:
    """The header decides: names hold no delimiters, cells may hold decimal commas. `None` means white space."""
    for delimiter in (";", "\t", "|", ","):
        if delimiter in header:
            return delimiter
    return None


def _split(lines: list[str], delimiter: str | None) -> list[list[str]]:
    if delimiter is None:
        return [line.split() for line in lines]
    return list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True))


def _field_counts(lines: list[str], delimiter: str | None) -> list[int]:
    # Splitting every line with the csv module would dominate the reading of long logs; only quoted lines need it.
    if delimiter is None:
        return [len(line.split()) for line in lines]
    return [len(_split([line], delimiter)[0]) if '"' in line else line.count(delimiter) + 1 for line in lines]


def _header(lines: list[str], numbers: list[int], comment: str, path: Path) -> tuple[list[str], str | None, bool]:
    """Column names, delimiter, and whether the first line was the header (else a comment line was)."""
    delimiter = _delimiter(lines[0])
    cells = _split(lines[:1], delimiter)[0]
    if all(_number(cell) for cell in cells if cell.strip()):
        delimiter = _delimiter(comment)
        names = _split([comment], delimiter)[0]
        if len(names) < 2 or _field_counts(lines[:1], delimiter)[0] != len(names):
            raise LogError(
                f"{path}: line {numbers[0]} holds numbers where the header should be; put a first line with the column "
                "names, such as t,V2,V3,eta1,eta2."
            )
        return [name.strip() for name in names], delimiter, False
    return [name.strip() for name in cells], delimiter, True


def _units_row(rows: list[str], delimiter: str | None) -> str:
    """The cells of a first row in which nothing is a number, above one in which something is; empty where it is no such row."""
    if len(rows) < 3:
        return ""
    first, second = ([cell.strip() for cell in line if cell.strip()] for line in _split(rows[:2], delimiter))
    return "" if any(map(_number, first)) or not any(map(_number, second)) else ", ".join(first)[:60]


def _decimal_comma(rows: list[str], delimiter: str | None) -> bool:
    """Whether numbers have a comma before their decimals. Between commas such numbers stand in quotes, where they may be
    thousands, too, if all of them have three digits after it."""
    cells = [cell.strip() for line in _split(rows[:200], delimiter) for cell in line]
    found = [cell for cell in cells if _DECIMAL_COMMA.fullmatch(cell)]
    thousands = delimiter == "," and all(len(re.split("[,eE]", cell)[1]) == 3 for cell in found)
    return bool(found) and not thousands and not any("." in cell for cell in cells)


def _csv(data: bytes, path: Path) -> Table:
    text = _text(data, path)
    kept, numbers, comment = [], [], ""
    for number, line in enumerate(text.splitlines(), start=1):
        stripped = line.strip()
        if stripped.startswith(_COMMENT):
            # Some programs (numpy.savetxt) write the header as a comment; remember the last one before the data.
            comment = comment if kept else stripped.lstrip("#%/ \t")
        elif stripped.strip(",;|\t "):
            kept.append(line)
            numbers.append(number)
    if not kept:
        raise LogError(f"{path} is empty; give a log with a header line and samples.")
    names, delimiter, own_line = _header(kept, numbers, comment, path)
    rows, lines = (kept[1:], numbers[1:]) if own_line else (kept, numbers)

    twice = next((name for name, count in Counter(names).items() if name and count > 1), None)
    if twice is not None:
        raise LogError(f"{path}: the header names column {twice!r} twice; rename one of them.")
    names = [name or f"(unnamed column {position})" for position, name in enumerate(names, start=1)]
    if not rows:
        raise LogError(f"{path} has a header and no samples; give a log of an experiment.")

    notes: list[tuple[str, int | None, str]] = []
    counts = np.array(_field_counts(rows, delimiter))
    wrong = np.flatnonzero(counts != len(names))
    if len(wrong) and wrong[0] == len(rows) - 1 and counts[-1] < len(names) and len(rows) > 1:
        notes.append(
            (
                "truncated_row",
                len(rows) - 2,
                f"line {lines[-1]}, the last, breaks off after {counts[-1]} of {len(names)} fields and was left out; "
                "check that the recording ended where you think",
            )
        )
        rows, lines = rows[:-1], lines[:-1]
    elif len(wrong):
        k = wrong[0]
        raise LogError(
            f"{path}: line {lines[k]} (sample {k}) has {counts[k]} fields where the header has {len(names)} "
            f"({len(wrong)} such line(s)); repair or remove it."
        )

    if units := _units_row(rows, delimiter):
        raise LogError(
            f"{path}: line {lines[0]} holds no number ({units}); if that line holds units, delete it or start it with #, and "
            "map what is not in SI units with a scale."
        )
    comma = _decimal_comma(rows, delimiter)
    try:
        frame = pd.read_csv(
            io.StringIO("\n".join(rows)),
            sep=r"\s+" if delimiter is None else delimiter,
            header=None,
            names=names,
            index_col=False,
            decimal="," if comma else ".",
            skipinitialspace=True,
            low_memory=False,
        )
    except (ValueError, OverflowError) as error:  # pandas' ParserError is a ValueError
        cause = _cause(error)
        raise LogError(f"{path} cannot be read as CSV ({cause}); export it again with a plain header.") from None
    if len(frame) != len(rows):
        odd = next((line for row, line in zip(rows, lines, strict=True) if row.count('"') % 2), lines[0])
        raise LogError(f"{path}: line {odd} opens a quote that it does not close; take the quote out or close it.")
    empty = [name for name in names if name.startswith("(unnamed") and bool(np.all(frame[name].isna()))]
    return Table(frame.drop(columns=empty), lines, notes)


def _parquet(data: bytes, path: Path) -> Table:
    try:
        table = pq.read_table(io.BytesIO(data), page_checksum_verification=True)
        frame = table.to_pandas().reset_index(drop=False)
    except (pa.ArrowException, OSError, ValueError, TypeError) as error:
        cause = _cause(error)
        raise LogError(f"{path} cannot be read as Parquet ({cause}); write the file again.") from None
    frame = frame.drop(columns=[name for name in ("index",) if name not in table.column_names and name in frame])
    names = [str(name) for name in frame.columns]
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise LogError(f"{path} has column {twice!r} twice; rename one of them.")
    frame = frame.set_axis(names, axis="columns")
    if not len(frame):
        raise LogError(f"{path} has no samples; give a log of an experiment.")
    return Table(frame, [], [])


def read_table(path: Path) -> Table:
    """The columns of one file. CSV may be separated by comma, semicolon, tab, bar or white space, use decimal commas
    (between commas in quotes), start with a byte-order mark, hold comment lines (#, %, //), or be gzipped; Parquet is
    told by its first bytes. Raises `LogError` for anything that is not a table with a header and rows.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise LogError(f"{path} cannot be opened ({error.strerror}); check the path and its permissions.") from None
    if not data.strip():
        raise LogError(f"{path} is empty; give a log with a header line and samples.")
    if data[:4] == b"PAR1":
        return _parquet(data, path)
    if path.suffix.lower() in (".parquet", ".pq"):
        raise LogError(f"{path} is not a Parquet file although its name says so; write the file again.")
    return _csv(data, path)
