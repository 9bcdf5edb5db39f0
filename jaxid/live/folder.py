"""The folder of a live view: which logs lie in it, and how one more gets in, by its name alone and never over another."""

import os
import re
import tempfile
import unicodedata
from dataclasses import dataclass
from io import BufferedIOBase
from pathlib import Path

from ..logs.files import LOG_ENDINGS
from ..logs.formats import is_bag_folder

LARGEST = 256 * 1024**2
"""Bytes of the largest log that is taken from the page; larger ones are copied into the folder."""
ENDINGS = (*LOG_ENDINGS, ".txt", ".txt.gz")
_LONGEST = 200
_AT_A_TIME = 1 << 20
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.I)
Signature = tuple[int, int, int]
"""Size, time of the last change [ns] and number of a file: whether it is the one that was read."""


class Refused(ValueError):
    """What is not taken from the page: an HTTP status, and a sentence with the remedy."""

    def __init__(self, status: int, sentence: str):
        super().__init__(sentence)
        self.status = status


def log_name(name: str) -> str:
    """The name as that of a file in the folder.

    Raises `Refused` for what could name anything else: a path of whatever system, a hidden file, a device, control
    characters, no ending of a log.
    """
    shown = ascii(name[:40])
    name = unicodedata.normalize("NFC", name)
    if re.search(r"[/\\:%<>|?*\"]", name) or not name.isprintable():
        raise Refused(
            400, f"{shown} is no plain file name; give the log a name without / \\ : % and control characters."
        )
    if not name or name.startswith(".") or name != name.strip(" .") or _RESERVED.fullmatch(name):
        raise Refused(400, f"{shown} is no name for a log; rename it, such as run_1.csv.")
    if len(name.encode("utf-8", "replace")) > _LONGEST:
        raise Refused(400, f"{shown}... is longer than {_LONGEST} bytes; give the log a shorter name.")
    if not name.lower().endswith(ENDINGS):
        raise Refused(415, f"{shown} does not end as a log does; give one of {', '.join(ENDINGS)}.")
    return name


@dataclass(frozen=True)
class LogFolder:
    """A folder of logs. `largest`: bytes of what is taken from the page."""

    path: Path
    largest: int = LARGEST

    def files(self) -> dict[str, Signature]:
        """The logs that lie in the folder (ROS 2 bags are folders in it), each with its signature, by name."""
        found = {}
        for path in sorted(self.path.iterdir()):
            try:
                if path.name.startswith(".") or not (path.name.lower().endswith(ENDINGS) or is_bag_folder(path)):
                    continue
                parts = [own.stat() for own in ([path] if path.is_file() else sorted(path.iterdir()))]
            except OSError:  # it went, or is a link to nothing
                continue
            sizes, times = sum(own.st_size for own in parts), max((own.st_mtime_ns for own in parts), default=0)
            found[path.name] = (sizes, times, sum(own.st_ino for own in parts))
        return found

    def others(self) -> tuple[str, ...]:
        """What else lies there and is not read, by name; hidden files apart."""
        logs = self.files()
        return tuple(sorted(own.name for own in self.path.iterdir() if own.name not in logs and own.name[0] != "."))

    def store(self, name: str, body: BufferedIOBase, length: int) -> str:
        """Write `length` bytes of `body` into the folder under `name`, all of them or nothing, and return the name.

        Raises `Refused` for a name that is none of a log in the folder (`log_name`), for one that is taken, for more than
        `largest` bytes, and where the disk or the sender lets it down.
        """
        name = log_name(name)
        if not 0 < length <= self.largest:
            what = f"is {length / 1e6:.4g} MB" if length > 0 else "is empty"
            raise Refused(
                413 if length > 0 else 400,
                f"{name} {what}; the page takes logs up to {self.largest / 1e6:.4g} MB: copy it into {self.path} instead.",
            )
        target = self.path / name
        if os.path.lexists(target):  # a link that leads elsewhere, too
            raise Refused(409, f"{name} is there already; rename one of the two, or delete {target} first.")
        temporary = None
        try:
            handle, temporary = tempfile.mkstemp(prefix=".", suffix=".part", dir=self.path)
            with os.fdopen(handle, "wb") as file:
                left = length
                while left:
                    data = body.read(min(left, _AT_A_TIME))
                    if not data:
                        raise Refused(400, f"{name} broke off after {length - left} of {length} bytes; send it again.")
                    left -= file.write(data)
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(temporary, 0o666 & ~mask)
            os.link(temporary, target)  # never over anything that came meanwhile
        except FileExistsError:
            raise Refused(409, f"{name} is there already; rename one of the two, or delete {target} first.") from None
        except TimeoutError:
            raise
        except OSError as error:
            raise Refused(507, f"{name} cannot be written to {self.path} ({error.strerror}); mind the disk.") from None
        finally:
            if temporary is not None:
                Path(temporary).unlink(missing_ok=True)
        return name
