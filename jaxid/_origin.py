"""Where a result came from: the function that returned it, its arguments, the logs by their hashes, and the versions of what
computed it. With the logs at hand, that is enough to compute it again.
"""

import inspect
import logging
import platform
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, is_dataclass, replace
from functools import cache, partial, wraps
from importlib.metadata import PackageNotFoundError, version
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
_PACKAGES = (
    "jaxid-robots",
    "jax",
    "jaxlib",
    "equinox",
    "optimistix",
    "lineax",
    "numpy",
    "scipy",
    "llvmlite",
    "blackjax",
)
_LEFT_OUT = ("report", "solver")
"""Arguments that say how to work and not on what."""


@dataclass(frozen=True)
class LogHash:
    """A log that was used: its `name`, the SHA-256 of its content (`Log.sha256`), the file it was read from, its samples."""

    name: str
    sha256: str
    source: str
    samples: int


@dataclass(frozen=True)
class Origin:
    """How a result was computed.

    - `function`: its public name, such as "output_error"; `arguments`: what it was given, defaults and seeds included, but
      for logs and functions.
    - `logs`: those it was given, by argument (those of a fleet: by argument and member).
    - `versions`: of Python and of the packages that took part.
    """

    function: str
    arguments: dict[str, Any]
    logs: dict[str, tuple[LogHash, ...]]
    versions: dict[str, str]

    def __repr__(self) -> str:
        named = [f"  {argument}: {log.name}, {log.samples} samples, sha256 {log.sha256[:12]}..."
                 for argument, own in self.logs.items() for log in own]  # fmt: skip
        plain = {k: v for k, v in self.arguments.items() if isinstance(v, str | int | float | bool) and v is not None}
        options = ", ".join(f"{name}={value!r}" for name, value in plain.items())
        used = ", ".join(f"{name} {number}" for name, number in self.versions.items())
        return "\n".join([f"Computed by jaxid.{self.function}({options}) of", *named, f"  with {used}"])

    def differences(self, **logs: Iterable[Any] | Mapping[str, Iterable[Any]]) -> tuple[str, ...]:
        """What is not the same in `logs` (by argument, such as `logs=` or `held_out=`; of a fleet by member) as when the result
        was computed.

        A sentence for every log that is missing, that is new, or whose content differs; none where the result was computed
        from just these.
        """
        found, given = list[str](), dict[str, Iterable[Any]]()
        for argument, own in logs.items():
            if isinstance(own, Mapping):
                members = {f"{argument}: {member}": several for member, several in own.items()}
                then = [of for of in self.logs if of.startswith(f"{argument}: ")]
                found += [f"{of} is missing." for of in then if of not in members]
                given |= members
            else:
                given[argument] = own
        for argument, own in given.items():
            now = {log.name: log.sha256 for log in own}
            then = {log.name: log for log in self.logs.get(argument, ())}
            found += [f"{argument}: {name} is missing." for name in then if name not in now]
            found += [f"{argument}: {name} was not used." for name in now if name not in then]
            found += [
                f"{argument}: {name} has another content than when it was used (it was read from {log.source or 'memory'})."
                for name, log in then.items()
                if name in now and now[name] != log.sha256
            ]
        return tuple(found)


@cache
def versions() -> dict[str, str]:
    """Versions of Python and of the packages that compute, those that are installed."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name.removesuffix("-robots")] = version(name)
        except PackageNotFoundError:
            continue
    return found


def _is_log(value: Any) -> bool:
    return hasattr(type(value), "sha256") and hasattr(value, "channels")  # and not `LogHash`


def _hashes(value: Any) -> tuple[LogHash, ...]:
    """The hashes of a log or of several; none for anything else."""
    several = (
        (value,) if _is_log(value) else value if hasattr(value, "channels") or type(value) in (list, tuple) else ()
    )
    if not isinstance(several, Iterable) or not all(map(_is_log, several)):
        return ()
    return tuple(LogHash(log.name, log.sha256, log.source, len(log)) for log in several)


def _logs_of(arguments: Mapping[str, Any]) -> dict[str, tuple[LogHash, ...]]:
    found = {}
    for name, value in arguments.items():
        if isinstance(value, Mapping):
            found |= {f"{name}: {member}": own for member, logs in value.items() if (own := _hashes(logs))}
        elif own := _hashes(value):
            found[name] = own
    return found


def _kept(name: str, value: Any) -> bool:
    """Whether an argument is kept as it is: neither logs nor what only says how to work."""
    inside = value.values() if isinstance(value, Mapping) else (value,)
    function = callable(value) and not is_dataclass(value)
    return name not in _LEFT_OUT and not function and not any(_hashes(own) for own in inside)


def with_origin(function: Callable[P, R]) -> Callable[P, R]:
    """The same function; the result, a dataclass with a field `origin`, remembers how it was computed.

    What a function that takes a `report` is doing goes to the logger of its name, such as `jaxid.explain`, where the caller
    has given none.
    """
    signature = inspect.signature(function)
    logger = logging.getLogger(f"jaxid.{function.__name__}") if "report" in signature.parameters else None

    @wraps(function)
    def run(*arguments: P.args, **named: P.kwargs) -> R:
        if logger is not None and logger.isEnabledFor(logging.INFO):
            if "report" not in signature.bind_partial(*arguments, **named).arguments:
                named["report"] = partial(logger.info, "%s")
        result: Any = function(*arguments, **named)
        bound = signature.bind(*arguments, **named)
        bound.apply_defaults()
        given = bound.arguments | bound.arguments.get("options", {})
        given.pop("options", None)
        kept = {name: value for name, value in given.items() if _kept(name, value)}
        return replace(result, origin=Origin(function.__name__, kept, _logs_of(given), versions()))

    return run
