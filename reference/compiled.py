"""numba's functions of a given signature, compiled (or read from numba's cache) when they are first called: importing the
simulator compiles nothing.

numba compiles a function together with those it calls, also from other files, but looks at its own file alone to see whether
what it kept is stale; so what is older than any file here is forgotten.

Only functions of one given signature are kept. numba numbers what it keeps of one function by signature, and two processes
that begin at once take the same number for two signatures: one of them then finds the other's code, and runs or crashes with
it. So functions that are called with more than one kind of arguments are plain `@njit`, compiled again with their callers.
"""

from collections.abc import Callable
from functools import cached_property, update_wrapper
from pathlib import Path
from typing import Any

from numba import njit


def forget_stale(folder: Path) -> None:
    """Remove numba's indices of kept functions that are older than the newest source file of the folder."""
    newest = max((path.stat().st_mtime for path in folder.glob("*.py")), default=0.0)
    for index in (folder / "__pycache__").glob("*.nbi"):
        try:
            if index.stat().st_mtime < newest:
                index.unlink()
        except OSError:  # another process was faster, or nothing may be removed here
            continue


forget_stale(Path(__file__).parent)


class Compiled:
    """`numba.njit(signature, cache=True)(function)`, later."""

    def __init__(self, function: Callable, signature: Any):
        update_wrapper(self, function)
        self._function, self._signature = function, signature

    @cached_property
    def ready(self) -> Any:
        """The compiled function, as another compiled function takes it."""
        return njit(self._signature, cache=True)(self._function)

    @cached_property
    def callee(self) -> Any:
        """The function as it is called inside another compiled function, compiled together with that one."""
        return njit(self._function)

    def __call__(self, *arguments: Any) -> Any:
        return self.ready(*(a.ready if isinstance(a, Compiled) else a for a in arguments))


def compiled(signature: Any) -> Callable[[Callable], Compiled]:
    """Decorator: compiled for `signature` when it is first called."""
    return lambda function: Compiled(function, signature)
