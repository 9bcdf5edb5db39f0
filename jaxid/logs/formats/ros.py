"""ROS 1 bags (.bag) and ROS 2 bags (a folder, .mcap, .db3), by the library rosbags; ROS itself is not needed.

Message types are read from the definitions in the bag; those of a bag without any (ROS 2 up to Humble in .db3) are the
standard ones of that time.
"""

import re
from collections.abc import Collection, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..finding import LogError
from ..log import did_you_mean
from ..series import Recording, Series, Topic
from ..supply import of_supply
from .cut_mcap import CutMcap, whole_records
from .messages import LONGEST_ARRAY, Part, parts, unit_of

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

_NEEDED = "needs the package rosbags; install it with: pip install jaxid-robots[bags]"
_LARGE = 65_536
"""Bytes of a message above which it is an image, a scan or a map, and not looked into."""
_CUT = (
    "the file breaks off, as when its recorder is stopped hard, and was read up to its last whole chunk; check that the "
    "recording ended where you think"
)
_TYPE = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)+")
_NEW = "ros2 bag reindex FOLDER"


def _remedy(path: Path, error: BaseException) -> str:
    """What to do about a bag that rosbags does not open."""
    said = str(error)
    if path.suffix == ".bag":
        return "run `rosbag reindex` on it, or record it again"
    if "Profile" in said:
        return "only MCAP files recorded by ROS 2 can be read; convert it with `rosbags-convert`, or export CSV"
    if path.suffix == ".mcap":
        return "the recorder was probably stopped hard; save what is there with `mcap recover`"
    if path.is_dir():
        return f"run `{_NEW}`, or give its .mcap or .db3 file itself"
    return "copy it again, or record it again"


def _cause(error: BaseException) -> str:
    text = "".join(c if c.isprintable() else " " for c in str(error.args[0] if error.args else type(error).__name__))
    return " ".join(text.split())[:160].rstrip(".") or type(error).__name__


def _of_topic(field: str) -> str:
    """The topic that a field path is of."""
    return re.split(r"[.\[]", field, maxsplit=1)[0]


class _Columns:
    """Messages of one topic, gathered field by field."""

    def __init__(self, topic: str, kind: str):
        self.topic, self.kind = topic, kind
        self.groups: dict[tuple[str, ...], list[tuple[int, int | None, tuple[float, ...]]]] = {}
        self.frames: dict[tuple[str, ...], str] = {}
        self.faults: dict[str, str] = {}
        self.read = 0

    def add(self, received: int, found: list[Part]) -> None:
        self.read += 1
        for part in found:
            self.groups.setdefault(part.names, []).append((received, part.stamp, part.numbers))
            self.frames.setdefault(part.names, part.frame)
            for place, text in part.faults:
                self.faults.setdefault(place, text)

    def series(self) -> Iterable[Series]:
        """Every field as a series, in the order of receipt."""
        pieces: dict[str, list[tuple[tuple[str, ...], int]]] = {}
        for names in self.groups:
            for place, name in enumerate(names):
                pieces.setdefault(name, []).append((names, place))
        tables = {
            names: (
                np.array([row[0] for row in rows], dtype=np.int64),
                np.array([-1 if row[1] is None else row[1] for row in rows], dtype=np.int64),
                np.array([row[2] for row in rows], dtype=float).reshape(len(rows), len(names)),
            )
            for names, rows in self.groups.items()
        }
        whole = sum(len(rows) for rows in self.groups.values())
        for name, where in pieces.items():
            received = np.concatenate([tables[names][0] for names, _ in where])
            stamps = np.concatenate([tables[names][1] for names, _ in where])
            values = np.concatenate([tables[names][2][:, place] for names, place in where])
            order = np.argsort(received, kind="stable")
            fault = next((text for place, text in self.faults.items() if name.startswith(place)), "")
            if len(values) < whole and re.search(r"\[\d+\]", name) and not fault:
                lengths = sorted({len(names) for names in self.groups})
                fault = (
                    f"an array of {self.topic} changes its length: messages have {lengths[0]} to {lengths[-1]} numbers"
                )
            values = values[order]
            if name.endswith(".yaw"):
                values = np.unwrap(values)
            yield Series(
                name,
                self.topic,
                values,
                received[order],
                None if (stamps < 0).any() else stamps[order],
                unit_of(self.kind, name),
                self.frames[where[0][0]],
                fault,
            )


def _check_types(connections: Iterable["Connection"], path: Path) -> None:
    """Names of types become names of classes in rosbags: nothing else may stand there."""
    for connection in connections:
        if not _TYPE.fullmatch(connection.msgtype):
            raise LogError(
                f"{path}: topic {connection.topic!r:.60} has a type {connection.msgtype!r:.60}, which is no message type; "
                "the file is damaged, so copy it again."
            )


