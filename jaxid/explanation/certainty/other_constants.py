"""Other constants of the table, and what hangs on them, where one of them was found wrong.

A load aboard moves the centre of mass, and is a larger mass, too. Where the mass is held, parameters that make up for most of
it leave an error that no test of the whole sees, and are off by many of their standard errors.
"""

from typing import NamedTuple

import numpy as np

from ...estimate.result import Fit
from ...logs import LogSet
from ..refits.refit import Trial
from ..search.constants_to_first_order import known_constants, measure, secants_of, small_steps
from ..search.table_constants import BELIEVABLE, Shares

_LIKELIER = 25.0
"""Drop of chi-squared from which a constant is likelier wrong than right, whichever of a dozen it is: 5 standard errors."""
_ALIKE = 0.25
"""Share of that drop by which others fall behind that may be it as well."""
_APART = 3.0
"""Standard errors from which a parameter hangs on a constant."""
_LISTED = 3


class _Other(NamedTuple):
    """A constant, the `share` of its value by which it would be off, how much chi-squared falls then, and by how many standard
    errors parameters move."""

    name: str
    share: float
    gain: float
    moved: dict[str, float]


def _others(found: Trial, final: Fit, names: list[str], logs: LogSet) -> list[_Other]:
    """What each of the constants `names` would do, to first order, likeliest first."""
    left, secants, _ = secants_of(found.robot, found.held_out.noise, [], names, logs)
    steps, free = small_steps(found.robot, names), found.robot.parameters.free_names
    own, others = secants[: len(free)], secants[len(free) :]
    if not np.isfinite(own).all():
        return []
    every: list[_Other] = []
    for name, change in zip(names, others, strict=True):
        if not np.isfinite(change).all() or not np.any(change):
            continue
        # Beside what the fitted parameters do of it.
        along, *_ = np.linalg.lstsq(own.T, change, rcond=1e-9)
        beyond = change - own.T @ along
        size = float(beyond @ beyond)
        if size <= 1e-12 * float(change @ change):
            continue
        times = -float(beyond @ left) / size
        share, gain = times * steps[name] / measure(name, found.robot), times**2 * size
        errors = {n: final.parameters[n].std_error for n in free if n in final.parameters}
        moved = {
            n: abs(times * a * steps[n]) / errors[n]
            for n, a in zip(free, along, strict=True)
            if errors.get(n, 0.0) > 0.0
        }
        every.append(_Other(name, share, gain, {n: by for n, by in moved.items() if by > _APART}))
    return sorted(every, key=lambda other: -other.gain)


def likelier_constants(found: Trial, final: Fit, wrong: Shares, logs: LogSet) -> str:
    """A sentence on other constants of the table than those found `wrong` that fit the `logs` better off than as they are, and
    on the estimates of `final` that hang on them; empty where there are none."""
    names = [name for name in known_constants(found.robot) if name not in wrong]
    if not names or found.angles or found.held_out.diverged:
        return ""
    every = _others(found, final, names, logs)
    every = [other for other in every if other.gain > _LIKELIER and abs(other.share) < BELIEVABLE]
    alike = [other for other in every if other.gain > (1.0 - _ALIKE) * every[0].gain]
    first = next((other for other in alike if other.moved), None)
    if first is None:
        return ""
    constants = " or ".join(f"{other.name} ({100 * other.share:+.2g} %)" for other in alike[:_LISTED])
    moved = sorted(first.moved, key=lambda name: -first.moved[name])[:_LISTED]
    hung = ", ".join(f"{name} by {first.moved[name]:.2g}" for name in moved)
    return (
        f"{' and '.join(wrong)} is hardly all that is wrong in the table: these logs would rather have {constants} off, too "
        f"(chi-squared lower by {first.gain:.3g}), as where a load is aboard, whose mass is not in it. With {first.name} off, "
        f"parameters move ({hung} standard errors): measure it before they are believed."
    )
