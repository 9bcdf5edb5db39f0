"""Many robots, each with its own logs, fitted as the lanes of one compiled program.

All members share the robot's structure and the table's constants; each has its own parameters, initial states and noise.
A member on which the simulation diverges is named and does not touch the others. The same program serves studies of one
robot: noise realisations, bootstraps, all recordings but one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._compile import compiled
from ..._float64 import in_float64
from ..._table import html_table, text_table
from ...logs import LogError, LogSet
from ...parameters import ParameterError
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ..result import Fit, estimate_text
from .conclude import Covariance, conclude, no_priors
from .from_optimum import channel_noise, on_bounds, unknown_count
from .globalise import ambiguous_index
from .optimum import Optimum
from .output_error import output_error
from .problem import Problem, Structure, Unknowns
from .setup import InitialStates, build, start_values
from .solvers import minimise

_WEIGHT_ROUNDS = 3
"""Minimisations, each with the noise that the one before left."""
_SHOWN = 20
"""Members that a representation holds."""
_LANES = 64
"""Members that are fitted at a time: more would not fit into the processor's cache."""
_BY_LOG = ("dt", "inputs", "outputs", "start", "mask", "state_free")
"""Fields of a problem that have one row for every log."""


class Fitted(NamedTuple):
    """Optima of many problems (leading axis of every leaf) and the noise of each channel they were weighted with."""

    optimum: Optimum
    sigma: Float[Array, "N ny"]


