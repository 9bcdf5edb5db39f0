"""Profile likelihood: how far each parameter can go before the best of all the others no longer saves the fit.

A standard error assumes that the cost is a parabola. The profile holds one parameter at a value, minimises over all others,
and takes as its 95 % interval where twice the cost has risen by 3.84 (Venzon & Moolgavkar, Applied Statistics 37, 1988;
Raue et al., Bioinformatics 25, 2009). A profile that never rises that far says that the parameter is not identifiable in
practice. All points of all profiles are minimised side by side.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import jax
import numpy as np
from numpy.typing import NDArray

from ..._arrays import array
from ..._float64 import in_float64
from ..._origin import Origin, with_origin
from ..._table import html_table, text_table
from ...logs import LogSet
from ...parameters import ParameterError
from ...robots.given import given_logs
from ...simulation.rollout import Integrator
from ..output_error.fleet import fit_lanes
from ..output_error.optimum import Optimum
from ..output_error.problem import Problem, Unknowns, parameters_at
from ..output_error.setup import InitialStates, at_fit
from ..result import NORMAL_95, Fit
from .white_noise import not_white

_FIRST = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)
"""Points of the first look, in standard errors."""
_ROUNDS = 5
_CLOSE = 0.02
"""Distance of a point from the interval's end, in roots of the rise, at which the end is found."""
_WIDEST = 1e3
"""Standard errors beyond which nobody looks for an interval's end."""


@dataclass(frozen=True)
class Profile:
    """One parameter's profile.

    - `values` [k], ascending, and `rise` [k] of twice the cost there (0 at the estimate `value`).
    - `ci95`: where the rise reaches 3.84; infinite, or at the parameter's bound, where it never does (`open_ends`).
    - `wald`: the interval of the standard error, to compare with.
    """

    name: str
    unit: str
    value: float
    values: NDArray[np.float64]
    rise: NDArray[np.float64]
    ci95: tuple[float, float]
    wald: tuple[float, float]
    open_ends: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """The interval in words, and how it differs from the standard error's."""
        low, high = self.ci95
        text = f"{self.name} = {self.value:.5g} {self.unit}, 95 % interval {low:.5g} to {high:.5g}"
        if self.open_ends:
            return f"{text}; the data does not end it {' nor '.join(self.open_ends)}."
        return f"{text} (by its standard error {self.wald[0]:.5g} to {self.wald[1]:.5g})."


@dataclass(frozen=True, repr=False)
class Profiles:
    """Profiles of a fit's free parameters, by symbol: their intervals, and what the data does not bound.

    `caveat` says where the fit's residual is not the white noise that the likelihood is of.
    """

    profiles: dict[str, Profile]
    caveat: str = ""
    origin: Origin | None = field(default=None, kw_only=True, compare=False, repr=False)

    def __getitem__(self, name: str) -> Profile:
        return self.profiles[name]

    def _rows(self) -> list[tuple[str, ...]]:
        rows = [("", "value", "95 % interval", "by its standard error", "unit", "without an end")]
        for name, profile in self.profiles.items():
            profiled, wald = (f"{low:.5g} to {high:.5g}" for low, high in (profile.ci95, profile.wald))
            rows.append((name, f"{profile.value:.5g}", profiled, wald, profile.unit, " and ".join(profile.open_ends)))
        return rows

    @property
    def sentence(self) -> str:
        """How many parameters the data bounds on both sides, and which it does not."""
        open_ = [name for name, profile in self.profiles.items() if profile.open_ends]
        text = f"Profile likelihood: {len(self.profiles) - len(open_)} of {len(self.profiles)} intervals have both ends"
        return f"{text}; without: {', '.join(open_)}." if open_ else f"{text}."

    def __repr__(self) -> str:
        return text_table(self._rows(), [self.sentence, self.caveat])

    def _repr_html_(self) -> str:
        return html_table(self._rows(), [self.sentence, self.caveat])


def _limits(problem: Problem, i: int) -> tuple[float, float]:
    """Bounds of a parameter."""
    low, high = float(problem.bounds.lower[i]), float(problem.bounds.upper[i])
    return low, high


def _end(points: dict[float, float], side: float) -> float | None:
    """Where the signed root of the rise crosses +-1.96 on one side, by interpolation between the points that enclose it."""
    roots = sorted((side * value, np.sqrt(max(rise, 0.0))) for value, rise in points.items())
    for (near, low), (far, high) in zip(roots[:-1], roots[1:], strict=True):
        if low < NORMAL_95 <= high:
            return side * (near + (far - near) * (NORMAL_95 - low) / (high - low))
    return None


def _next(points: dict[float, float], side: float, error: float, limits: tuple[float, float], at: float) -> list[float]:
    """Three values to try on one side: around the crossing if it is enclosed, further out if not."""
    end = _end(points, side)
    if end is not None:
        found = [end, end + 0.05 * (end - at), end - 0.05 * (end - at)]
    else:
        furthest = max(max(abs(value - at) for value in points), error)
        found = [at + side * furthest * factor for factor in (1.5, 3.0, 8.0)]
        found = [value if abs(value - at) < _WIDEST * error else at + side * _WIDEST * error for value in found]
    return [float(np.clip(value, *limits)) for value in found]


def _closed(points: dict[float, float], side: float, limits: tuple[float, float]) -> bool:
    """Whether a point lies on the crossing, or the bound is reached below it."""
    if any(abs(np.sqrt(max(rise, 0.0)) - NORMAL_95) < _CLOSE for rise in points.values()):
        return True
    return _end(points, side) is None and any(value in limits for value in points)


