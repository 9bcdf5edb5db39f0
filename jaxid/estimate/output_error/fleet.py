"""Many robots, each with its own logs, fitted side by side.

Each member has its own parameters, constants, initial states, noise, and its own decisions on the way. One that cannot be
fitted is named and does not touch the others. The same batch serves studies of one robot: noise realisations, bootstraps,
all recordings but one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Array, Float, Int

from ..._compile import compiled
from ..._float64 import in_float64
from ..._origin import Origin, with_origin
from ..._table import html_table, text_table
from ...logs import LogError, LogSet
from ...parameters import ParameterError
from ...robots.given import check_free
from ...robots.robot import Robot
from ..result import Fit, estimate_text
from .far_members import FarMember, far_members, too_few
from .from_optimum import channel_noise
from .laid_out import runs_directly
from .lanes import all_in_lanes, in_lanes
from .optimum import Optimum
from .output_error import output_error
from .problem import Problem, Structure, Unknowns
from .setup import Starts, every_start
from .solvers import minimise, minimise_compiled

_WEIGHT_ROUNDS = 3
"""Minimisations, each with the noise that the one before left."""
_SHOWN = 20
"""Members that a representation holds."""
_LANES = 64
"""Problems that a compiled program minimises at a time: more would not fit into the processor's cache."""


class Fitted(NamedTuple):
    """Optima of many problems (leading axis of every leaf) and the noise of each channel they were weighted with."""

    optimum: Optimum
    sigma: Float[Array, "N ny"]


