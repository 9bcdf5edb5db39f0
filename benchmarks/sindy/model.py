"""A robot with SINDy's terms as additional accelerations, and what a baseline leaves of the measured speeds' changes."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

import jaxid
from jaxid._float64 import in_float64
from jaxid.logs import LogSet
from jaxid.parameters import Parameter
from jaxid.robots.effect import Effect, Levels, Numbers, Scalars, State
from jaxid.robots.robot import Robot
from jaxid.simulation.rollout import Integrator, step

from .library import TERMS, Term

SUBSTEPS = 8
"""Steps between two samples in which pose, wheel angles and caster follow from the measured speeds."""


@dataclass(frozen=True)
class Added(Effect):
    """Coefficients of all terms in all equations [acceleration per unit of the term], and a clock; all zero: absent."""

    id: ClassVar[str] = "sindy"
    needs: ClassVar[tuple[str, ...]] = ("pose", "wheel_angles")
    states: ClassVar[tuple[str, ...]] = ("clock",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return {
            self.key(f"{equation}.{k}"): Parameter(0.0, "", free=False)
            for equation in robot.velocities
            for k in range(len(library(robot)))
        }

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        return {"clock": 1.0 + 0.0 * state["clock"]}


@dataclass(frozen=True)
class AddedOnALine(Added):
    """The same for a robot that does not move in the plane."""

    needs: ClassVar[tuple[str, ...]] = ("wheel_angles",)


class _WithTerms:
    """Mixed into a robot: dry-friction terms change its Coulomb levels, all others add to the rates of its velocities."""

    max_step: ClassVar[float] = 0.01
    """The terms are wanted in the rates even where the robot is looked at without its effects."""

    def coulomb(self: Any, state: State, p: Numbers) -> Levels:
        levels = super().coulomb(state, p)  # type: ignore[misc]
        terms = TERMS[self.name](state, (0.0,) * len(self.channels.inputs), p)
        added: list[Any] = [0.0] * len(levels)
        said: dict[tuple[str, int], list[tuple[Any, Any]]] = {}
        for k, term in enumerate(terms.values()):
            for law, equation, axis, level in term.rubs:
                said.setdefault((law, axis), []).append((p[f"sindy.{equation}.{k}"], level))
        # The Pioneer's two equations speak of the same wheels: their mean, or the one that has the term.
        for (_, axis), parts in said.items():
            voices = sum(jnp.where(c != 0, 1.0, 0.0) for c, _ in parts)
            added[axis] = added[axis] - sum(c * level for c, level in parts) / jnp.maximum(voices, 1.0)
        pairs = zip(levels, added, strict=True)
        return tuple((jnp.maximum(b + more, 0.0), jnp.maximum(f + more, 0.0)) for (b, f), more in pairs)

    def rates(self: Any, state: State, inputs: Scalars, dry: Scalars, p: Numbers) -> State:
        rates = super().rates(state, inputs, dry, p)  # type: ignore[misc]
        terms = TERMS[self.name](state, inputs, p).values()
        values = jnp.stack([jnp.asarray(term.value, float) for term in terms])
        for equation in self.velocities:
            rubs = [any(equation == own for _, own, *_ in term.rubs) for term in terms]
            weights = [0.0 if rub else p[f"sindy.{equation}.{k}"] for k, rub in enumerate(rubs)]
            rates[equation] = rates[equation] + jnp.stack([jnp.asarray(w, float) for w in weights]) @ values
        return rates


@dataclass(frozen=True)
class AxisWithTerms(_WithTerms, jaxid.Axis):
    """A drive axis with SINDy's terms."""


@dataclass(frozen=True)
class PioneerWithTerms(_WithTerms, jaxid.Pioneer):
    """A Pioneer with SINDy's terms."""


@dataclass(frozen=True)
class OmniWithTerms(_WithTerms, jaxid.Omni):
    """An omni with SINDy's terms."""


WITH_TERMS = {"axis": AxisWithTerms, "pioneer": PioneerWithTerms, "omni": OmniWithTerms}


