"""How often a complete model may be called incomplete: one number, which whoever asks for an explanation sets.

Every state that is judged within `at_level` keeps it (`HeldOut.false_alarm`), so that whatever is decided of that state is
decided at that level.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


FALSE_ALARM = 0.01
"""Share of complete models that are called incomplete, where nobody asks for another."""
_level: ContextVar[float] = ContextVar("false_alarm", default=FALSE_ALARM)


def current_level() -> float:
    """The level that holds here."""
    return _level.get()


def checked_level(false_alarm: float) -> float:
    """The same number. Raises `ValueError` for one that is no share below a half."""
    if not 0.0 < false_alarm < 0.5:
        raise ValueError(
            f"false_alarm is {false_alarm!r}; give the share of complete models that may be called incomplete, such as 0.01."
        )
    return float(false_alarm)


@contextmanager
def at_level(false_alarm: float) -> Iterator[None]:
    """Within, a complete model is called incomplete this often. Raises `ValueError` as `checked_level` does."""
    token = _level.set(checked_level(false_alarm))
    try:
        yield
    finally:
        _level.reset(token)


def keeps_level(function: Callable[P, R]) -> Callable[P, R]:
    """The function, run `at_level` of its keyword argument `false_alarm`."""

    @wraps(function)
    def run(*arguments: P.args, **options: P.kwargs) -> R:
        false_alarm: Any = options.get("false_alarm", FALSE_ALARM)
        with at_level(false_alarm):
            return function(*arguments, **options)

    return run
