"""The law of a controller on what was measured, against the commands that were logged: is it the law that ran?

Without any model of the robot: a law that is given the columns that it saw gives the commands that it gave.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .._float64 import in_float64
from ..logs import Log, LogSet
from .closed_loop import Controller
from .robot import Robot

_ANOTHER = 0.005
"""Difference of the commands (RMS), as a share of what they vary by, from which it is another law."""
_FEW, _ENOUGH = 20, 3
"""Rows below which a log says little, and logs that say enough."""


class Replayed(NamedTuple):
    """The `command` that differs most from the logged one and by how much of it (RMS, as a `share` of what it varies by)."""

    command: str
    share: float

    @property
    def sentence(self) -> str:
        """What that means; empty where it is the law that ran."""
        if not self.share > _ANOTHER:
            return ""
        return (
            f"The controller's law, run on the logged reference and measurements, commands another {self.command} than was "
            f"logged, by {100 * self.share:.2g} % of what that varies by (RMS): it has other gains, limits or another "
            "rate than the one that ran, or saw other measurements than these (`Controller(fitted=False)` is for those)."
        )


@in_float64
def replayed(robot: Robot, logs: LogSet, controller: Controller) -> Replayed | None:
    """How far the law's commands on the robot's `logs` are from theirs, by the first of these that hold all that it saw, in
    every row; None where none does, and where its gains are estimated or other commands are known to have been logged."""
    if not controller.fitted or any(parameter.free for parameter in controller.parameters.values()):
        return None
    names, differences = robot.channels.inputs, list[np.ndarray]()
    whole = [log for log in logs if len(log) >= _FEW and _complete(log, robot, controller)][:_ENOUGH]
    if not whole:
        return None
    for log in whole:
        differences.append(_commands(robot, log, controller) - log.inputs)
    size = np.sqrt(np.mean(np.concatenate(differences) ** 2, axis=0))
    varies = np.std(np.concatenate([log.inputs for log in whole]), axis=0)
    share = np.divide(size, varies, out=np.zeros_like(size), where=varies > 0)
    worst = int(np.argmax(share))
    return Replayed(names[worst], float(share[worst])) if np.isfinite(share[worst]) else None


def _complete(log: Log, robot: Robot, controller: Controller) -> bool:
    there = [log.output(name) for name in robot.channels.outputs]
    there += [log.extra[name] for name in controller.reference]
    return all(np.isfinite(np.asarray(column, float)).all() for column in (*there, *log.inputs.T))


def _commands(robot: Robot, log: Log, controller: Controller) -> np.ndarray:
    """What the law commands [T, nu] row by row."""
    numbers = {**robot.parameters.numbers, **{name: p.value for name, p in controller.parameters.items()}}
    measured = {name: jnp.nan_to_num(jnp.asarray(log.output(name))) for name in robot.channels.measured}
    reference = {name: jnp.asarray(np.asarray(log.extra[name], float)) for name in controller.reference}
    start = {name: jnp.asarray(float(controller.start.get(name, 0.0))) for name in controller.states}

    def row(state, seen):
        found = controller.law(seen[0], seen[1], state, numbers)
        commands, after = found if isinstance(found, tuple) else (found, {})
        kept = {name: jnp.asarray(after[name], float) for name in state}
        return kept, jnp.stack([jnp.asarray(commands[name], float) for name in robot.channels.inputs])

    return np.asarray(jax.lax.scan(row, start, (reference, measured))[1])