def library(robot: Robot) -> dict[str, Term]:
    """The robot's terms by name; their values here mean nothing."""
    pose = ("x", "y", "theta") if robot.in_plane else ()
    names = (*pose, "clock", *robot.velocities, *robot.angles)
    state = dict.fromkeys(names, 0.0)
    return TERMS[robot.name](state, (0.0,) * len(robot.channels.inputs), robot.parameters.numbers)


def extended(robot: Robot) -> Robot:
    """The robot with all terms present at zero: one compiled program for every choice of terms."""
    return WITH_TERMS[robot.name](robot.parameters) + (Added() if robot.in_plane else AddedOnALine())


def with_coefficients(robot: Robot, coefficients: Mapping[str, np.ndarray]) -> Robot:
    """An `extended` robot with coefficients [terms] by equation."""
    values = {f"sindy.{eq}.{k}": float(c) for eq, own in coefficients.items() for k, c in enumerate(own)}
    return robot.with_values(**values)


@partial(jax.jit, static_argnames=("robot", "integrator"))
def _columns(robot: Robot, integrator: Integrator, p, start, speeds, inputs, dt):
    """Per step of one log: the model's changes of the velocities [T-1, n] and the integrals of all terms [T-1, terms]."""
    names = robot.velocities
    rest = [name for name in robot.states if name not in names]

    def follow(hidden, row):
        before, after, u, h = row
        h = h / SUBSTEPS
        path = tuple(u)

        def rates(state, share):
            everything = dict(state) | {n: before[i] + share * (after[i] - before[i]) for i, n in enumerate(names)}
            no_friction = (0.0,) * len(robot.rubbing(everything, p))
            found = robot.rates(everything, path, no_friction, p)
            return {name: found[name] for name in rest}

        def midpoint(state, k):
            first = rates(state, k / SUBSTEPS)
            half = {name: state[name] + 0.5 * h * first[name] for name in rest}
            second = rates(half, (k + 0.5) / SUBSTEPS)
            return {name: state[name] + h * second[name] for name in rest}, None

        later, _ = jax.lax.scan(midpoint, hidden, jnp.arange(SUBSTEPS))
        here = hidden | {n: before[i] for i, n in enumerate(names)}
        there = later | {n: after[i] for i, n in enumerate(names)}
        return later, (here, there)

    rows = (speeds[:-1], speeds[1:], inputs[:-1], dt[:-1])
    _, (here, there) = jax.lax.scan(follow, {name: start[name] for name in rest}, rows)

    def change(state, u, h):
        after = state
        for _ in range(integrator.substeps):
            after = step(robot, after, tuple(u), h / integrator.substeps, p, integrator.friction)
        return jnp.stack([after[n] - state[n] for n in names])

    def terms(state, u):
        return jnp.stack([jnp.asarray(t.value, float) for t in TERMS[robot.name](state, tuple(u), p).values()])

    u, h = inputs[:-1], dt[:-1]
    mean = 0.5 * (jax.vmap(terms)(here, u) + jax.vmap(terms)(there, u))
    return jax.vmap(change)(here, u, h), mean * h[:, None]


@in_float64
def columns(robot: Robot, logs: LogSet, speeds: list[np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    """For every log what the model (an `extended` robot) and each term add to the speeds up to each sample.

    [T, velocities] and [T, terms]: sums over the steps from the given (smoothed, measured) speeds [T, velocities], with
    pose, wheel angles and caster as those speeds drive them. Sums, so that all goes through the same differentiation.
    """
    p = {name: jnp.asarray(value, float) for name, value in robot.parameters.numbers.items()}
    start = {name: jnp.asarray(value, float) for name, value in robot.initial_state().items()}
    found = []
    for log, own in zip(logs, speeds, strict=True):
        dt = jnp.asarray(np.append(np.diff(log.time), log.sampling_interval))
        integrator = Integrator.suited(robot, log.sampling_interval)
        changes, means = _columns(robot.structure, integrator, p, start, jnp.asarray(own), jnp.asarray(log.inputs), dt)
        found.append(
            tuple(np.concatenate([np.zeros((1, part.shape[1])), np.cumsum(part, axis=0)]) for part in (changes, means))
        )
    return found
