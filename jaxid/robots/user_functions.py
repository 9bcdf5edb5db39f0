"""A user's functions are tried once, on symbols instead of numbers, before anything is fitted: what they get wrong is said in a
sentence with file and line, not in a traceback out of a compiled program."""

import traceback
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from .._float64 import in_float64
from ..parameters import ParameterError

_NOT_TRACEABLE = (
    jax.errors.TracerBoolConversionError,
    jax.errors.TracerArrayConversionError,
    jax.errors.ConcretizationTypeError,
    jax.errors.TracerIntegerConversionError,
)


class UserFunctions(NamedTuple):
    """What is tried: the functions, and the names that they get and must return. `axes` is None for dynamics that take no
    friction."""

    dynamics: Callable[..., Any]
    output: Callable[..., Any] | None
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    measured: tuple[str, ...]
    parameters: tuple[str, ...]
    axes: tuple[str, ...] | None


class _Named(dict):
    """A mapping whose missing names are told in a sentence."""

    def __init__(self, kind: str, values: Mapping[str, Any]):
        super().__init__(values)
        self.kind = kind

    def __missing__(self, name: str) -> Any:
        raise ParameterError(f"{self.kind} {name!r}, which does not exist; there are {', '.join(self) or 'none'}")


def _place(error: BaseException, function: Callable[..., Any]) -> str:
    """File and line of the user's function at which it failed."""
    file = getattr(getattr(function, "__code__", None), "co_filename", None)
    lines = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return f" at {lines[-1].filename}:{lines[-1].lineno}" if lines else ""


def _tried(what: str, function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
    try:
        return function(*arguments)
    except ParameterError as error:
        raise ParameterError(f"{what} of the robot ask{_place(error, function)} for {error}") from None
    except _NOT_TRACEABLE as error:
        raise ParameterError(
            f"{what} of the robot cannot be differentiated{_place(error, function)}: a number of the simulation is asked "
            "for before there is one; write jnp.where(condition, a, b) for `if`, jax.numpy for numpy and math functions, "
            "and no float() or int()"
        ) from None
    except Exception as error:
        raise ParameterError(
            f"{what} of the robot fail{_place(error, function)} ({type(error).__name__}: {error}); they take "
            f"{len(arguments)} mappings by name and return one"
        ) from None


def _mapping(what: str, found: Any, needed: Sequence[str], of: str, others_allowed: bool) -> dict[str, jax.Array]:
    """The values returned, as scalars."""
    if not isinstance(found, Mapping):
        raise ParameterError(
            f"{what} of the robot return a {type(found).__name__}; return a mapping from the names of {of} to numbers"
        )
    missing = [name for name in needed if name not in found]
    if missing:
        raise ParameterError(f"{what} of the robot return nothing for {missing[0]!r}; every one of {of} needs a value")
    unknown = [] if others_allowed else [str(name) for name in found if name not in needed]
    if unknown:
        raise ParameterError(
            f"{what} of the robot return a value for {unknown[0]!r}, which is none of {of} ({', '.join(needed)}); it would "
            "be lost"
        )
    for name in needed:
        shape = jnp.shape(found[name])
        if shape != ():
            raise ParameterError(
                f"{what} of the robot return an array of shape {shape} for {name!r}; return a single number"
            )
    return {name: jnp.asarray(found[name], float) for name in needed}


@cache
def _check(functions: UserFunctions) -> None:
    own = functions

    def traced(state, given, p, friction):
        named = _Named("a state", state), _Named("an input", given), _Named("a parameter", p)
        arguments = named if own.axes is None else (*named, _Named("the friction of an axis", friction))
        rates = _mapping(
            "the dynamics", _tried("the dynamics", own.dynamics, arguments), own.states, "the states", False
        )
        if own.output is None:
            return rates
        seen = _tried("the outputs", own.output, named)
        return rates | _mapping("the outputs", seen, own.measured, "the measured channels", True)

    def symbols(names):
        return {name: jax.ShapeDtypeStruct((), float) for name in names}

    groups = (own.states, own.inputs, own.parameters, own.axes or ())
    closed = jax.make_jaxpr(traced)(*map(symbols, groups))
    names = sorted(own.states), sorted(own.inputs), sorted(own.parameters), sorted(own.axes or ())
    flat = [(kind, name) for kind, some in enumerate(names) for name in some]
    used = {id(v) for equation in closed.jaxpr.eqns for v in equation.invars} | {id(v) for v in closed.jaxpr.outvars}
    for variable, (kind, name) in zip(closed.jaxpr.invars, flat, strict=True):
        if kind == 3 and id(variable) not in used:
            raise ParameterError(
                f"the dynamics of the robot never use the friction of axis {name!r}, so that nothing would rub; subtract it "
                "from the force, or leave the axis out"
            )


@in_float64
def check_user_functions(functions: UserFunctions) -> None:
    """Raise `ParameterError` where the functions do not fit the names, or cannot be traced by JAX."""
    _check(functions)
