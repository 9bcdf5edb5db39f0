"""The folder that a command leaves its results in: tried before the work, and kept from another command's results.

`command.json` in it says which command made it and for which robot, and has a hash of every file that people edit, so that a
later run writes over nothing that would be lost.
"""

import hashlib
import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .._json import write_json
from .arguments import UnusableInput

RECORD = "command.json"
_OWN = {
    "explanation.json": "explain",
    "design.json": "design",
    "members.parquet": "fleet",
    "fit.json": "fit",
    "change.json": "change",
}
"""A result of each command, by which folders without a record are known."""
_EDITED = ("model.toml", "*experiment*.csv")
"""Files that people edit or fill in where a command has written them."""


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _edited(out: Path) -> dict[str, str]:
    """The files that people edit, each with its hash."""
    return {path.name: _hash(path) for pattern in _EDITED for path in sorted(out.glob(pattern)) if path.is_file()}


def _record(out: Path) -> dict[str, Any]:
    """What the folder's record says; of a folder without one, the command that its files are of; else empty."""
    try:
        found = json.loads((out / RECORD).read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        found = {}
    if isinstance(found, dict) and isinstance(found.get("command"), str):
        return found
    return next(({"command": command} for name, command in _OWN.items() if (out / name).is_file()), {})


def _refusal(out: Path, command: str, robot: str) -> str:
    """Why the command must not write here, in a sentence; empty if it may."""
    found = _record(out)
    if not found:
        return ""
    if found["command"] != command:
        return f"{out} holds results of `jaxid {found['command']}`"
    if found.get("robot", robot) != robot:
        return f"{out} holds results of `jaxid {command}` for the robot {found['robot']!r}"
    known = found.get("files")
    changed = [name for name, now in _edited(out).items() if isinstance(known, dict) and now != known.get(name)]
    return f"{out / changed[0]} has changed since `jaxid {command}` wrote it" if changed else ""


def try_folder(out: Path) -> None:
    """Make the folder and try it, so that nobody waits for a result that cannot be written. Raises `OSError`."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=out):
        pass


@contextmanager
def results_in(out: Path, command: str, robot: str, overwrite: bool) -> Iterator[None]:
    """The folder for what `command` writes about `robot`, and its record once all is written.

    Raises `UnusableInput` for a folder with another command's or robot's results, or with a file that somebody has edited
    since, unless `overwrite`; and `OSError`.
    """
    refused = "" if overwrite or not out.is_dir() else _refusal(out, command, robot)
    if refused:
        raise UnusableInput(f"{refused}; give another --out, or --overwrite to write over it.")
    try_folder(out)
    yield
    record(out, command, robot)


def record(out: Path, command: str, robot: str) -> None:
    """Write which command made the folder's files. Raises `OSError`."""
    write_json(out / RECORD, {"command": command, "robot": robot, "files": _edited(out)})
