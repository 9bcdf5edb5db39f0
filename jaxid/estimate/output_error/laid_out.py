"""An output-error problem in lanes, as machine code reads it from NumPy.

Only the robot's own machine code is made, once for every number of logs, samples and steps, so that an answer comes seconds
sooner than from programs of XLA's.
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ...kernel.groups import grouped, ungrouped
from ...kernel.machine import lanes
from ...simulation.direct import MachineModel, machine_model
from ...simulation.records import commanded, in_motion, measured
from ...simulation.rollout import by_outputs
from .bounds import Plain
from .problem import CLOCK_OFFSET, Problem, Structure, plain, residual_weights

Array = Any
"""NumPy's, or what can be read as such."""


class Logs(NamedTuple):
    """E logs as G groups of L lanes. `u`: the inputs before any effect on commands. `weight`: of residuals, zero where
    nothing was measured. `u`, `dt` and what is `fixed` for every output that is asked for (`Direct.parts` a sample)."""

    u: Float[Array, "G n 1 U L"]
    dt: Float[Array, "G n L"]
    fixed: Float[Array, "G n D L"]
    measured: Float[Array, "G T Y L"]
    weight: Float[Array, "G T Y L"]


class Direct(NamedTuple):
    """A problem in lanes.

    `moving`: places of the problem's parameters among all `numbers`; `starts`: those of the free initial states among the
    robot's, of which a unit of the optimiser is `state_scale`; one moves by `state_slope`, which is zero for what is held,
    and its prior has the stiffness `state_stiffness` a unit. `held`: whether each log begins in motion, with its first command.
    `parts`: outputs that are asked for in the time of a sample, with `shares` of that time for each step between two.
    """

    model: MachineModel
    problem: Plain
    moving: tuple[int, ...]
    starts: tuple[int, ...]
    numbers: Float[Array, "*E P"]
    begin: Float[Array, "E S"]
    held: Float[Array, " E"]
    state_scale: Float[Array, "E s"]
    state_slope: Float[Array, "E s"]
    state_stiffness: Float[Array, "E s"]
    shares: Float[Array, "n L"]
    parts: int
    logs: Logs

    @property
    def substeps(self) -> int:
        """Integration steps a sample."""
        return self.parts * len(self.shares)


def _model(structure: Structure, problem: Problem) -> tuple[MachineModel | None, tuple[str, ...]]:
    """The robot in machine code, None where a simulation takes XLA, and the names of its parameters."""
    names = tuple(sorted({*problem.numbers, *structure.names}))
    if CLOCK_OFFSET in structure.state_names:
        return None, names
    return machine_model(structure.robot, names, structure.integrator.friction, tuple(problem.prescribed)), names


def runs_directly(structure: Structure, problem: Problem) -> bool:
    """Whether `direct` has an answer: no simulation takes XLA. Call under float64."""
    return _model(structure, problem)[0] is not None


def direct(structure: Structure, problem: Problem, residuals: bool = True) -> Direct | None:
    """`problem` in lanes, without what `residuals` need where only outputs are asked for; None where a simulation takes XLA.
    Call under float64."""
    model, names = _model(structure, problem)
    if model is None:
        return None
    weight = residual_weights(problem) if residuals else None
    numbers = plain(problem)
    robot, fixed = structure.robot, numbers.prescribed
    E, T = numbers.dt.shape
    known = np.stack([*fixed.values()], axis=-1) if fixed else np.zeros((E, T, 0))
    n = structure.integrator.substeps
    parts = 1 if fixed else model.records.parts(n)
    scale = np.broadcast_to(numbers.state_scale, numbers.state_free.shape)
    slope = np.where(numbers.state_free, scale, 0.0)
    begin = np.stack([np.broadcast_to(numbers.start[name], E) for name in robot.states], axis=1)
    return Direct(
        model=model,
        problem=numbers,
        moving=tuple(names.index(name) for name in structure.names),
        starts=tuple(robot.states.index(name) for name in structure.state_names),
        numbers=np.array([float(numbers.numbers.get(name, 0.0)) for name in names]),
        begin=begin,
        held=in_motion(robot, begin),
        state_scale=scale,
        state_slope=slope,
        state_stiffness=np.sqrt(numbers.state_precision) * slope,
        shares=np.full((n // parts, lanes()), parts / n),
        parts=parts,
        logs=Logs(
            u=grouped(by_outputs(np.asarray(numbers.inputs)[:, :, None, :], parts)),
            dt=grouped(np.repeat(np.asarray(numbers.dt) / parts, parts, axis=1)),
            fixed=grouped(np.repeat(known, parts, axis=1)),
            measured=grouped(np.where(numbers.mask, numbers.outputs, 0.0))
            if residuals
            else np.zeros((0, 0, 0, lanes())),
            weight=np.zeros((0, 0, 0, lanes())) if weight is None else grouped(weight),
        ),
    )


def starts_at(d: Direct, states: Float[Array, "*c E s"]) -> Float[Array, "*c E S"]:
    x = np.empty((*states.shape[:-2], *d.begin.shape))
    x[:] = d.begin
    if d.starts:
        x[..., d.starts] += d.state_scale * states
    return x


def numbers_at(d: Direct, theta: Float[Array, "*c n"]) -> Float[Array, "*c P"]:
    p = np.empty((*theta.shape[:-1], d.numbers.shape[-1]))
    p[:] = d.numbers
    p[..., d.moving] = theta
    return p


def seen_by(d: Direct, theta: Float[Array, "*E n"], states: Float[Array, "E s"]):
    """What the machine code reads. The parameters are those of all logs or, without effects on records, of each."""
    numbers, records = numbers_at(d, theta), d.model.records
    own = numbers[..., list(d.model.places)]
    u = d.logs.u
    if records.commands is not None:
        after = commanded(records, numbers, d.problem.inputs, d.problem.dt, d.substeps, d.held)
        u = grouped(by_outputs(after, d.parts))
    if own.ndim == 1:  # of all logs
        p = np.empty((len(u), len(own), lanes()))
        p[:] = own[:, None]
    else:
        p = grouped(own)
    return d.shares, p, grouped(starts_at(d, states)), u, d.logs.dt, d.logs.fixed


def shown(d: Direct, theta: Float[Array, "*E n"], y: Float[Array, "G n Y L"]) -> Float[Array, "G T Y L"]:
    """What the sensors report of the outputs."""
    if d.model.records.measures is None:
        return y
    return grouped(measured(d.model.records, numbers_at(d, theta), ungrouped(y, len(d.begin)), d.problem.dt, d.held))


def weighted_residual(y: Float[Array, "G T Y L"], measured: Array, weight: Array) -> Float[Array, "G T Y L"]:
    residual = np.subtract(y, measured, out=y if y.flags.writeable else None)  # what is kept of records is not
    residual *= weight
    # A simulation that is not finite is no matter where nothing was measured.
    return residual if np.isfinite(residual).all() else np.where(weight > 0.0, residual, 0.0)
