"""Outputs that were read before the input of their own row was applied, of robots whose outputs hang on it at once.

A motor's current is (voltage - back-EMF) / resistance. A loop that reads it, computes a command, applies that and writes both
into a row has the current of the row before's command, so that every change of the command leaves an error as large as itself,
or, as of the yaw rate of a car that is steered at once, as large as its change times a speed.
"""

import jax.numpy as jnp
import numpy as np

from ...logs import LogSet
from ...robots.robot import Robot
from .heldout import HeldOut

_SHARE = 0.6
"""Share of what is left of an output that the changes of the inputs in its own rows explain, from which it is that."""
_MOVED = 0.7
"""By how much every state is another one where the robot moves."""
_FEWEST, _EACH = 20, 5
"""Changes of the inputs, and so many for every way in which they may count."""


def at_once(robot: Robot) -> tuple[str, ...]:
    """The measured outputs that hang on the inputs of their own row."""
    rest = dict.fromkeys(robot.states, 0.0) | robot.initial_state()
    found: set[str] = set()
    for moved in (0.0, _MOVED):  # a car that stands does not turn, however it is steered
        # As arrays, of which a division by zero is no error.
        state = {name: jnp.asarray(value + moved, float) for name, value in rest.items()}
        still, driven = (
            robot.observe(state, (jnp.asarray(value),) * len(robot.channels.inputs), robot.parameters.numbers)
            for value in (0.0, robot.scales.input)
        )
        seen = zip(robot.channels.measured, still, driven, strict=False)
        found |= {name for name, a, b in seen if float(a) != float(b)}
    return tuple(name for name in robot.channels.measured if name in found)


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
            change = np.diff(log.inputs, axis=0)
            # Times what else was measured; what was not counts as none.
            others = [np.nan_to_num(log.output(other)[1:, None]) for other in log.measured if other != name]
            changes.append(np.concatenate([change, *(change * other for other in others)], axis=1)[there])
            residuals.append(own[there])
        change, residual = np.concatenate(changes), np.concatenate(residuals)
        size = np.sqrt(np.mean(change**2, axis=0)) if len(change) else np.zeros(0)
        change = change[:, size > 0] / size[size > 0]
        if np.any(change != 0, axis=1).sum() < max(_FEWEST, _EACH * change.shape[1]):
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
