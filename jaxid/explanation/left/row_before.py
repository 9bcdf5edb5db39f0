"""Outputs that were read before the input of their own row was applied, of robots whose outputs hang on it at once.

A motor's current is (voltage - back-EMF) / resistance. A loop that reads it, computes a command, applies that and writes both
into a row has the current of the row before's command, so that every change of the command leaves an error as large as itself.
"""

import jax.numpy as jnp
import numpy as np

from ...logs import LogSet
from ...robots.robot import Robot
from .heldout import HeldOut

_SHARE = 0.6
"""Share of what is left of an output that the changes of the inputs in its own rows explain, from which it is that."""
_FEWEST = 20
"""Changes of the inputs."""


def at_once(robot: Robot) -> tuple[str, ...]:
    """The measured outputs that hang on the inputs of their own row."""
    rest = dict.fromkeys(robot.states, 0.0) | robot.initial_state()
    # As arrays, of which a division by zero is no error.
    state = {name: jnp.asarray(value, float) for name, value in rest.items()}
    still, driven = (
        robot.observe(state, (jnp.asarray(value),) * len(robot.channels.inputs), robot.parameters.numbers)
        for value in (0.0, robot.scales.input)
    )
    names = robot.channels.measured
    return tuple(name for name, a, b in zip(names, still, driven, strict=False) if float(a) != float(b))


def row_before(robot: Robot, logs: LogSet, left: HeldOut) -> str:
    """A sentence on outputs of which the changes of the inputs in their own rows make most of what the model leaves; empty
    where there are none."""
    found = []
    for name in at_once(robot):
        if name not in left.by_channel or left.by_channel[name] < 1.0:
            continue
        changes, residuals = [], []
        for log, residual in zip(logs, left.residuals, strict=True):
            if len(residual) != len(log):
                return ""
            own = residual[1:, list(left.by_channel).index(name)]
            there = np.isfinite(own)
            changes.append(np.diff(log.inputs, axis=0)[there])
            residuals.append(own[there])
        change, residual = np.concatenate(changes), np.concatenate(residuals)
        if np.any(change != 0, axis=1).sum() < _FEWEST:
            continue
        made = change @ np.linalg.lstsq(change, residual, rcond=1e-9)[0]
        if np.sum(made**2) > _SHARE * np.sum(residual**2):
            found.append((name, float(np.sum(made**2) / np.sum(residual**2))))
    if not found:
        return ""
    listed = " and ".join(f"{name} ({share:.0%})" for name, share in found)
    return (
        f"Most of what is left of {listed} is what the inputs' changes in the same rows make: it was read before the row's "
        "input was applied, and belongs to the input of the row before. Move that column one row up."
    )
