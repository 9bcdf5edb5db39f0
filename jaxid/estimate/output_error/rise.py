"""Does the cost rise around the optimum as the standard errors promise?

A standard error is the curvature of the cost at the optimum. Where dry friction sticks, the cost has kinks: it can rise
steeply towards one side, where the simulated robot begins to creep, and not at all towards the other, where it sticks all
the same. Such data bounds a parameter from one side, whatever the curvature says. So the cost is looked at three standard
errors off on either side along every principal direction of the covariance; there it must have risen by about 4.5 (half
chi-squared). Where it has not, each parameter that takes part is held three of its standard errors off and the others are
fitted anew: what the cost has risen by then is the profile, and a profile that hardly rises there, or ten standard
errors off, is proof. Where the cost falls, the optimum was none.

All of this is in units of what chance makes of the cost. Of a residual whose neighbours go together that is more, by their
long-run variance: of what a wrong model leaves of ten thousands of samples the standard errors for white noise are so small
that the cost's roughness hides every rise, and each parameter would be asked for its profile in vain.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..result import Estimate, Fit
from .evaluation import cost_at, costs_at
from .from_optimum import AtBounds, known_spread
from .long_run import long_run_at
from .optimum import Optimum
from .problem import Problem, Structure, Unknowns, holding, parameters_at
from .solvers import minimise_compiled

_OFF = 3.0
"""Standard errors at which the cost is looked at."""
_LITTLE = {_OFF: 0.2, 10.0: 0.1}
"""By distance in standard errors, share of the promised rise below which the data bounds nothing on that side."""
_DOUBTFUL = 0.7
"""The same along a principal direction, below which profiles are asked."""
_PART = 0.1
"""Share of a parameter's standard error that a direction must make up for the parameter to take part in it."""
_STEPS, _WITHIN = 20, 0.01
"""Of the search for a profile: steps at most, and share of the promised rise to which it is asked for."""
_TWICE = 2.0
"""How often a promised drop may come before the search for a profile ends: a kink may give more than is promised."""
_TELLING = 1.0
"""Promised rise below which there is nothing to be asked: a bound is in the way."""
_MOST = 24
"""Profiles from which no more are asked for parameters of effects, among them the heights of dense curves: a profile of every
one takes longer than the fit."""
_LOWER = 0.5
"""Fall of the cost (half chi-squared) from which a point near the optimum is a better start than the optimum."""


class Flat(NamedTuple):
    """A parameter towards whose `side` (+1 larger, -1 smaller values) the cost rises by `found` where `promised` is due."""

    side: int
    found: float
    promised: float


class Rise(NamedTuple):
    """`flat` sides by parameter; `lower`: a point nearby whose cost is noticeably below the optimum's, if one was met."""

    flat: dict[str, list[Flat]]
    lower: Unknowns | None


def _following(inner: Optimum, step: NDArray[np.float64]) -> NDArray[np.float64]:
    """Change [E, s] of the initial states that follows a step [n] of the parameters."""
    local, crossed = np.asarray(inner.triangle.local), np.asarray(inner.triangle.crossed)
    return np.stack([-np.linalg.pinv(own) @ (across @ step) for own, across in zip(local, crossed, strict=True)])


def _profile(
    structure: Structure, problem: Problem, at: Unknowns, k: int, within: float, clearly: float
) -> tuple[float, Unknowns]:
    """Cost, `within` what a linearisation promises, and place of the minimum over all parameters but the k-th, which stays
    where it is; or of where the search was when it was clear that the minimum lies above the cost `clearly`."""
    held = holding(problem, k, np.asarray(parameters_at(problem, at.z))[k])

    def enough(cost: float, promise: float) -> bool:
        return promise <= within or cost - _TWICE * promise >= clearly

    found = minimise_compiled(structure, held, at, max_steps=_STEPS, until=enough)
    cost = float(found.cost)
    z = np.array(found.unknowns.z)
    z[k] = at.z[k]
    return (cost, found.unknowns._replace(z=z)) if np.isfinite(cost) else (np.inf, at)


