"""What an estimator is given, looked at before it works: a robot, logs of that robot, and words that choose."""

import inspect
from collections.abc import Iterable
from typing import Any, get_args

from ..logs import Log, LogError, LogSet
from ..parameters import ParameterError
from .closed_loop import Controller, Law
from .robot import Robot


def robot_of(given: Any, called: str) -> Robot:
    """What a user names `called` as a robot: that robot, or what a function of no arguments returns. Raises `TypeError`
    for anything else."""
    if not isinstance(given, Robot) and callable(given):
        try:
            inspect.signature(given).bind()
        except (TypeError, ValueError) as error:
            raise TypeError(
                f"{called} cannot be called without arguments ({error}); give a Robot or a function of none."
            ) from None
        try:
            given = given()
        except Exception as error:
            raise TypeError(f"{called} fails ({type(error).__name__}: {error}); correct it there.") from error
    if not isinstance(given, Robot):
        raise TypeError(f"{called} is a {type(given).__name__}, no robot; give a Robot or a function that returns one.")
    return given


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
            raise LogError(
                f"{log.name} has the columns {list(log.channels)} and the robot {robot.name!r} has "
                f"{list(robot.channels)}; give logs of this robot, or the robot of these logs."
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
        raise ParameterError("no parameter is free; free at least one (`robot.change('Cs', free=True)`)")


def check_choice(what: str, value: Any, choices: Any) -> None:
    """Raise `ValueError` if `value` is none of `choices`, a `Literal` type."""
    if value not in get_args(choices):
        raise ValueError(f"{what} = {value!r} is no choice; use one of {', '.join(map(repr, get_args(choices)))}.")
