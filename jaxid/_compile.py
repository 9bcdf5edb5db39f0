"""`jax.jit` for jaxid's large programs: with XLA's older CPU fusion code, which compiles them markedly sooner and to
programs that run equally fast (other devices take no notice), and with a way to forget them all: explaining one robot after
another makes hundreds, and they fill the memory."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, cached_property, update_wrapper
from typing import Any

import jax
from jax.extend.core import get_opaque_trace_state

_FASTER_TO_COMPILE = {"xla_cpu_use_fusion_emitters": False}
"""Known to JAX up to 0.11. XLA has no such option, and no older code, from JAX 0.12 on."""


def known_options(options: dict[str, Any]) -> dict[str, Any]:
    """`options` if the installed XLA takes them all, else none: it refuses to compile with an option that it does not know."""
    try:
        jax.jit(lambda: 0, compiler_options=options).lower().compile()
    except jax.errors.JaxRuntimeError:
        return {}
    return options


@cache
def _compiler_options() -> dict[str, Any]:
    return known_options(_FASTER_TO_COMPILE)


_OUTSIDE = get_opaque_trace_state()
"""JAX's state where it traces nothing: asked on import, since the first program may be called while something is traced."""


class Program:
    """`jax.jit(function, **options)` with the compiler's options asked for at the first use, not on import.

    Inside another program that JAX is tracing it is part of that one, which has compiler options of its own.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]):
        update_wrapper(self, function)
        self._function = function
        self._options = options
        self._inner: Any = jax.jit(function, **options)

    @cached_property
    def _outer(self) -> Any:
        return jax.jit(self._function, compiler_options=_compiler_options(), **self._options)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        # What is called while JAX traces is a part of that, whatever the arguments are.
        traced = get_opaque_trace_state() != _OUTSIDE
        return (self._inner if traced else self._outer)(*arguments, **named)

    def lower(self, *arguments: Any, **named: Any) -> Any:
        """As of a function made by `jax.jit`."""
        return self._outer.lower(*arguments, **named)

    def clear_cache(self) -> None:
        """As of a function made by `jax.jit`."""
        self._inner.clear_cache()
        self._outer.clear_cache()


_programs: list[Program] = []


def compiled(function: Callable[..., Any], **options: Any) -> Program:
    """`jax.jit(function, **options)`."""
    program = Program(function, options)
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
