"""Profile likelihood: how far each parameter can go before the best of all the others no longer saves the fit.

A standard error assumes that the cost is a parabola. The profile holds one parameter at a value, minimises over all others,
and takes as its 95 % interval where twice the cost has risen by 3.84 (Venzon & Moolgavkar, Applied Statistics 37, 1988;
Raue et al., Bioinformatics 25, 2009). A profile that never rises that far says that the parameter is not identifiable in
practice. All points of all profiles are minimised side by side.

The cost at any point bounds the profile from above: a low one is proof, wherever the search for it ended, and a high one is
evidence only as far as its minimum was found. So a point begins where its inner neighbour ended, high ones far from
their neighbour are looked at again from there, and what lies between is filled in until the rise is seen to pass the level.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import jax
import numpy as np
import pandas as pd
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
from ..result import NORMAL_95, Fit, checked_fit
from .white_noise import not_white

_FIRST = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)
"""Points of the first look, in standard errors."""
_ROUNDS = 16
_CLOSE = 0.02
"""Distance of a point from the interval's end, in roots of the rise, at which the end is found."""
_WIDEST = 1e3
"""Standard errors beyond which nobody looks for an interval's end."""
_UNSEEN = 0.1
"""Share of its magnitude that stands for the standard error of a parameter that has none."""
_STEEP = 3.0
"""Root of the rise, in units of the level, from which a point is too far out to say where between it and its neighbour the
level was passed, or whether its minimum was found."""
_NARROW = 0.02
"""Distance between two points on either side of the level, in units of their distance from the estimate, at which the end
is found although the rise jumps between them."""


@dataclass(frozen=True)
class Profile:
    """One parameter's profile.

    - `values` [k], ascending, and `rise` [k] of twice the cost there (0 at the estimate `value`).
    - `ci95`: where the rise reaches 3.84; infinite, or at the parameter's bound, where it never does (`open_ends`), or where
      the search for the place did not come to an end (`unfound_ends`).
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
    unfound_ends: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """The interval in words, and how it differs from the standard error's."""
        low, high = self.ci95
        text = f"{self.name} = {self.value:.5g} {self.unit}, 95 % interval {low:.5g} to {high:.5g}"
        if self.open_ends:
            text = f"{text}; the data does not end it {' nor '.join(self.open_ends)}"
        if self.unfound_ends:
            text = (
                f"{text}; its end {' and '.join(self.unfound_ends)} was not found, as searches there did not converge"
            )
        if self.open_ends or self.unfound_ends:
            return f"{text}."
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

    def to_pandas(self) -> pd.DataFrame:
        """A row for every parameter by symbol: `value`, `ci95_low` and `ci95_high` of its profile (infinite where nothing ends
        it), `wald_low` and `wald_high` by its standard error, and `unit`."""
        rows = {name: (p.value, *p.ci95, *p.wald, p.unit) for name, p in self.profiles.items()}
        columns = ["value", "ci95_low", "ci95_high", "wald_low", "wald_high", "unit"]
        return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("parameter")

    def _rows(self) -> list[tuple[str, ...]]:
        rows: list[tuple[str, ...]] = [
            ("", "value", "95 % interval", "by its standard error", "unit", "without an end", "end not found")
        ]
        for name, profile in self.profiles.items():
            profiled, wald = (f"{low:.5g} to {high:.5g}" for low, high in (profile.ci95, profile.wald))
            open_, unfound = (" and ".join(sides) for sides in (profile.open_ends, profile.unfound_ends))
            rows.append((name, f"{profile.value:.5g}", profiled, wald, profile.unit, open_, unfound))
        if any(profile.unfound_ends for profile in self.profiles.values()):
            return rows
        return [row[:-1] for row in rows]

    @property
    def sentence(self) -> str:
        """How many parameters the data bounds on both sides, and which it does not."""
        open_ = [name for name, profile in self.profiles.items() if profile.open_ends]
        lost = [name for name, profile in self.profiles.items() if profile.unfound_ends]
        both = len(self.profiles) - len({*open_, *lost})
        text = f"Profile likelihood: {both} of {len(self.profiles)} intervals have both ends"
        text += f"; without: {', '.join(open_)}" if open_ else ""
        return text + (f"; not found: {', '.join(lost)}." if lost else ".")

    def __repr__(self) -> str:
        return text_table(self._rows(), [self.sentence, self.caveat])

    def _repr_html_(self) -> str:
        return html_table(self._rows(), [self.sentence, self.caveat])


