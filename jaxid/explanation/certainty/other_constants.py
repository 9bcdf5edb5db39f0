"""Numbers of the robot that hang on other constants of its table, where one of them was found wrong.

A load aboard moves the centre of mass, and is a larger mass, too; a table that is wrong in one place may be so in another. What
another constant does that the fitted parameters make up for, no log tells, and they are off by it.
"""

from collections.abc import Sequence

import numpy as np

from ...estimate.result import Fit
from ...logs import LogSet
from ..refits.refit import Trial
from ..search.table_constants import STEP, Shares, known_constants, secants_of

_UNSEEN = 9.0
"""Chi-squared by which logs do not tell that a constant is wrong."""
_APART = 3.0
"""Standard errors from which a parameter hangs on a constant."""
_MOST = 2
"""Constants, and parameters of each, that are listed."""


def hung_on_other_constants(found: Trial, final: Fit, wrong: Shares, logs: LogSet) -> str:
    """A sentence on the estimates of `final` that would move by more than their errors if other constants of the table were off
    by as much as those that were found `wrong`, and the logs would not tell; empty where there are none."""
    others: Sequence[str] = [name for name in known_constants(found.robot) if name not in wrong]
    if not others or found.angles or found.held_out.diverged:
        return ""
    _, secants, _ = secants_of(found, [], others, logs)
    names, table = found.robot.parameters.free_names, found.robot.parameters
    own, share = secants[: len(names)], max(map(abs, wrong.values()))
    if not np.isfinite(secants).all():
        return ""
    moved: list[tuple[float, str]] = []
    for constant, change in zip(others, secants[len(names) :] * share / STEP, strict=True):
        steps, *_ = np.linalg.lstsq(own.T, -change, rcond=1e-9)
        if np.sum((change + own.T @ steps) ** 2) > _UNSEEN:
            continue
        sizes = [
            step * STEP * (abs(table[n].value) or table[n].typical or 1.0) for n, step in zip(names, steps, strict=True)
        ]
        by = {
            name: abs(size) / final.parameters[name].std_error
            for name, size in zip(names, sizes, strict=True)
            if name in final.parameters and final.parameters[name].std_error > 0
        }
        hung = sorted((name for name, times in by.items() if times > _APART), key=lambda name: -by[name])
        if hung:
            listed = " and ".join(f"{name} by {by[name]:.2g}" for name in hung[:_MOST])
            moved.append((by[hung[0]], f"{constant} off by as much would move {listed} standard errors"))
    if not moved:
        return ""
    listed = "; ".join(words for _, words in sorted(moved, reverse=True)[:_MOST])
    return (
        f"With {' and '.join(wrong)} off by {100 * share:.2g} %, other constants of the table may be, too (a load aboard is "
        f"also a larger mass), and these logs do not tell: {listed}."
    )
