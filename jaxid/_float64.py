"""float64 without a flag.

Identification needs double precision, and JAX's switch for it is global. Every public function of jaxid runs under
`float64`, which turns double precision on for the duration of the call, on this thread only, and leaves the caller's
configuration as it was; linear algebra stays on one thread meanwhile (`OneBlasThread`).
"""

from collections.abc import Callable
from contextlib import ContextDecorator, ExitStack
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import jax

from ._blas import OneBlasThread

P = ParamSpec("P")
R = TypeVar("R")


class float64(ContextDecorator):
    """Use double precision inside a block (`with float64(): ...`) or a function (`@float64()`)."""

    def __enter__(self) -> "float64":
        self._stack = ExitStack()
        self._stack.enter_context(jax.enable_x64(True))
        return self

    def __exit__(self, *exception: Any) -> None:
        self._stack.close()

    def _recreate_cm(self) -> "float64":
        # A fresh context for every call of a decorated function, so that recursion and threads do not share a stack.
        return type(self)()


def in_float64(function: Callable[P, R]) -> Callable[P, R]:
    """The same function, run in double precision, its linear algebra on one thread."""

    @wraps(function)
    def run(*arguments: P.args, **named: P.kwargs) -> R:
        with float64(), OneBlasThread():
            return function(*arguments, **named)

    return run
