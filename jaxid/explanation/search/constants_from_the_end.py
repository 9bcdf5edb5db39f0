"""Constants of the table that do what an effect does, seen from the model that has it.

The model without the effect has bent to follow what that does: to first order from there, a constant that is wrong by some per
cent promises little. At the model with it all else is right, and what taking it out changes is what constants, and the other
numbers with them, have to give back.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from ...effects.table_constants import TableConstants
from ...logs import LogSet
from ...robots.robot import Robot
from ..refits.refit import Trial
from .constants_to_first_order import likely, secants_of, small_steps

_RANK = 1e-9
"""Share of the largest below which a direction of changes is rounding."""


def models_from_the_end(
    bare: Robot, after: Trial, constants: Sequence[str], noise: Mapping[str, float], logs: LogSet
) -> list[tuple[tuple[str, ...], Robot]]:
    """Sets of `constants` that may do what the effect of `after` does, and for each the `bare` model without that effect with
    these free, at the numbers that give back, to first order, what taking it out of `after` changes."""
    effect, table = after.effect, after.robot.parameters
    if effect is None:
        return []
    nothing = (bare + effect).parameters
    _, secants, _ = secants_of(after.robot, noise, [], constants, logs)
    if not np.isfinite(secants).all():
        return []
    steps = small_steps(after.robot, constants)
    slopes = {name: row / steps[name] for name, row in zip(steps, secants, strict=True)}
    mine = [name for name in table.free_names if name.startswith(effect.key(""))]
    rest = [name for name in table.free_names if name not in mine]
    taken_out = np.zeros(secants.shape[1])
    for name in mine:
        taken_out = taken_out + (nothing[name].value - table[name].value) * slopes[name]
    if not taken_out.any():
        return []
    own = np.array([slopes[name] for name in rest]).reshape(len(rest), len(taken_out))
    sets, _ = likely(own, {name: slopes[name] for name in constants}, taken_out)
    found = []
    for chosen in sets:
        moved = [*rest, *chosen]
        columns = np.array([slopes[name] for name in moved])
        sizes = np.maximum(np.linalg.norm(columns, axis=1), np.finfo(float).tiny)
        by = np.linalg.lstsq((columns / sizes[:, None]).T, -taken_out, rcond=_RANK)[0] / sizes
        robot = bare + TableConstants(chosen)
        values = {n: robot.parameters[n].inside(table[n].value + d) for n, d in zip(moved, by.tolist(), strict=True)}
        found.append((chosen, robot.with_values(**values)))
    return found