@partial(compiled, static_argnames=("structure", "lanes", "rounds"))
def fit_lanes(
    structure: Structure,
    shared: Problem,
    own: Mapping[str, Any],
    starts: Unknowns,
    *,
    max_steps: int = 100,
    lanes: int = _LANES,
    rounds: int = _WEIGHT_ROUNDS,
) -> Fitted:
    """Minimise N problems that differ from `shared` in the fields `own` (leading axis N), from `starts` (leading axis N).

    The channels' noise is estimated along the way, `rounds` minimisations in all; `lanes` problems run at a time.
    """

    N = starts.z.shape[0]
    chunks = -(-N // lanes)
    numbers = jnp.arange(chunks * lanes).reshape(chunks, lanes) % N

    def one(number):
        fields, start = jax.tree.map(lambda leaf: leaf[number], (dict(own), starts))
        problem = replace(shared, **fields)

        def once(carry, _):
            unknowns, sigma, _ = carry
            weighted = replace(problem, sigma=sigma)
            optimum = minimise(structure, weighted, unknowns, max_steps=max_steps)
            noise = channel_noise(weighted, optimum.triangle.squares, unknown_count(structure, problem))
            next_sigma = jnp.where(jnp.isfinite(noise), jnp.maximum(noise, problem.sigma * 1e-3), sigma)
            return (optimum.unknowns, next_sigma, sigma), optimum

        (_, _, sigma), optima = jax.lax.scan(once, (start, problem.sigma, problem.sigma), None, length=rounds)
        return Fitted(jax.tree.map(lambda leaf: leaf[-1], optima), sigma)

    found = jax.lax.map(jax.vmap(one), numbers)
    return jax.tree.map(lambda leaf: leaf.reshape(chunks * lanes, *leaf.shape[2:])[:N], found)


@dataclass(frozen=True, repr=False)
class Fleet:
    """Fits by member, and why the others have none."""

    fits: dict[str, Fit]
    failed: dict[str, str]

    @property
    def sentence(self) -> str:
        """How many members were fitted, and how many of the fits are to be doubted."""
        doubted = [name for name, fit in self.fits.items() if not fit.trustworthy]
        text = f"{len(self.fits)} of {len(self.fits) + len(self.failed)} members fitted"
        return (
            f"{text}; {len(doubted)} of these are poor or failed: {', '.join(doubted[:_SHOWN])}."
            if doubted
            else f"{text}."
        )

    def _rows(self) -> list[tuple[str, ...]]:
        if not self.fits:
            return []
        names = next(iter(self.fits.values())).free_names
        rows = [("", *names, "judged")]
        for member, fit in list(self.fits.items())[:_SHOWN]:
            verdict = fit.judgement.verdict if fit.judgement else ""
            rows.append((member, *(estimate_text(fit[name]) for name in names), verdict))
        return rows

    def _after(self) -> list[str]:
        more = [f"{len(self.fits) - _SHOWN} more in fits."] if len(self.fits) > _SHOWN else []
        return more + [f"{name}: {why}" for name, why in list(self.failed.items())[:_SHOWN]]

    def __repr__(self) -> str:
        return text_table(self._rows(), [self.sentence], self._after())

    def _repr_html_(self) -> str:
        return html_table(self._rows(), [self.sentence], self._after())


def _members(fleet: Mapping[str, LogSet], problem: Problem) -> dict[str, Any]:
    """Fields of each member's problem, cut out of the problem of all logs together; missing logs have no weight."""
    most = max(len(logs) for logs in fleet.values())
    index = np.zeros((len(fleet), most), dtype=int)
    there = np.zeros((len(fleet), most), dtype=bool)
    first = 0
    for row, logs in enumerate(fleet.values()):
        index[row] = first
        index[row, : len(logs)] = np.arange(first, first + len(logs))
        there[row, : len(logs)] = True
        first += len(logs)
    N = len(fleet)
    by_log = {name: jax.tree.map(lambda leaf: leaf[index], getattr(problem, name)) for name in _BY_LOG}
    by_log["mask"] = by_log["mask"] & jnp.asarray(there)[..., None, None]
    by_log["state_free"] = by_log["state_free"] & jnp.asarray(there)[..., None]
    by_log["sigma"] = jnp.broadcast_to(problem.sigma, (N, *problem.sigma.shape))
    return by_log


def _one_by_one(robot: Robot, fleet: Mapping[str, LogSet], report: Callable[[str], None], **options: Any) -> Fleet:
    """Members whose casters start at unknown angles: these angles need a search that is no lane's work."""
    fits: dict[str, Fit] = {}
    failed: dict[str, str] = {}
    for name, logs in fleet.items():
        try:
            fits[name] = output_error(robot, logs, windows=None, **options)
            report(name)
        except (ParameterError, LogError) as error:
            failed[name] = str(error)
    return Fleet(fits, failed)


@in_float64
def fit_fleet(
    robot: Robot,
    fleet: Mapping[str, LogSet],
    *,
    start: Fit | Mapping[str, float] | None = None,
    initial_states: InitialStates = "auto",
    integrator: Integrator | None = None,
    covariance: Covariance = "auto",
    max_steps: int = 100,
    report: Callable[[str], None] = lambda message: None,
) -> Fleet:
    """Output error for every member of `fleet` (its logs by name) on its own, all in one compiled batch.

    The arguments are those of `output_error`; all members start at the same values. Raises `LogError` for an empty fleet
    or a member without logs and `ParameterError` for unknown or no free parameters.
    """
    if not fleet:
        raise LogError("There is no member to fit; give at least one set of logs.")
    empty = [name for name, logs in fleet.items() if not len(logs)]
    if empty:
        raise LogError(f"{empty[0]} has no logs; give it some or leave it out.")
    every = LogSet(
        replace(log, name=f"{member}/{log.name}") for member, logs in fleet.items() for log in logs
    )  # fmt: skip
    structure, problem, unknowns = build(
        robot, every, start=start_values(robot, start), initial=initial_states, integrator=integrator
    )
    if ambiguous_index(structure) is not None:
        return _one_by_one(robot, fleet, report, start=start, initial_states=initial_states, integrator=integrator,
                           covariance=covariance, max_steps=max_steps)  # fmt: skip
    own = _members(fleet, problem)
    N, E, s = own["state_free"].shape
    starts = Unknowns(jnp.broadcast_to(unknowns.z, (N, *unknowns.z.shape)), jnp.zeros((N, E, s)))
    shared = replace(problem, **jax.tree.map(lambda leaf: leaf[0], own))
    report(f"{N} members as lanes of one program")
    fitted = fit_lanes(structure, shared, own, starts, max_steps=max_steps, lanes=min(N, _LANES))
    begin = jax.tree.map(lambda leaf: leaf[0], starts)
    fits: dict[str, Fit] = {}
    failed: dict[str, str] = {}
    for row, (name, logs) in enumerate(fleet.items()):
        optimum: Optimum = jax.tree.map(lambda leaf, row=row: leaf[row], fitted.optimum)
        mine = replace(problem, **{field: jax.tree.map(lambda leaf, row=row: leaf[row], x) for field, x in own.items()})
        mine = replace(mine, sigma=fitted.sigma[row])
        if not np.isfinite(np.asarray(optimum.triangle.squares)).all():
            failed[name] = "the simulation diverges at the start values; check the logs' units and signs"
            continue
        bounded = on_bounds(structure, mine, optimum, max_steps)
        rivals = {"its own start": lambda begin=begin: begin} if no_priors(mine) else {}
        fits[name] = conclude(
            robot, logs, structure, mine, optimum, bounded, iterations=int(optimum.iterations), max_steps=max_steps,
            covariance=covariance, rivals=rivals,
        )  # fmt: skip
    return Fleet(fits, failed)