def _limits(problem: Problem, i: int) -> tuple[float, float]:
    """Bounds of a parameter."""
    low, high = float(problem.bounds.lower[i]), float(problem.bounds.upper[i])
    return low, high


@dataclass(frozen=True)
class _Side:
    """What is known of a profile on one side of the estimate `at`, as far as `edge`; values with the root of their rise.

    - `near`: the furthest value at which the rise is known to be below the level.
    - `far`: the next one beyond it, at which the search ended above the level, or did not converge (root NaN), if any.
    - `begun`: the value from whose minimum the search at `far` began.
    """

    near: tuple[float, float]
    far: tuple[float, float] | None
    begun: float
    at: float
    edge: float

    @staticmethod
    def of(rises: dict[float, float], begun: dict[float, float], side: float, at: float, edge: float) -> "_Side":
        """From the `rises` that were found, and `begun`, every value that was asked for and where the search began."""
        roots = {value: float("nan") for value in begun if side * (value - at) > 0}
        roots |= {v: float(np.sqrt(max(rise, 0.0))) for v, rise in rises.items() if side * (v - at) >= 0}
        near = max((value for value, root in roots.items() if root < NORMAL_95), key=lambda value: side * value)
        beyond = [value for value in roots if side * (value - near) > 0]
        if not beyond:
            return _Side((near, roots[near]), None, at, at, edge)
        far = min(beyond, key=lambda value: side * value)
        return _Side((near, roots[near]), (far, roots[far]), begun[far], at, edge)

    @property
    def end(self) -> float | None:
        """Where the rise passes the level: None where it does not, or where that is not known well enough."""
        (near, low), (far, high) = self.near, self.far or (np.nan, np.nan)
        if high - NORMAL_95 < _CLOSE:
            return self.crossing
        if high >= NORMAL_95 and abs(far - self.begun) <= _NARROW * abs(far - self.at):
            return far if high > _STEEP * NORMAL_95 else self.crossing  # of a jump, nothing known to fit is left out
        return near if NORMAL_95 - low < _CLOSE else None

    @property
    def crossing(self) -> float:
        """Where a straight line between `near` and `far` passes the level."""
        (near, low), (far, high) = self.near, self.far or self.near
        return near + (far - near) * (NORMAL_95 - low) / (high - low)

    @property
    def open(self) -> bool:
        """Whether the rise is below the level as far as anybody looks, or almost: on a bound there may be no robot."""
        return abs(self.edge - self.near[0]) <= _NARROW * abs(self.edge - self.at)

    def next(self, furthest: float) -> list[float]:
        """Three values to try: around the level where it is enclosed, further out than `furthest` from `at` where not."""
        near = self.near[0]
        if self.far is None:
            reach = np.sign(self.edge - self.at) * furthest * np.array([1.5, 3.0, 8.0])
            inside = np.abs(reach) < abs(self.edge - self.at)
            return [float(value) for value in np.where(inside, self.at + reach, self.edge)]
        far, root = self.far
        # Also of a root that is NaN.
        if not root < _STEEP * NORMAL_95 or abs(far - near) <= _NARROW * abs(far - self.at):
            return [near + 0.25 * (far - near), near + 0.5 * (far - near), far]
        around = (self.crossing + share * (self.crossing - self.at) for share in (0.0, 0.05, -0.05))
        return [float(np.clip(value, min(near, far), max(near, far))) for value in around]


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
    checked_fit(fit)
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
    # A parameter without a standard error is looked for at its own magnitude.
    seen = np.array([np.isfinite(fit[name].std_error) if name in fit.parameters else True for name in structure.names])
    error = np.where(seen, np.sqrt(np.diag(covariance)), 0.0)
    error = np.where(error > 0, error, _UNSEEN * np.asarray(problem.bounds.scale))
    limits = {name: _limits(problem, i) for name, i in index.items()}

    def neighbour(name: str, value: float) -> float | None:
        """The nearest value between `value` and the estimate at which a search has ended."""
        at = centre[index[name]]
        inner = [v for v in tried[name] if (v - at) * (value - at) > 0 and abs(v - at) < abs(value - at)]
        return min(inner, key=lambda other: abs(other - value), default=None)

    def look(wanted: list[tuple[str, float]]) -> Optimum:
        """Optima with each (parameter, value) held and everything else minimised; the last one holds nothing."""
        lanes = len(wanted)
        held, frees = np.tile(theta, (lanes + 1, 1)), np.tile(free, (lanes + 1, 1))
        z = np.repeat(np.asarray(unknowns.z)[None], lanes + 1, axis=0)
        states = np.repeat(np.asarray(unknowns.states)[None], lanes + 1, axis=0)
        for lane, (name, value) in enumerate(wanted):
            i = index[name]
            held[lane, i], frees[lane, i] = value, False
            inner = neighbour(name, value)
            begun[name][value] = float(centre[i]) if inner is None else inner
            if inner is not None:
                z[lane], states[lane, ...] = tried[name][inner].z, tried[name][inner].states
            elif seen[i]:  # where the others go when the cost is a parabola
                variance = covariance[i, i] if covariance[i, i] > 0 else 1.0
                moved = theta + covariance[:, i] / variance * (value - theta[i])
                z[lane] = problem.bounds.coordinates(array(moved))
        own = {"held": array(held), "free": array(frees)}
        starts = Unknowns(array(z), array(states))
        return fit_lanes(structure, problem, own, starts, rounds=1, lanes=min(len(names) * len(_FIRST) + 1, 32)).optimum

    def prior(i: int, value: float) -> float:
        """What the prior says of a parameter that is held, as of one that is free."""
        return float(problem.prior_precision[i] * (value - problem.prior_mean[i]) ** 2)

    def sides(name: str, i: int, rises: dict[float, float]) -> list[_Side]:
        at = float(centre[i])
        edges = np.clip(at + _WIDEST * error[i] * np.array([-1.0, 1.0]), *limits[name]).tolist()
        return [_Side.of(rises, begun[name], side, at, edge) for side, edge in zip((-1.0, 1.0), edges, strict=True)]

    points: dict[str, dict[float, float]] = {name: {} for name in names}
    tried: dict[str, dict[float, Unknowns]] = {name: {} for name in names}
    begun: dict[str, dict[float, float]] = {name: {} for name in names}
    best, centre = np.inf, theta
    wanted = [
        (name, float(np.clip(theta[i] + k * error[i], *limits[name]))) for name, i in index.items() for k in _FIRST
    ]
    for number in range(_ROUNDS):
        found = jax.tree.map(np.asarray, look(wanted))
        costs = 2.0 * found.cost
        costs[: len(wanted)] += [prior(index[name], value) for name, value in wanted]
        if costs[-1] < best:
            best, centre = float(costs[-1]), np.asarray(parameters_at(problem, array(np.asarray(found.unknowns.z)[-1])))
        for lane, (name, value) in enumerate(wanted):
            proof = costs[lane] - best < NORMAL_95**2  # wherever the search ended
            if (found.converged[lane] or proof) and costs[lane] < points[name].get(value, np.inf):
                points[name][value] = float(costs[lane])
                tried[name][value] = jax.tree.map(lambda leaf, lane=lane: leaf[lane], found.unknowns)
        rises = _rises(points, best, centre, index)
        wanted = []
        for name, i in index.items():
            for side in sides(name, i, rises[name]):
                if side.end is None and not side.open:
                    furthest = max([error[i], *(abs(v - centre[i]) for v in begun[name])])
                    wanted += [(name, value) for value in side.next(furthest)]
        report(f"profiles, round {number + 1}: {len(wanted) // 3} ends of intervals left")
        if not wanted:
            break
    rises = _rises(points, best, centre, index)
    profiles = {
        name: _profile(fit, name, rises[name], sides(name, i, rises[name]), limits[name]) for name, i in index.items()
    }
    return Profiles(profiles, not_white(fit))


def _rises(points, best: float, centre: NDArray[np.float64], index: dict[str, int]) -> dict[str, dict[float, float]]:
    """Rise of twice the cost at every point, zero at the optimum."""
    return {
        name: {**{v: cost - best for v, cost in own.items()}, float(centre[index[name]]): 0.0}
        for name, own in points.items()
    }


def _profile(
    fit: Fit, name: str, rises: dict[float, float], sides: list[_Side], limits: tuple[float, float]
) -> Profile:
    ends, open_ends, unfound_ends = [], [], []
    for side, word, bound in zip(sides, ("below", "above"), limits, strict=True):
        end = side.end
        if end is None:
            (open_ends if side.open else unfound_ends).append(word)
            end = bound
        ends.append(float(end))
    values = np.array(sorted(rises))
    estimate = fit[name]
    half = NORMAL_95 * estimate.std_error
    return Profile(
        name=name,
        unit=estimate.unit,
        value=sides[0].at,
        values=values,
        rise=np.array([rises[v] for v in values]),
        ci95=(ends[0], ends[1]),
        wald=(estimate.value - half, estimate.value + half),
        open_ends=tuple(open_ends),
        unfound_ends=tuple(unfound_ends),
    )
