"""numba's functions of a given signature, compiled (or read from numba's cache) when they are first called: importing the
simulator compiles nothing."""

from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import Any

from numba import njit


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
        return njit(cache=True)(self._function)

    def __call__(self, *arguments: Any) -> Any:
        return self.ready(*(a.ready if isinstance(a, Compiled) else a for a in arguments))


def compiled(signature: Any) -> Callable[[Callable], Compiled]:
    """Decorator: compiled for `signature` when it is first called."""
    return lambda function: Compiled(function, signature)
