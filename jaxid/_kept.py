"""Where compiled programs are kept from one process to the next.

With the user's other programs of JAX where they keep those (`JAX_COMPILATION_CACHE_DIR`), else in the user's cache folder.
"""

import os
from contextlib import suppress
from functools import cache
from pathlib import Path

import jax

_MOST_FILES = 6000
"""Of jaxid's own; a robot with all its candidate effects makes some hundred."""


def users_folder() -> Path | None:
    """The user's cache folder for jaxid, made if it is not there; None where it cannot be written."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    try:
        # The specification says to ignore relative paths.
        path = (Path(base) if os.path.isabs(base) else Path("~/.cache").expanduser()) / "jaxid"
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):
        return None
    return path if os.access(path, os.W_OK | os.X_OK) else None


@cache
def _default() -> Path | None:
    return users_folder()


def folder() -> Path | None:
    """Where machine code is kept; None where it cannot be."""
    of_jax = jax.config.jax_compilation_cache_dir  # type: ignore[attr-defined]
    return Path(of_jax) if of_jax else _default()


_looked: set[Path] = set()


def make_room(kept: Path) -> None:
    """Once a process: where jaxid's files have become too many, the half that was written first goes."""
    if kept in _looked:
        return
    _looked.add(kept)
    with suppress(OSError):
        own = [(entry.stat().st_mtime, entry.path) for entry in os.scandir(kept) if entry.name.startswith("jaxid_")]
        for _, path in sorted(own)[: len(own) // 2] if len(own) > _MOST_FILES else ():
            with suppress(OSError):
                os.unlink(path)