def fit_lanes(
    structure: Structure,
    shared: Problem,
    own: Mapping[str, Any],
    starts: Unknowns,
    *,
    max_steps: int | Int[Array, ""] = 100,
    lanes: int = _LANES,
    rounds: int = _WEIGHT_ROUNDS,
) -> Fitted:
    """Minimise N problems that differ from `shared` in the fields `own` (leading axis N), from `starts` (leading axis N).

    The channels' noise is estimated along the way, `rounds` minimisations in all. Where simulations take XLA, `lanes`
    problems run at a time, as one compiled program.
    """
    own, starts = jax.tree.map(np.asarray, (dict(own), starts))
    if not runs_directly(structure, shared):
        N = len(starts.z)
        filled = np.minimum(np.arange(-(-N // lanes) * lanes), N - 1)  # the program is compiled for so many
        own, starts = jax.tree.map(lambda leaf: leaf[filled], (own, starts))
        found = _compiled_lanes(structure, shared, own, starts, max_steps=max_steps, lanes=lanes, rounds=rounds)
        return jax.tree.map(lambda leaf: leaf[:N], found)

    def one(number: int) -> Fitted:
        fields, unknowns = jax.tree.map(lambda leaf: leaf[number], (own, starts))
        problem = replace(shared, **fields)
        optimum = minimise_compiled(structure, problem, unknowns, max_steps=int(max_steps))
        for _ in range(rounds - 1):
            noise = np.asarray(channel_noise(problem, optimum.triangle.squares))
            least = 1e-3 * np.asarray(fields.get("sigma", shared.sigma))
            sigma = np.where(np.isfinite(noise), np.maximum(noise, least), problem.sigma)
            problem = replace(problem, sigma=np.asarray(sigma))
            optimum = minimise_compiled(structure, problem, optimum.unknowns, max_steps=int(max_steps))
        return Fitted(optimum, problem.sigma)

    found = all_in_lanes({str(number): partial(one, number) for number in range(len(starts.z))})
    return jax.tree.map(lambda *leaves: np.stack(leaves), *found)


@partial(compiled, static_argnames=("structure", "lanes", "rounds"))
def _compiled_lanes(
    structure: Structure,
    shared: Problem,
    own: Mapping[str, Any],
    starts: Unknowns,
    *,
    max_steps: int | Int[Array, ""],
    lanes: int,
    rounds: int,
) -> Fitted:
    numbers = jnp.arange(starts.z.shape[0]).reshape(-1, lanes)

    def one(number):
        fields, start = jax.tree.map(lambda leaf: leaf[number], (dict(own), starts))
        problem = replace(shared, **fields)

        def once(carry, _):
            unknowns, sigma, _ = carry
            weighted = replace(problem, sigma=sigma)
            optimum = minimise(structure, weighted, unknowns, max_steps=max_steps)
            noise = channel_noise(weighted, optimum.triangle.squares)
            next_sigma = jnp.where(jnp.isfinite(noise), jnp.maximum(noise, problem.sigma * 1e-3), sigma)
            return (optimum.unknowns, next_sigma, sigma), optimum

        (_, _, sigma), optima = jax.lax.scan(once, (start, problem.sigma, problem.sigma), None, length=rounds)
        return Fitted(jax.tree.map(lambda leaf: leaf[-1], optima), sigma)

    found = jax.lax.map(jax.vmap(one), numbers)
    # Counted, and not by -1: of initial states that are known there are none to estimate.
    return jax.tree.map(lambda leaf: leaf.reshape(starts.z.shape[0], *leaf.shape[2:]), found)


@dataclass(frozen=True, repr=False)
class Fleet:
    """Fits by member, and why the others have none. `far` are the members that stand out from the fleet."""

    fits: dict[str, Fit]
    failed: dict[str, str]
    origin: Origin | None = field(default=None, kw_only=True, compare=False, repr=False)

    @cached_property
    def far(self) -> tuple[FarMember, ...]:
        """Sound members whose estimates are farther from the fleet's than chance makes them (`far_members`)."""
        return far_members(self.fits)

    @property
    def sentence(self) -> str:
        """How many members were fitted, how many of the fits are to be doubted, and which do not know every parameter."""
        doubted = [name for name, fit in self.fits.items() if not fit.trustworthy]
        text = f"{len(self.fits)} of {len(self.fits) + len(self.failed)} members fitted"
        if doubted:
            text += f"; {len(doubted)} of these are poor or failed: {', '.join(doubted[:_SHOWN])}"
        unknown = {
            name: [symbol for symbol in fit.free_names if fit[symbol].status == "not_identifiable"]
            for name, fit in self.fits.items()
            if fit.trustworthy
        }
        vague = [f"{name} ({', '.join(symbols)})" for name, symbols in unknown.items() if symbols]
        if vague:
            text += f"; the logs of {len(vague)} do not determine every parameter: {', '.join(vague[:_SHOWN])}"
        return f"{text}."

    def to_pandas(self) -> pd.DataFrame:
        """A row for every member and parameter, indexed by both: the columns of `Fit.to_pandas`, and `verdict`, what the
        member's residual says of its fit. Members without a fit are in `failed`."""
        parts = {
            member: fit.to_pandas().assign(verdict=fit.judgement.verdict if fit.judgement else "")
            for member, fit in self.fits.items()
        }
        return pd.concat(parts, names=["member"]) if parts else pd.DataFrame()

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
        more += [far.sentence for far in self.far[:_SHOWN]]
        sound = sum(fit.trustworthy for fit in self.fits.values())
        more += filter(None, [too_few(sound, len(self.fits) + len(self.failed))])
        return more + [f"{name}: {why}" for name, why in list(self.failed.items())[:_SHOWN]]

    def __repr__(self) -> str:
        return text_table(self._rows(), [self.sentence], self._after())

    def _repr_html_(self) -> str:
        return html_table(self._rows(), [self.sentence], self._after())


def of_member(name: str, every: Any, members: Mapping[str, LogSet]) -> Any:
    """A member's own among values given by member, or the one given for all."""
    return every[name] if isinstance(every, Mapping) and set(every) == set(members) else every


def check_fleet(
    robot: Robot | Mapping[str, Robot], fleet: Mapping[str, LogSet], start: Starts | Mapping[str, Starts]
) -> None:
    """Raise what is the caller's mistake and no member's failure: errors as of `fit_fleet`."""
    if not isinstance(fleet, Mapping):
        raise TypeError(
            f"a {type(fleet).__name__} is no fleet; give every member's logs by its name, {{'name': logs, ...}}."
        )
    if not fleet:
        raise LogError("There is no member to fit; give at least one set of logs.")
    empty = [name for name, logs in fleet.items() if not len(logs)]
    if empty:
        raise LogError(f"{empty[0]} has no logs; give it some or leave it out.")
    if isinstance(robot, Mapping) and set(robot) != set(fleet):
        without, unknown = sorted(set(fleet) - set(robot)), sorted(set(robot) - set(fleet))
        which = [f"no robot is given for {', '.join(without)}"] * bool(without)
        which += [f"there are no logs of {', '.join(unknown)}"] * bool(unknown)
        raise ParameterError(f"{' and '.join(which)}; give one robot by the name of every member, or one for all")
    for name in fleet:
        own = of_member(name, robot, fleet)
        every_start(own, of_member(name, start, fleet))
        check_free(own)


@with_origin
@in_float64
def fit_fleet(
    robot: Robot | Mapping[str, Robot],
    fleet: Mapping[str, LogSet],
    *,
    start: Starts | Mapping[str, Starts] = None,
    report: Callable[[str], None] = lambda message: None,
    **options: Any,
) -> Fleet:
    """Output error for every member of `fleet` (its logs by name) on its own, all in one batch.

    Every member gets exactly the fit that `output_error` gives it alone. `robot` and `start` are the same for all, or
    given by member: robots of one structure may differ in their numbers. `options` are those of `output_error`; `report`
    is told the member's name first. Members that cannot be fitted are in `Fleet.failed`.

    Raises `LogError` for an empty fleet or a member without logs and `ParameterError` for unknown or no free parameters.
    """
    check_fleet(robot, fleet, start)
    jobs: dict[str, Callable[[], Fit]] = {}
    for name, logs in fleet.items():
        jobs[name] = partial(
            output_error,
            of_member(name, robot, fleet),
            logs,
            start=of_member(name, start, fleet),
            report=lambda message, name=name: report(f"{name}: {message}"),
            **options,
        )
    report(f"{len(jobs)} members side by side")
    fits, failed = in_lanes(jobs)
    for failure in failed.values():
        if not isinstance(failure, ParameterError | LogError):
            raise failure
    return Fleet(fits, {name: str(failure) for name, failure in failed.items()})
