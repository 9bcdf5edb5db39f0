"""WPILib data logs (.wpilog) of FRC robots, by the library robotpy-wpiutil: entries of numbers, arrays and structs.

A robot is switched off while it records: a log whose last record breaks off is read up to there, and says so.
An entry's metadata may say its unit, as those of FRC SysId do ("Rotation per Second", by WPILib's SysIdRoutineLog).
Structs (`struct:Pose2d` and the like) are decoded by the schemas that the log carries.
"""

from pathlib import Path
from typing import Any

import numpy as np

from ..finding import LogError
from ..series import Recording, Series, Topic
from ..units import unit_said
from .structs import Struct, StructError, struct_of

_NEEDED = "needs the package robotpy-wpiutil; install it with: pip install jaxid-robots[wpilog]"
_SCALARS = {"double": "getDouble", "float": "getFloat", "int64": "getInteger", "boolean": "getBoolean"}
_ARRAYS = {
    "double[]": "getDoubleArray",
    "float[]": "getFloatArray",
    "int64[]": "getIntegerArray",
    "boolean[]": "getBooleanArray",
}
_SCHEMA = "/.schema/struct:"
_LONGEST_ARRAY = 32
_LONGEST_METADATA = 1000


def _end(data: bytes, place: int, size: int) -> int:
    """Where a record of `size` bytes ends: the first byte, at `place`, says how long the numbers before them are."""
    lengths = data[place] if place < len(data) else 0
    return place + 1 + (lengths & 3) + 1 + (lengths >> 2 & 3) + 1 + (lengths >> 4 & 7) + 1 + size


class _Entry:
    """One entry of the log and what was recorded in it."""

    def __init__(self, name: str, kind: str, metadata: str = ""):
        self.name, self.kind = name, kind
        self.unit = unit_said(metadata[:_LONGEST_METADATA])
        self.times: list[int] = []
        self.rows: list[tuple[float, ...]] = []
        self.names: tuple[str, ...] | None = None
        self.fault = ""
        self.remark = "no numbers"
        self.records = 0

    def add(self, time: int, pairs: list[tuple[str, float]]) -> None:
        names = tuple(name for name, _ in pairs)
        if self.names is None:
            self.names = names
        if names != self.names:
            self.fault = self.fault or (
                f"an array of {self.name} changes its length (from {len(self.names)} to {len(names)} numbers)"
            )
            return
        self.times.append(time)
        self.rows.append(tuple(value for _, value in pairs))


class _Structs:
    """The structs of a log, worked out from its schemas when they are needed."""

    def __init__(self) -> None:
        self.schemas: dict[str, str] = {}
        self._known: dict[str, Struct] = {}

    def __getitem__(self, kind: str) -> Struct:
        if kind not in self._known:
            self._known[kind] = struct_of(kind, self.schemas)
        return self._known[kind]


def _pairs(record: Any, entry: _Entry, structs: _Structs) -> list[tuple[str, float]]:
    """The numbers of one record, by name; none for text and other bytes."""
    if entry.kind in _SCALARS:
        return [(entry.name, float(getattr(record, _SCALARS[entry.kind])()))]
    if entry.kind in _ARRAYS:
        values = getattr(record, _ARRAYS[entry.kind])()
        few = values if len(values) <= _LONGEST_ARRAY else []
        return [(f"{entry.name}[{index}]", float(value)) for index, value in enumerate(few)]
    if entry.kind.startswith("struct:"):
        try:
            struct = structs[entry.kind[7:].removesuffix("[]")]
            return struct.numbers(entry.name, bytes(record.getRaw()), entry.kind.endswith("[]"))
        except StructError as error:  # one struct that is not understood leaves the rest of the log as it is
            entry.remark = str(error)
    return []


def read_wpilog(path: Path) -> Recording:
    """The numeric entries of a data log.

    Raises `LogError`, one sentence with file and remedy, without robotpy-wpiutil and for a file that is no data log, is
    damaged or holds no numbers.
    """
    try:
        from wpiutil.log import DataLogReader
    except ImportError:
        raise LogError(f"{path} is a WPILib data log, and reading it {_NEEDED}.") from None
    try:
        data = path.read_bytes()
    except OSError as error:
        raise LogError(f"{path} cannot be opened ({error.strerror}); check the path and its permissions.") from None
    reader = DataLogReader(data, path.name)
    if not reader.isValid():
        raise LogError(f"{path} is not a WPILib data log (its first bytes are damaged); copy it again.")
    entries: dict[int, _Entry] = {}
    named: dict[str, _Entry] = {}
    structs = _Structs()
    place = int.from_bytes(data[8:12], "little") + 12  # after the extra header
    try:
        for record in reader:
            end = _end(data, place, record.getSize())
            if end > len(data):
                break  # the library hands out a record that breaks off, too, with the bytes of another one
            place, number, time = end, record.getEntry(), record.getTimestamp()
            if record.isStart():
                began = record.getStartData()
                entry = named.setdefault(began.name, _Entry(began.name, began.type, began.metadata))
                if entry.kind != began.type:
                    entry.fault = f"{began.name} changes its type from {entry.kind} to {began.type}"
                    entry = _Entry(began.name, began.type)  # what follows is of the other type, and goes nowhere
                entries[began.entry] = entry
            elif record.isFinish():
                entries.pop(record.getFinishEntry(), None)
            elif not record.isControl() and number in entries:
                entry = entries[number]
                entry.records += 1
                if entry.name.startswith(_SCHEMA):
                    structs.schemas[entry.name[len(_SCHEMA) :]] = bytes(record.getRaw()).decode()
                elif not -(2**53) < time < 2**53:
                    raise ValueError(f"a time stamp of {time} microseconds")
                elif pairs := _pairs(record, entry, structs):
                    entry.add(1000 * time, pairs)
    except (TypeError, ValueError, OverflowError) as error:
        cause = " ".join(str(error).split())[:120]
        raise LogError(f"{path} is damaged as a WPILib data log ({cause}); copy it from the robot again.") from None
    series = {one.name: one for entry in named.values() for one in _series(entry)}
    if not series:
        raise LogError(f"{path} holds no entries with numbers; give a data log of an experiment.")
    topics = {
        entry.name: Topic(entry.name, entry.kind, entry.records, "" if entry.names else entry.remark)
        for entry in sorted(named.values(), key=lambda entry: entry.name)
        if not entry.name.startswith("/.schema/")
    }
    cut = "its last record breaks off and was left out; check that the recording ended where you think"
    return Recording(series, topics, (("truncated", cut),) if place < len(data) else ())


def _series(entry: _Entry) -> list[Series]:
    if not entry.names or not entry.rows:
        return []
    # Records of several threads may stand in another order than their times.
    times = np.array(entry.times, dtype=np.int64)
    order = np.argsort(times, kind="stable")
    values = np.array(entry.rows, dtype=float)[order]
    si, factor, said = entry.unit or ("", 1.0, "")
    return [
        Series(
            name,
            entry.name,
            values[:, place],
            times[order],
            unit=si if np.isfinite(factor) else "",
            fault=entry.fault,
            to_si=factor,
            said=said,
        )
        for place, name in enumerate(entry.names)
    ]
