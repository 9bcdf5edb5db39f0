"""Files that robots write, one format a file: each from a path to a `Recording`, its signals with their own time stamps."""

from collections.abc import Collection
from pathlib import Path

from ..finding import LogError
from ..series import Recording
from .several import read_several, tables_of

_MAGIC = (
    (b"#ROSBAG V", "bag"),
    (b"\x89MCAP0\r\n", "mcap"),
    (b"SQLite format 3\x00", "db3"),
    (b"WPILOG", "wpilog"),
    (b"MATLAB ", "mat"),
    (b"\x89HDF\r\n\x1a\n", "mat"),
)
_WORDS = {
    "bag": "a ROS 1 bag",
    "mcap": "an MCAP file",
    "db3": "an SQLite file of a ROS 2 bag",
    "wpilog": "a WPILib data log",
    "mat": "a MATLAB file",
}


def is_bag_folder(path: Path) -> bool:
    """Whether a folder is a ROS 2 bag, which is given as a whole."""
    return path.is_dir() and (path / "metadata.yaml").is_file()


def format_of(path: Path) -> str | None:
    """What a file holds by its first bytes: "bag", "mcap", "db3", "wpilog" or "mat"; "folder" for a ROS 2 bag's; "tables" for
    several that are one run (`several`); None for a table.

    Raises `LogError` where the name promises a recording and the bytes are none."""
    if path.is_dir():
        return "folder"
    if tables_of(path):
        return "tables"
    try:
        with path.open("rb") as file:
            start = file.read(16)
    except OSError as error:
        raise LogError(f"{path} cannot be opened ({error.strerror}); check the path and its permissions.") from None
    found = next((name for magic, name in _MAGIC if start.startswith(magic)), None)
    ending = path.suffix.lower().lstrip(".")
    if start[:4] == b"\x28\xb5\x2f\xfd":
        raise LogError(f"{path} is compressed with zstd; give the bag's folder, with its metadata.yaml, or unpack it.")
    if ending not in _WORDS:
        return found
    if not start:
        raise LogError(f"{path} is empty; give {_WORDS[ending]} of an experiment.")
    if found is None and ending == "mat":
        return "mat"  # version 4 has no mark of its own
    if found is None:
        raise LogError(f"{path} is not {_WORDS[ending]} although its name says so; copy or record it again.")
    return found


def read_recording(
    path: Path, fields: Collection[str] | None = None, time_field: str | None = None
) -> Recording | None:
    """The signals of a recording, or None for a table (CSV, Parquet).

    `fields`, where given, are the field paths that will be asked for: of a bag only their topics are read. `time_field`
    names the vector of times of a MATLAB file. Raises `LogError` for whatever cannot be read.
    """
    kind = format_of(path)
    if kind is None:
        return None
    if kind in ("bag", "mcap", "db3") and path.suffix != f".{kind}":
        raise LogError(f"{path} is {_WORDS[kind]}; let its name end in .{kind}.")
    if kind == "tables":
        return read_several(path, time_field)
    if kind == "wpilog":
        from .wpilog import read_wpilog

        return read_wpilog(path)
    if kind == "mat":
        from .matlab import read_mat

        return read_mat(path, time_field)
    from .ros import read_ros

    return read_ros(path, fields)


__all__ = ["format_of", "is_bag_folder", "read_recording", "tables_of"]
