"""An MCAP file that breaks off, since its recorder was stopped hard: what is whole of it, as a file that ends as it should.

An MCAP file is a row of records, each an opcode, a length and a content; messages come in chunks. One that was closed ends with
a summary, a footer and eight fixed bytes (https://mcap.dev/spec). Of one that was not, the records up to the last whole one are
read, a chunk being one record, with a footer that promises no summary behind them. Nothing is written.
"""

import io
from pathlib import Path
from typing import Any

_MAGIC = b"\x89MCAP0\r\n"
_FOOTER = b"\x02" + (20).to_bytes(8, "little") + bytes(20) + _MAGIC
"""A footer without summary, its index and its check sum, and the end."""
_OF_THE_DATA = frozenset((0x01, 0x03, 0x04, 0x05, 0x06, 0x07, 0x09, 0x0C))
"""Opcodes of the data's records: header, schema, channel, message, chunk, message index, attachment, metadata."""


def whole_records(path: Path) -> int | None:
    """Bytes of a file that breaks off, up to the end of the last whole record of its data; None where it ends as it should."""
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            return None  # no MCAP file at all
        file.seek(-min(len(_MAGIC), size), io.SEEK_END)
        if size >= len(_MAGIC) + len(_FOOTER) and file.read() == _MAGIC:
            return None
        end = len(_MAGIC)
        while True:
            file.seek(end)
            head = file.read(9)
            after = end + 9 + int.from_bytes(head[1:], "little")
            if len(head) < 9 or head[0] not in _OF_THE_DATA or after > size:
                return end
            end = after


class CutMcap:
    """A path, as rosbags takes one, of the first `end` bytes of an MCAP file and the end that they lack."""

    def __init__(self, path: Path, end: int):
        self._path, self._end = path, end

    def __getattr__(self, name: str) -> Any:
        return getattr(self._path, name)

    def __str__(self) -> str:
        return str(self._path)

    def open(self, *arguments: Any, **named: Any) -> io.BufferedReader:
        """The file, to read bytes from."""
        return io.BufferedReader(_Joined(self._path, self._end, _FOOTER))


class _Joined(io.RawIOBase):
    """The first `end` bytes of a file, and a tail behind them."""

    def __init__(self, path: Path, end: int, tail: bytes):
        self._file, self._end, self._tail, self._at = path.open("rb"), end, tail, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        from_where = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._end + len(self._tail)}[whence]
        self._at = max(0, from_where + offset)
        return self._at

    def readinto(self, buffer: Any) -> int:
        if self._at < self._end:
            self._file.seek(self._at)
            data = self._file.read(min(len(buffer), self._end - self._at))
        else:
            begin = self._at - self._end
            data = self._tail[begin : begin + len(buffer)]
        buffer[: len(data)] = data
        self._at += len(data)
        return len(data)

    def close(self) -> None:
        self._file.close()
        super().close()
