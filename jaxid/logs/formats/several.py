"""One run in several tables, as `odometry.csv+imu.csv`: each with its own rows, all by one clock."""

from pathlib import Path

from ..finding import LogError
from ..series import Recording, Series, Topic
from .columns import read_columns

_DATES = "dates"
_TABLES = (".csv", ".tsv", ".txt", ".gz", ".parquet", ".pq")


def tables_of(path: Path) -> list[Path]:
    """The tables that a path with `+` means; none where it is a file's or a folder's own name, or has none. The later ones may
    leave out the folder."""
    text = str(path)
    if "+" not in text or path.exists():
        return []
    first, *others = (Path(part) for part in text.split("+"))
    if any(part.suffix.lower() not in _TABLES for part in (first, *others)):
        return []  # a folder's name has it
    return [first, *(other if other.exists() else first.parent / other for other in others)]


def read_several(path: Path, time_field: str | None = None) -> Recording:
    """The columns of the tables that `path` means, each with its table's times, from the first of all on. A column that
    several tables have is `TABLE.COLUMN`, by the table's name without its ending.

    Raises `LogError` where one cannot be read, and where the times of two have nothing in common.
    """
    tables = tables_of(path)
    series: dict[str, Series] = {}
    topics: dict[str, Topic] = {}
    notes: list[tuple[str, str]] = []
    found = [read_columns(table, time_field) for table in tables]
    dated = [recording.time is not None and recording.time.said == _DATES for recording in found]
    if any(dated):
        where = tables[dated.index(True)]
        raise LogError(f"{where} has dates for times; of a run in several tables give seconds, by one clock.")
    start = found[0].origin
    every = [name for recording in found for name in recording.series]
    for table, recording in zip(tables, found, strict=True):
        shift = round(1e9 * (recording.origin - start))
        for name, one in recording.series.items():
            own = f"{table.stem}.{name}" if every.count(name) > 1 else name
            series[own] = Series(own, one.topic, one.values, one.received + shift)
        topics |= recording.topics
        notes += recording.notes
    spans = [(min(own), max(own)) for topic in topics if (own := _edges(series, topic))]
    apart = max(span[0] for span in spans) - min(span[1] for span in spans)
    # A command that is given once, before the sensors begin, holds from then on.
    if apart > max(end - begin for begin, end in spans):
        raise LogError(
            f"{path}: the times of these tables have nothing in common (one begins {1e-9 * apart:.4g} s after another has "
            "ended); give all of them by one clock."
        )
    return Recording(series, topics, tuple(notes), found[0].time, start)


def _edges(series: dict[str, Series], topic: str) -> list[int]:
    """First and last instants of a table's columns."""
    return [int(edge) for one in series.values() if one.topic == topic for edge in (one.received[0], one.received[-1])]