def rise(structure: Structure, problem: Problem, inner: Optimum, bounded: AtBounds) -> Rise:
    """The cost around the optimum `bounded`; `inner` is the same with every parameter free. Call under float64."""
    theta = parameters_at(bounded.problem, bounded.optimum.unknowns.z)
    begin = np.asarray(problem.bounds.coordinates(theta))
    states = np.asarray(bounded.optimum.unknowns.states)
    slope, triangle = np.asarray(problem.bounds.slope(inner.unknowns.z)), np.asarray(inner.triangle.shared)
    found = known_spread(problem, inner)
    covariance = found.covariance / np.outer(slope, slope)
    errors = np.sqrt(np.diag(covariance))
    asked = found.determined & ~bounded.at_bound & (errors > 0)
    here = Unknowns(np.asarray(begin), np.asarray(states))
    base, chance = cost_at(structure, problem, here), long_run_at(structure, problem, here)
    far = float(np.sqrt(chance))
    flat: dict[str, list[Flat]] = {}
    lowest, lower = base - _LOWER * chance, None

    def off(step: NDArray[np.float64]) -> tuple[Unknowns, float]:
        """Where a step leads that does not leave the bounds, and by how much the cost should rise."""
        z = problem.bounds.coordinates(problem.bounds.physical(np.asarray(begin + step)))
        inside = np.asarray(z) - begin
        at = Unknowns(z, np.asarray(states + _following(inner, inside) if states.size else states))
        return at, 0.5 * float(np.sum((triangle @ inside) ** 2))

    directions = [side * direction for direction in _principal(covariance, errors).T for side in (-1, 1)]
    around = [(direction, *off(far * _OFF * direction)) for direction in directions]
    around = [one for one in around if one[2] > _TELLING * chance]
    costs = costs_at(structure, problem, [at for _, at, _ in around]) if around else ()
    doubtful: set[tuple[int, int]] = set()
    for (direction, at, promised), cost in zip(around, costs, strict=True):
        if cost - base < _DOUBTFUL * promised:
            part = direction / np.where(errors > 0, errors, np.inf)
            doubtful |= {(int(k), int(np.sign(part[k]))) for k in np.flatnonzero(asked & (np.abs(part) > _PART))}
        if cost < lowest:
            lowest, lower = float(cost), at
    robots = sorted(one for one in doubtful if "." not in structure.names[one[0]])
    effects = sorted(doubtful.difference(robots))[: max(0, _MOST - len(robots))]
    for k, side in (*robots, *effects):
        for distance, little in _LITTLE.items():
            at, _ = off(side * far * distance * covariance[:, k] / errors[k])
            promised = 0.5 * float((at.z[k] - begin[k]) / errors[k]) ** 2
            if not promised > _TELLING * chance:
                break
            cost, at = _profile(structure, problem, at, k, _WITHIN * promised, base + _DOUBTFUL * promised)
            if cost < lowest:
                lowest, lower = cost, at
            if cost - base < little * promised:
                flat.setdefault(structure.names[k], []).append(Flat(side, cost - base, promised))
            if not little * promised <= cost - base < _DOUBTFUL * promised:
                break
    return Rise(flat, lower)


def _principal(covariance: NDArray[np.float64], errors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Steps of one standard error along the principal directions of the covariance, parameters in their errors' units, as
    columns [n, n]."""
    units = np.where(errors > 0, errors, 1.0)
    # What no log shows at all has a variance beyond what numbers reach, and no direction.
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = covariance / np.outer(units, units)
    values, vectors = np.linalg.eigh(np.where(np.isfinite(scaled), scaled, 0.0))
    return units[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))


def _one_sided(estimate: Estimate, sides: list[Flat], lower: float, upper: float) -> Estimate:
    low, high = estimate.ci95
    for one in sides:
        low, high = (low, upper) if one.side > 0 else (lower, high)
    return replace(estimate, std_error=float("inf"), ci95=(low, high), status="not_identifiable")


def with_flat_sides(fit: Fit, flat: dict[str, list[Flat]]) -> Fit:
    """The fit in which no parameter is identified towards whose side the cost hardly rises, with a note on each."""
    flat = {name: sides for name, sides in flat.items() if fit[name].status == "identified"}
    if not flat:
        return fit
    table, notes, parameters = fit.robot.parameters, [], dict(fit.parameters)
    for name, sides in flat.items():
        parameters[name] = _one_sided(fit[name], sides, table[name].lower, table[name].upper)
        where = " and ".join("larger" if one.side > 0 else "smaller" for one in sides)
        worst = min(sides, key=lambda one: one.found)
        bounded = "bound it from one side only" if len(sides) == 1 else "do not determine it"
        notes.append(
            f"{name}: towards {where} values the cost hardly rises ({max(worst.found, 0.0):.2g} where its curvature "
            f"promises {worst.promised:.2g}), as where dry friction holds the robot all the same; these logs {bounded}."
        )
    return replace(fit, parameters=parameters, notes=(*fit.notes, *notes))