@with_origin
@in_float64
def profile_likelihood(
    fit: Fit,
    logs: LogSet,
    parameters: Sequence[str] | None = None,
    *,
    initial_states: InitialStates = "auto",
    integrator: Integrator | None = None,
    report: Callable[[str], None] = lambda message: None,
) -> Profiles:
    """Profile-likelihood intervals of an output-error fit's free parameters (or of those named in `parameters`).

    `logs`, `initial_states` and `integrator` are those of the fit. Raises `ParameterError` for a parameter that the fit
    did not estimate.
    """
    names = (parameters,) if isinstance(parameters, str) else tuple(parameters or fit.free_names)
    for name in names:
        if name not in fit.free_names:
            raise ParameterError(
                f"the fit did not estimate {name!r}; its free parameters are {', '.join(fit.free_names)}"
            )
    logs = given_logs(fit.robot, logs)
    structure, problem, unknowns = at_fit(fit, logs, initial=initial_states, integrator=integrator)
    theta = np.asarray(problem.held)
    free = np.asarray(problem.free)
    index = {name: structure.names.index(name) for name in names}
    covariance = np.where(np.isfinite(fit.covariance), fit.covariance, 0.0)
    error = np.sqrt(np.diag(covariance))
    # A parameter without a standard error is looked for at its own magnitude.
    error = np.where(error > 0, error, np.asarray(problem.bounds.scale))
    limits = {name: _limits(problem, i) for name, i in index.items()}

    def look(wanted: list[tuple[str, float]]) -> Optimum:
        """Optima with each (parameter, value) held and everything else minimised; the last one holds nothing."""
        lanes = len(wanted)
        held, frees = np.tile(theta, (lanes + 1, 1)), np.tile(free, (lanes + 1, 1))
        z = np.repeat(np.asarray(unknowns.z)[None], lanes + 1, axis=0)
        states = np.repeat(np.asarray(unknowns.states)[None], lanes + 1, axis=0)
        for lane, (name, value) in enumerate(wanted):
            i = index[name]
            held[lane, i], frees[lane, i] = value, False
            if tried[name]:
                nearest = tried[name][min(tried[name], key=lambda other: abs(other - value))]
                z[lane], states[lane, ...] = nearest.z, nearest.states
            else:  # where the others go when the cost is a parabola
                variance = covariance[i, i] if covariance[i, i] > 0 else 1.0
                moved = theta + covariance[:, i] / variance * (value - theta[i])
                z[lane] = problem.bounds.coordinates(array(moved))
        own = {"held": array(held), "free": array(frees)}
        starts = Unknowns(array(z), array(states))
        return fit_lanes(structure, problem, own, starts, rounds=1, lanes=min(len(names) * len(_FIRST) + 1, 32)).optimum

    points: dict[str, dict[float, float]] = {name: {} for name in names}
    tried: dict[str, dict[float, Unknowns]] = {name: {} for name in names}
    wanted = [
        (name, float(np.clip(theta[i] + k * error[i], *limits[name]))) for name, i in index.items() for k in _FIRST
    ]
    best, centre = np.inf, theta
    for number in range(_ROUNDS):
        found = jax.tree.map(np.asarray, look(wanted))
        costs = 2.0 * found.cost
        if costs[-1] < best:
            best, centre = float(costs[-1]), np.asarray(parameters_at(problem, array(np.asarray(found.unknowns.z)[-1])))
        for lane, (name, value) in enumerate(wanted):
            if found.converged[lane]:
                points[name][value] = float(costs[lane])
                tried[name][value] = jax.tree.map(lambda leaf, lane=lane: leaf[lane], found.unknowns)
        rises = _rises(points, best, centre, index)
        wanted = []
        for name, i in index.items():
            for side in (-1.0, 1.0):
                own = {v: r for v, r in rises[name].items() if side * (v - centre[i]) >= 0}
                if not _closed(own, side, limits[name]):
                    wanted += [(name, v) for v in _next(own, side, error[i], limits[name], centre[i])]
        report(f"profiles, round {number + 1}: {len(wanted) // 3} ends of intervals left")
        if not wanted:
            break
    rises = _rises(points, best, centre, index)
    profiles = {name: _profile(fit, name, rises[name], centre[i], limits[name]) for name, i in index.items()}
    return Profiles(profiles, not_white(fit))


def _rises(points, best: float, centre: NDArray[np.float64], index: dict[str, int]) -> dict[str, dict[float, float]]:
    """Rise of twice the cost at every point, zero at the optimum."""
    return {
        name: {float(centre[index[name]]): 0.0, **{v: cost - best for v, cost in own.items()}}
        for name, own in points.items()
    }


def _profile(fit: Fit, name: str, rises: dict[float, float], at: float, limits: tuple[float, float]) -> Profile:
    ends, open_ends = [], []
    for side, word, bound in ((-1.0, "below", limits[0]), (1.0, "above", limits[1])):
        end = _end({v: r for v, r in rises.items() if side * (v - at) >= 0}, side)
        if end is None:
            open_ends.append(word)
            end = bound
        ends.append(float(end))
    values = np.array(sorted(rises))
    estimate = fit[name]
    half = NORMAL_95 * estimate.std_error
    return Profile(
        name=name,
        unit=estimate.unit,
        value=float(at),
        values=values,
        rise=np.array([rises[v] for v in values]),
        ci95=(ends[0], ends[1]),
        wald=(estimate.value - half, estimate.value + half),
        open_ends=tuple(open_ends),
    )
