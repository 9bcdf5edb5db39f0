"""One file for any result, from which any program gets it back: `save` and `load`.

The file is a zip archive of a page of JSON and of NumPy's files, which hold every number to the last digit. It says which
versions wrote it; the result itself says from which logs it was computed, by their hashes, and how (`origin`). Nothing in it
is ever run: there is no pickle in it, and classes and functions of the user's are looked up by name among what the user has
imported.
"""

import json
import zipfile
import zlib
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

from ._atomic import replacing
from ._origin import versions
from ._stored import Reader, StoredError, Writer

_FORMAT, _VERSION, _HEADER = "jaxid result", 1, "result.json"
_BEGINNING = (1980, 1, 1, 0, 0, 0)
"""When everything in an archive was made: the same result gives the same bytes."""
_NOT_OURS = "is no file that jaxid.save wrote; give one of these"


class ResultFileError(ValueError):
    """A result that cannot be saved or loaded. The message is one sentence with the file and the remedy."""


def save(result: Any, path: str | Path) -> Path:
    """Write a result into one file, all of it or nothing, and return the file's path. `load` reads it.

    `result`: what a function of jaxid's returns: a `Fit`, `Fleet`, `Profiles`, `Posterior`, `MultiStart`, `Repeatability`,
    `Identifiability`, `Explanation`, `ExplainedChange`, `Comparison`, `Design`, logs, a robot. Arrays keep their full
    precision; `result.origin` goes with it: the function, its arguments and seeds, the SHA-256 of every log, versions.

    Robots and effects of your own are written by name, "module:qualname", with their numbers. Of the origin's arguments those
    that have no name to be found by are left out.

    Raises `ResultFileError` for what is no result, and where the robot holds a function without a name of its own (a
    lambda, or one inside another function); `OSError` where the file cannot be written.

    >>> import jaxid, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     jaxid.load(jaxid.save(jaxid.Axis(), f"{folder}/axis.jaxid")) == jaxid.Axis()
    True
    """
    path, writer = Path(path), Writer()
    try:
        content = writer.value(result)
        if set(content if isinstance(content, dict) else ()) != {"object"}:
            raise StoredError(
                f"a {type(result).__name__} is no result of jaxid's; give what one of its functions returned"
            )
    except StoredError as error:
        raise ResultFileError(f"{path}: the {type(result).__name__} cannot be saved: {error}.") from None
    header = {
        "format": _FORMAT,
        "version": _VERSION,
        "kind": type(result).__name__,
        "versions": versions(),
        "result": content,
        "objects": writer.objects,
    }
    text = json.dumps(header, ensure_ascii=False, allow_nan=False)
    with (
        replacing(path) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive,
    ):
        for name, data in {_HEADER: text.encode(), **writer.files}.items():
            archive.writestr(zipfile.ZipInfo(name, _BEGINNING), data, zipfile.ZIP_DEFLATED)
    return path


def load(path: str | Path, *, known: Iterable[Any] = ()) -> Any:
    """The result that `save` wrote into a file: the same class with the same numbers, ready for `compare`, `explain` and all
    else.

    `known`: modules, classes or functions of your own that the result needs and that are not imported under the name they had
    (those of a script are in the module "__main__"). Loading imports nothing that the file names and runs nothing in it.

    Raises `ResultFileError`, one sentence with file and remedy: a file that cannot be opened or is no result, that a newer
    jaxid wrote, that is damaged, or that needs a class or function which is not imported.
    """
    path = Path(path)
    try:
        with zipfile.ZipFile(path) as archive:
            files = {name: archive.read(name) for name in archive.namelist()}
        header = json.loads(files.pop(_HEADER))
        if header["format"] != _FORMAT:
            raise KeyError(header["format"])
        version, objects, result = header["version"], header["objects"], header["result"]
    except OSError as error:
        raise ResultFileError(f"The result {path} cannot be opened ({error.strerror}); check the path.") from None
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        damaged = path.read_bytes()[:4] == b"PK\x03\x04"
        what = f"is damaged ({error}); copy or save it again" if damaged else _NOT_OURS
        raise ResultFileError(f"{path} {what}.") from None
    except (KeyError, ValueError, TypeError):
        raise ResultFileError(f"{path} {_NOT_OURS}.") from None
    made = header.get("versions")
    wrote = str(made.get("jaxid", "?") if isinstance(made, dict) else "?")[:20]
    if version != _VERSION:
        raise ResultFileError(
            f"{path} is in format {version!r:.20}, written by jaxid {wrote}; this jaxid reads format {_VERSION}: install a "
            "newer one (pip install --upgrade jaxid-robots)."
        )
    jaxid = import_module("jaxid")
    for name in jaxid.__all__:  # whatever a result may hold is looked up, not imported
        getattr(jaxid, name)
    try:
        return Reader(objects, files, tuple(known)).value(result)
    except StoredError as error:
        remedy = "" if "; " in str(error) else f"; it was written by jaxid {wrote}, load it with that or save it again"
        raise ResultFileError(f"{path} {error}{remedy}.") from None
    except (KeyError, ValueError, TypeError, AttributeError, IndexError, RecursionError, OSError, EOFError) as error:
        cause = " ".join(str(error).split())[:120]
        raise ResultFileError(
            f"{path} is damaged, or of another version ({cause}); it was written by jaxid {wrote}: load it with that, or "
            "save it again."
        ) from None
