"""Random changes of bytes, cells and TOML text, as hypothesis strategies, and how they are drawn reproducibly."""

from collections.abc import Sequence
from typing import TypeVar

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from .good import Good, csv_text

T = TypeVar("T")
Edit = tuple[str, int, bytes]
Cell = tuple[int, int, str]

_JUNK = st.sampled_from([b'"', b"\n", b",", b";", b"\x00", b"#", b"-", b".", b"e9", b"nan", b"\r", b"\xff", b"9", b"0"])


def edits(size: int) -> st.SearchStrategy[list[Edit]]:
    """A few places of a file of `size` bytes that are overwritten, cut out, doubled, moved or grow junk."""
    place = st.integers(0, size - 1)
    junk = st.one_of(_JUNK, st.binary(min_size=1, max_size=8))
    kinds = st.sampled_from(["overwrite", "insert", "delete", "double", "cut"])
    # A cut loses the rest of the file; among the others it should be rare.
    kinds = st.one_of(kinds, st.sampled_from(["overwrite", "insert", "delete", "double"]))
    return st.lists(st.tuples(kinds, place, junk), min_size=1, max_size=5)


def edited(data: bytes, changes: Sequence[Edit]) -> bytes:
    """The file with the changes made, one after the other."""
    for kind, place, junk in changes:
        place = min(place, len(data))
        span = len(junk) ** 2
        head, tail = data[:place], data[place:]
        match kind:
            case "overwrite":
                data = head + junk + tail[len(junk) :]
            case "insert":
                data = head + junk + tail
            case "delete":
                data = head + tail[span:]
            case "double":
                data = head + tail[:span] + tail
            case _:
                data = head
    return data


_CELLS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True).map(repr),
    st.integers().map(str),
    st.sampled_from(["", "NaN", "inf", "-inf", "1e999", "0x10", "True", "None", "1,5", "--", "1e", "2024-01-01", "0"]),
    st.text(st.characters(codec="utf-8", exclude_characters=",\n\r"), max_size=6),
)


def cells(rows: int, columns: int) -> st.SearchStrategy[list[Cell]]:
    """A few cells (row 0 is the header) and what they shall hold."""
    return st.lists(st.tuples(st.integers(0, rows), st.integers(0, columns - 1), _CELLS), min_size=1, max_size=6)


def with_cells(good: Good, changes: Sequence[Cell]) -> bytes:
    """The log with other cells."""
    lines = [list(good.header), *(list(row) for row in good.rows)]
    for row, column, cell in changes:
        lines[row][column] = cell
    return csv_text(lines).encode("utf-8", errors="replace")


def drawn(strategy: st.SearchStrategy[T], count: int, number: int) -> list[T]:
    """`count` examples, always the same for one `number` (and version of hypothesis)."""
    found: list[T] = []

    @seed(number)
    @settings(
        max_examples=count,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def collect(example: T) -> None:
        found.append(example)

    collect()
    return found[:count]
