"""What the numbers take for granted: constants of the table whose small errors no log would show.

Standard errors say how well the logs determine a parameter where the table is right. A mass, a winding or a radius is seldom
known to better than a per cent, and beside a curve of what the motors lose, say, nothing else tells how strong they are.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...estimate.result import Fit
from ...logs import LogSet
from ..search.constants_to_first_order import known_constants, measure, secants_of, small_steps

_STEP = 1e-8
"""Share of a number by which it is moved: beside hardly any noise, what larger steps bend, or shift of when a robot comes to
rest, would pass for something that shows."""
_OFF = 0.01
"""Share of its value by which a constant is off that is asked about."""
_SHOWN = 9.0
"""Rise of chi-squared from which logs with white noise show that: 3 standard errors."""
_APART = 3.0
"""Standard errors of a parameter from which it hangs on a constant."""
_SAME_WAY = 0.99
"""Cosine between what two constants do to the parameters from which they do the same."""
_LISTED, _GROUPS = 3, 2
"""Parameters that are listed of each, and constants of which it is said, those first on which a parameter hangs most."""
Array = NDArray[np.float64]


class _Hung(NamedTuple):
    """By how many standard errors some parameters move with a constant, and what they would be, in words."""

    most: float
    constant: str
    what: str
    way: np.ndarray
    """By how many standard errors each of the parameters [n] moves, of length one."""


def _larger_than_white(
    final: Fit, own: Sequence[str], free: Sequence[str], fitted: Array, steps: Mapping[str, float]
) -> float:
    """By how much more the noise hides than white noise of its size would: the variances of the parameters `own` over what
    their slopes `fitted` [free, samples], per step, would make them; one or more. Coloured noise is large where motion is
    slow."""
    sizes = np.linalg.norm(fitted, axis=1)
    scaled = fitted / sizes[:, None]
    variances = np.diag(np.linalg.pinv(scaled @ scaled.T, rcond=1e-12, hermitian=True))
    white = {n: abs(steps[n]) * np.sqrt(v) / size for n, v, size in zip(free, variances, sizes, strict=True)}
    ratios = [(final[n].std_error / white[n]) ** 2 for n in own if white.get(n, 0.0) > 0]
    ratios = [ratio for ratio in ratios if np.isfinite(ratio)]
    return max(1.0, float(np.median(ratios))) if ratios else 1.0


def taken_for_granted(final: Fit, logs: LogSet, noise: Mapping[str, float]) -> str:
    """A sentence on the parameters of the robot that would be others, by more than their standard errors say, with constants of
    the table off by so little that the `logs` would not show it; empty where there are none."""
    robot = final.robot
    names = [n for n in known_constants(robot) if n not in final.parameters or final[n].status == "fixed"]
    own = [n for n in final.free_names if "." not in n and final[n].status in ("identified", "at_bound")]
    if not names or not own:
        return ""
    _, secants, _ = secants_of(robot, noise, [], names, logs, _STEP)
    free, steps = robot.parameters.free_names, small_steps(robot, names, _STEP)
    fitted, constants = secants[: len(free)], secants[len(free) :]
    if not np.isfinite(secants).all():
        return ""
    sizes = np.linalg.norm(fitted, axis=1)
    kept = [k for k in range(len(free)) if sizes[k] > 0]
    shown = _SHOWN * _larger_than_white(final, own, [free[k] for k in kept], fitted[kept], steps)
    hung: list[_Hung] = []
    for name, change in zip(names, constants, strict=True):
        change = change * (_OFF * measure(name, robot) / steps[name])
        along, *_ = np.linalg.lstsq((fitted[kept] / sizes[kept][:, None]).T, change, rcond=1e-9)
        beyond = change - along @ (fitted[kept] / sizes[kept][:, None])
        if beyond @ beyond > shown:
            continue
        moved = {free[k]: -a / sizes[k] * steps[free[k]] for k, a in zip(kept, along, strict=True)}
        errors = {n: moved[n] / final[n].std_error for n in own if n in moved and final[n].std_error > 0}
        worst = sorted((n for n in errors if abs(errors[n]) > _APART), key=lambda n: -abs(errors[n]))[:_LISTED]
        if not worst:
            continue
        # The way in which the first of them grows, so that constants that do the same are said together.
        way = float(np.sign(moved[worst[0]]))
        what = ", ".join(
            f"{n} {final[n].value + way * moved[n]:.4g} instead of {final[n].value:.4g} {final[n].unit}".rstrip()
            for n in worst
        )
        vector = way * np.array([errors.get(n, 0.0) for n in own])
        constant = f"{name} {'larger' if way > 0 else 'smaller'}"
        hung.append(_Hung(abs(errors[worst[0]]), constant, what, vector / np.linalg.norm(vector)))
    groups: list[list[_Hung]] = []
    for one in sorted(hung, key=lambda one: -one.most):
        same = (group for group in groups if float(group[0].way @ one.way) > _SAME_WAY)
        group = next(same, None)
        groups.append([one]) if group is None else group.append(one)
    said = [
        f"with {first.constant} by {100 * _OFF:.2g} %, {first.what}"
        + (f" ({' or '.join(own.constant for own in rest)} does the same, by as much or less)" if rest else "")
        for first, *rest in groups[:_GROUPS]
    ]
    if not said:
        return ""
    rest = [own.constant.rsplit(" ", 1)[0] for group in groups[_GROUPS:] for own in group]
    more = f"; and so would, by more than standard errors say, errors of {', '.join(rest)}" if rest else ""
    return f"Errors of a per cent in the table, which these logs would not show, would move: {'; '.join(said)}{more}."