def _older_types() -> Any:
    """The standard messages, for bags that hold no definitions."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def read_ros(path: Path, fields: Collection[str] | None = None) -> Recording:
    """The numeric signals of a bag; of `fields`, only the topics that these are of.

    An MCAP file that breaks off is read up to its last whole chunk, which a note says.

    Raises `LogError`, one sentence with file and remedy, without rosbags and for a bag that is damaged, not indexed,
    empty, or lacks one of the `fields`' topics.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
    except ImportError:
        raise LogError(f"{path} is a ROS bag, and reading it {_NEEDED}.") from None
    try:
        cut = whole_records(path) if path.suffix == ".mcap" else None
        source: Any = path if cut is None else CutMcap(path, cut)
        with (Reader1 if path.suffix == ".bag" else Reader2)(source) as plain:
            _check_types(plain.connections, path)
            if cut is not None and not plain.message_count:
                raise LogError(f"{path} breaks off before its first chunk of messages is whole; record it again.")
        with AnyReader([source], default_typestore=_older_types()) as reader:
            found = _recording(reader, path, fields)
        return found if cut is None else replace(found, notes=(*found.notes, ("truncated", _CUT)))
    except LogError:
        raise
    except PermissionError as error:
        raise LogError(f"{path} cannot be opened ({error.strerror}); check its permissions.") from None
    except Exception as error:  # whatever the parts of rosbags raise of damaged bytes
        raise LogError(f"{path} cannot be read as a ROS bag ({_cause(error)}); {_remedy(path, error)}.") from None


def _recording(reader: Any, path: Path, fields: Collection[str] | None) -> Recording:
    """What the open `reader` holds."""
    kinds: dict[str, str] = {}
    counts: dict[str, int] = {}
    for connection in reader.connections:
        kinds.setdefault(connection.topic, connection.msgtype)
        counts[connection.topic] = counts.get(connection.topic, 0) + connection.msgcount
        if kinds[connection.topic] != connection.msgtype:
            raise LogError(
                f"{path}: topic {connection.topic!r} has messages of two types, {kinds[connection.topic]} and "
                f"{connection.msgtype}; record it again with one."
            )
    if not sum(counts.values()):
        raise LogError(f"{path} holds no messages; give a recording of an experiment.")
    asked = set(kinds) if fields is None else {_of_topic(field) for field in fields}
    for topic in sorted(asked - set(kinds)):
        listed = ", ".join(sorted(kinds))
        raise LogError(f"{path} has no topic {topic!r}{did_you_mean(topic, kinds)}; it has {listed:.400}: correct it.")
    # Beside what is asked for, whatever tells of the battery: it matters to every command.
    wanted = asked | {topic for topic, kind in kinds.items() if kind.endswith("/BatteryState") or of_supply(topic)}
    known = set(reader.typestore.fielddefs)
    unknown = {topic for topic, kind in kinds.items() if kind not in known}
    chosen = [c for c in reader.connections if c.topic in wanted and c.topic not in unknown]
    columns = {topic: _Columns(topic, kinds[topic]) for topic in wanted}
    large: dict[str, int] = {}
    # Of no connections at all rosbags would hand out the messages of every one.
    for connection, received, data in reader.messages(connections=chosen) if chosen else ():
        topic = connection.topic
        if topic not in columns:
            continue
        if len(data) > _LARGE or topic in large:
            large[topic] = max(large.get(topic, 0), len(data))
            continue
        try:
            message = reader.deserialize(data, connection.msgtype)
            columns[topic].add(received, parts(topic, connection.msgtype, message))
        except Exception as error:  # as in `read_ros`
            if topic not in asked:
                del columns[topic]
                continue
            raise LogError(
                f"{path}: message {columns[topic].read} of topic {topic!r} ({connection.msgtype}) cannot be read "
                f"({_cause(error)}); the file is damaged, so copy it again."
            ) from None
    series = {one.name: one for topic in sorted(columns) for one in columns[topic].series()}
    with_numbers = {one.topic for one in series.values()}
    topics = {}
    for topic in sorted(kinds):
        remark = ""
        if not counts[topic]:
            remark = "no messages"
        elif topic in unknown:
            remark = "a type of which the bag holds no definition, as those of ROS 2 Humble and older do not"
        elif topic in large:
            remark = f"messages of {large[topic]:,} bytes, not looked into"
        elif topic in columns and topic not in with_numbers:
            remark = f"no numbers (text, or arrays of more than {LONGEST_ARRAY})"
        topics[topic] = Topic(topic, kinds[topic], counts[topic], remark)
    return Recording(series, topics)
