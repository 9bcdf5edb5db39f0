"""`jax.jit` for jaxid's large programs: with XLA's older CPU fusion code, which compiles them markedly sooner and to
programs that run equally fast (other devices take no notice), and with a way to forget them all: explaining one robot after
another makes hundreds, and they fill the memory."""

from collections.abc import Callable
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
