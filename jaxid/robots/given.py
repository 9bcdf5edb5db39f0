"""What an estimator is given, looked at before it works: a robot, logs of that robot, and words that choose."""

import inspect
from collections.abc import Iterable
from typing import Any, get_args

from ..logs import Log, LogError, LogSet
from ..parameters import ParameterError
from .closed_loop import Controller, Law
from .effect import Effect
from .robot import Robot
from .wheel_angles import measuring_angles


def _called(given: Any, called: str, wanted: str) -> Any:
    """What a function of no arguments returns, which a user names `called`; `wanted` is what to give instead. Raises
    `TypeError` where it needs arguments or fails."""
    try:
        inspect.signature(given).bind()
    except (TypeError, ValueError) as error:
        raise TypeError(
            f"{called} cannot be called without arguments ({error}); give {wanted} or a function of none."
        ) from None
    try:
        return given()
    except Exception as error:
        raise TypeError(f"{called} fails ({type(error).__name__}: {error}); correct it there.") from error


def robot_of(given: Any, called: str) -> Robot:
    """What a user names `called` as a robot: that robot, or what a function of no arguments returns. Raises `TypeError`
    for anything else."""
    if not isinstance(given, Robot) and callable(given):
        given = _called(given, called, "a Robot")
    if not isinstance(given, Robot):
        raise TypeError(f"{called} is a {type(given).__name__}, no robot; give a Robot or a function that returns one.")
    return given


def effects_of(given: Any, called: str) -> tuple[Effect, ...]:
    """What a user names `called` as effects: an `Effect` or several, each with an `id`, or a class or function of no
    arguments that makes them. Raises `TypeError` for anything else."""
    if not isinstance(given, Effect) and callable(given):
        given = _called(given, called, "an Effect")
    found = (given,) if isinstance(given, Effect) else given
    if isinstance(found, str) or not isinstance(found, Iterable):
        raise TypeError(f"{called} is a {type(given).__name__}, no effect; give an Effect or a list of them.")
    made: list[Any] = [e() if isinstance(e, type) and issubclass(e, Effect) else e for e in found]
    if not made:
        raise TypeError(f"{called} is empty; put at least one Effect into it, or leave it out.")
    for place, effect in enumerate(made):
        if not isinstance(effect, Effect):
            raise TypeError(f"{called} has {effect!r:.60} in place {place}, which is no Effect; take it out.")
        if not effect.id:
            raise TypeError(f"{called}: {type(effect).__name__} has no id; give the class one, such as id = 'wind'.")
        if any((effect.id, effect.law) == (other.id, other.law) for other in made[:place]):
            raise TypeError(
                f"{called} has two effects {effect.id!r}; give each its own id, or laws of one id their own law."
            )
    return tuple(made)


def controller_of(given: Any, called: str) -> Controller | Law:
    """What a user names `called` as a controller. Raises `TypeError` for what is neither a `Controller` nor a law."""
    if isinstance(given, Controller) or callable(given):
        return given
    raise TypeError(f"{called} is a {type(given).__name__}, no controller; give a Controller or a function.")


def check_given(robot: Any, logs: Any) -> None:
    """Raise `TypeError` for what is no robot or no logs, and `LogError` for logs of another robot, with the remedy."""
    if not isinstance(robot, Robot):
        called = f"{robot.__name__}()" if isinstance(robot, type) else "jaxid.Pioneer()"
        raise TypeError(f"{robot!r:.60} is no robot; give an object such as {called}.")
    if isinstance(logs, Log):
        raise TypeError(f"{logs.name} is a single log; give LogSet([log]).")
    if isinstance(logs, str) or not isinstance(logs, Iterable):
        raise TypeError(f"{logs!r:.60} is no set of logs; give what read_logs returns, or LogSet([...]).")
    for log in logs if isinstance(logs, LogSet) else ():
        if (log.channels.inputs, log.channels.measured) != (robot.channels.inputs, robot.channels.measured):
            measured = log.channels.inputs, log.channels.measured
            others = {
                "robot.for_columns(logs[0].measured), which measures what they hold": robot.for_columns(log.measured),
                "that with wheel_angles=True": measuring_angles(robot),
            }
            fit = [said for said, o in others.items() if (o.channels.inputs, o.channels.measured) == measured]
            remedy = fit[0] if fit else "the robot of these logs"
            raise LogError(
                f"{log.name} has the columns {list(log.channels)} and the robot {robot.name!r} has "
                f"{list(robot.channels)}; give logs of this robot, or {remedy}."
            )


def given_logs(robot: Any, logs: Any) -> LogSet:
    """The logs as a set, of any sequence of them; errors as of `check_given`."""
    check_given(robot, logs)
    if not isinstance(logs, LogSet):
        check_given(robot, logs := LogSet(logs))
    return logs


def check_free(robot: Robot) -> None:
    """Raise `ParameterError` if no parameter of the robot is free: there is nothing to estimate."""
    if not robot.parameters.free_names:
        first = next(iter(robot.parameters), "name")
        raise ParameterError(f"no parameter is free; free at least one (`robot.change({first!r}, free=True)`)")


def check_choice(what: str, value: Any, choices: Any) -> None:
    """Raise `ValueError` if `value` is none of `choices`, a `Literal` type."""
    if value not in get_args(choices):
        raise ValueError(f"{what} = {value!r} is no choice; use one of {', '.join(map(repr, get_args(choices)))}.")
