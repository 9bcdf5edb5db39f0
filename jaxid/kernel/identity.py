"""Names for robots' functions that hold from one process to the next.

What was compiled for a model is found again by such a name without tracing anything. Only what jaxid's own source says in
full has one: a class or function of anybody else's may come to mean something else without a trace here.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from sys import modules
from types import FunctionType
from typing import Any

_PACKAGE = __name__.split(".")[0]


class _Unnamed(Exception):
    """A part that only its author knows."""


@cache
def _source() -> str:
    """A digest of jaxid's source and of the versions of what translates it."""
    digest = hashlib.sha256()
    root = Path(str(files(_PACKAGE)))
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    for library in ("jax", "numpy", "llvmlite"):
        digest.update(f"{library} {version(library)}".encode())
    return digest.hexdigest()


def _own(thing: Any) -> str:
    """Where a class or function of jaxid's stands."""
    module, name = thing.__module__ or "", thing.__qualname__  # none of what was made by exec
    if module.split(".")[0] != _PACKAGE or getattr(modules.get(module), name, None) is not thing:
        raise _Unnamed
    for base in thing.__mro__[:-1] if isinstance(thing, type) else ():
        for called, member in vars(base).items():
            function = getattr(member, "fget", None) or getattr(member, "__func__", member)
            # Somebody may have put another function into a class of jaxid's.
            if isinstance(function, FunctionType) and not called.startswith("__"):
                if function.__module__ != base.__module__ or function.__qualname__ != f"{base.__qualname__}.{called}":
                    raise _Unnamed
    return f"{module}.{name}"


def _said(thing: Any) -> str:
    if thing is None or isinstance(thing, bool | int | str):
        return repr(thing)
    if isinstance(thing, float):
        return thing.hex()
    if isinstance(thing, tuple | list):
        return f"{type(thing).__name__}({','.join(map(_said, thing))})"
    if isinstance(thing, frozenset):
        return f"set({','.join(sorted(map(_said, thing)))})"
    if isinstance(thing, Mapping):
        return f"map({','.join(f'{_said(k)}:{_said(v)}' for k, v in thing.items())})"
    if isinstance(thing, type | FunctionType):
        return _own(thing)
    if is_dataclass(thing):
        parts = [f"{f.name}={_said(getattr(thing, f.name))}" for f in fields(thing) if f.compare]
        return f"{_own(type(thing))}({','.join(parts)})"
    raise _Unnamed


def identity_of(*things: Any) -> str | None:
    """A name under which nothing else stands that would compile differently; None where a part is not jaxid's own.

    `things`: frozen dataclasses (of their fields those that are compared), classes and functions of jaxid's, numbers, text,
    and tuples and mappings of them.
    """
    try:
        said = _said(things)
    except _Unnamed:
        return None
    return hashlib.sha256(f"{_source()}\n{said}".encode()).hexdigest()[:40]
