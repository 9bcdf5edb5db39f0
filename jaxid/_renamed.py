"""Arguments under their earlier names, so that programs written for them go on working."""

import warnings
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


def renamed(**names: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A function's arguments may still be given by the names that they had, with a `DeprecationWarning`: new by old name."""

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def run(*arguments: P.args, **named: P.kwargs) -> R:
            for old in names.keys() & named.keys():
                if names[old] in named:
                    raise TypeError(
                        f"{function.__name__} has {old!r} and {names[old]!r}, which are the same; give one."
                    )
                said = f"{function.__name__}({old}=) is now {names[old]}="
                warnings.warn(said, DeprecationWarning, stacklevel=2)
                named[names[old]] = named.pop(old)
            return function(*arguments, **named)

        return run

    return decorate
