"""Files that are either complete or not there."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary path beside `path` to write to; it takes the place of `path` when the block ends without an error.

    A reader never sees half a file, and a file that was there before survives a failure; of a run that is killed, the
    temporary file stays behind. Raises `OSError`, which names `path`, if the folder cannot be written or the disk is full.
    """
    path = Path(path)
    with _naming(path):
        handle, name = tempfile.mkstemp(prefix=f".{path.name[:100]}.", suffix=".part", dir=path.parent)
        os.close(handle)
        with _moved(Path(name), path) as temporary:
            yield temporary


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Errors about no file (a full disk) or about a temporary one are errors about `path`."""
    try:
        yield
    except OSError as error:
        if error.errno is None or not (error.filename is None or str(error.filename).endswith(".part")):
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(path)) from None


@contextmanager
def _moved(temporary: Path, path: Path) -> Iterator[Path]:
    try:
        yield temporary
        # mkstemp makes private files; results get the permissions any new file would have.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text, all of it or nothing. Raises `OSError` if the folder cannot be written."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
