"""`jax.jit` for jaxid's large programs: with XLA's older CPU fusion code, which compiles them markedly sooner and to
programs that run equally fast (other devices take no notice), and with a way to forget them all: explaining one robot after
another makes hundreds, and they fill the memory."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import jax

_programs: list[Any] = []


def compiled(function: Callable[..., Any], **options: Any) -> Any:
    """`jax.jit(function, **options)`."""
    program = jax.jit(function, compiler_options={"xla_cpu_use_fusion_emitters": False}, **options)
    _programs.append(program)
    return program


def forget_programs() -> None:
    """Give back the memory of all programs compiled so far; they are compiled again when they are needed."""
    for program in _programs:
        program.clear_cache()


_SELDOM = 50_000


@contextmanager
def seldom_collected() -> Iterator[None]:
    """Inside, as a block or around a function (`@seldom_collected()`), Python looks for garbage less often.

    Tracing makes millions of small objects, and going through them every few hundred takes a fifth of the time.
    """
    before = gc.get_threshold()
    if before[0]:  # zero: the user has turned it off
        gc.set_threshold(max(before[0], _SELDOM), *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)
