"""Which files are meant: paths, patterns, ROS 2 bags as folders, tables of one run as `odometry.csv+imu.csv`, and stretches of
them such as `run.mcap[3:18.5]`."""

import glob
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from .finding import LogError
from .formats import is_bag_folder, tables_of
from .log import Log, did_you_mean

PathLike = str | Path
LOG_ENDINGS = (".csv", ".tsv", ".csv.gz", ".tsv.gz", ".parquet", ".pq", ".bag", ".mcap", ".db3", ".wpilog", ".mat")
"""Endings, in small letters, of the names of files that are logs in a folder of them."""
_STRETCH = re.compile(r"(?P<path>.+)\[(?P<start>-?[\d.]*):(?P<stop>-?[\d.]*)\]")


class NamedFile(NamedTuple):
    """A log's file, its name beside the others, and the stretch of it that is meant [s, the log's own time]."""

    path: Path
    name: str
    start: float | None = None
    stop: float | None = None

    def cut(self, log: Log) -> Log:
        """The stretch of the `log`; raises `LogError` where nothing lies in it."""
        return log if self.start is None and self.stop is None else log.window(self.start, self.stop)


def _stretch(path: PathLike) -> tuple[PathLike, float | None, float | None]:
    """A path without its stretch, and where that begins and ends [s]. Raises `LogError` for one that is no time."""
    found = _STRETCH.fullmatch(str(path))
    if found is None or Path(path).expanduser().exists():
        return path, None, None
    try:
        start, stop = (float(text) if text else None for text in (found["start"], found["stop"]))
    except ValueError:
        raise LogError(f"{path} ends in no stretch of time; write seconds, such as {found['path']}[3:18.5].") from None
    if start is not None and stop is not None and not start < stop:
        raise LogError(f"{path} is a stretch that ends before it begins; write the earlier time first.")
    return found["path"], start, stop


def _is_log(path: Path) -> bool:
    """Whether a pattern means this: a file, or a ROS 2 bag as a folder."""
    return path.is_file() or is_bag_folder(path)


def logs_in(folder: Path) -> list[Path]:
    """The logs in a folder, in alphabetical order: files whose names end as logs do, and ROS 2 bags as folders.

    Of a folder that is a bag itself, this bag.
    """
    if is_bag_folder(folder):
        return [folder]
    return sorted(
        p for p in folder.iterdir() if is_bag_folder(p) or p.is_file() and p.name.lower().endswith(LOG_ENDINGS)
    )


def _files(path: Path) -> list[Path]:
    """The files that one path or pattern means. Raises `LogError` for what is no log."""
    if _is_log(path):
        return [path]
    if tables := tables_of(path):
        for table in tables:
            if table.is_dir() or _files(table) != [table]:
                raise LogError(f"{path}: {table} is no table; join tables of one run, as odometry.csv+imu.csv.")
        return [path]
    if path.is_dir():
        raise LogError(f"{path} is a folder; give its logs, such as {path / '*.csv'}.")
    if path.exists():
        raise LogError(f"{path} is a pipe or device, no file; write the log to a file first.")
    if glob.has_magic(str(path)):
        matches = sorted(match for match in map(Path, glob.glob(str(path), recursive=True)) if _is_log(match))
        if not matches:
            raise LogError(f"No file matches {path}; check the pattern and the folder you start from.")
        return matches
    near = [other.name for other in path.parent.iterdir() if other != path] if path.parent.is_dir() else []
    raise LogError(f"{path} does not exist{did_you_mean(path.name, near)}; check the path.")


def _overlap(one: NamedFile, other: NamedFile) -> bool:
    """Whether two stretches of one file have anything in common."""
    begin, end = float("-inf"), float("inf")
    starts, stops = [
        [default if value is None else value for value in values]
        for default, values in ((begin, (one.start, other.start)), (end, (one.stop, other.stop)))
    ]
    return max(starts) < min(stops)


def named_files(paths: PathLike | Iterable[PathLike]) -> list[NamedFile]:
    """The files that paths and patterns mean, with their names and stretches.

    Raises `LogError` for what is no log, or is there twice, in whole or in parts that overlap.
    """
    found: list[NamedFile] = []
    for given in [paths] if isinstance(paths, str | Path) else paths:
        path, start, stop = _stretch(given)
        found += [NamedFile(one, "", start, stop) for one in _files(Path(path).expanduser())]
    if not found:
        raise LogError("No logs were given; give a file, a pattern such as logs/*.csv, or a list of them.")
    real = [one.path.resolve() for one in found]
    for k, one in enumerate(found):
        if any(real[j] == real[k] and _overlap(one, found[j]) for j in range(k)):
            raise LogError(f"{one.path} is given twice; name each log once, or it would count double.")
    alone = list(dict.fromkeys(real))
    names = dict(zip(alone, _names([found[real.index(path)].path for path in alone]), strict=True))
    return [one._replace(name=names[path]) for one, path in zip(found, real, strict=True)]


def files_of(paths: PathLike | Iterable[PathLike]) -> list[Path]:
    """The files that paths and patterns mean. Raises `LogError` as `named_files` does."""
    return [one.path for one in named_files(paths)]


def _place(path: Path) -> tuple[str, ...]:
    """The parts of a path; the tables of one run are one name in the folder of the first."""
    tables = tables_of(path)
    if not tables:
        return path.resolve().parts
    return (*tables[0].resolve().parent.parts, "+".join(table.name for table in tables))


def _names(paths: Sequence[Path]) -> list[str]:
    """File names, with as many parent folders as it takes to tell equal ones apart."""
    parts = [_place(path) for path in paths]
    names = []
    for own in parts:
        depth = 1
        while sum(other[-depth:] == own[-depth:] for other in parts) > 1:
            depth += 1
        names.append("/".join(own[-depth:]))
    return names
