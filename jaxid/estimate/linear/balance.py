"""A robot's balance of momentum and its slopes, worked out as expressions from `Robot.rates` and compiled to machine code.

The mass matrix is read off the way dry friction accelerates the robot: dry -> dv/dt is -K with K = M^-1 B^T and
B = d(rubbing speeds)/d(v), so M K = B^T and M v = B^T K^T (K K^T)^-1 v. Where that does not determine it (no friction on
some axis), the momentum is v itself.
"""

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr

from ...kernel.expressions import Graph, Node
from ...kernel.identity import identity_of
from ...kernel.map import Map, compiled_maps
from ...kernel.map_kernel import Mapped
from ...kernel.symbolic import inputs, run, scalars
from ...kernel.tangents import forward
from ...robots.effect import Scalar
from ...robots.robot import Robot

_MOST_ROBOTS = 64


class Balance(NamedTuple):
    """Machine code of a robot's balances. Rows hold positions [nk], speeds [nv], inputs [nu] and what else is named; results
    follow one another in the order given."""

    rubbing: Map
    """positions, speeds -> rubbing speeds [axes]"""
    sample: Map
    """positions, speeds, inputs, zeros [axes] -> momentum [nv], its slopes [nv x free], friction's shares [nv x axes]"""
    force: Map
    """positions, speeds, inputs, directions of sliding [axes], zeros [axes] -> force [nv], its slopes by the free parameters
    [nv x free] and by the speeds [nv x nv]"""
    accelerations: Map
    """positions, speeds, inputs, zeros [axes] -> accelerations without dry friction [nv]"""
    walk: Map
    """interval, inputs, speeds, the next sample's, bends, 1 at a log's first row, positions there; carrying positions -> them
    at the nodes [(2 substeps + 1) x nk]"""

    @property
    def axes(self) -> int:
        """On which dry friction acts."""
        return self.rubbing.outputs


def _dot(graph: Graph, x: Sequence[Node], y: Sequence[Node]) -> Node:
    total = graph.constant(0.0)
    for a, b in zip(x, y, strict=True):
        total = graph.add(total, graph.mul(a, b))
    return total


def _solved(graph: Graph, A: Sequence[Sequence[Node]], b: Sequence[Node]) -> list[Node]:
    """A^-1 b for a symmetric positive definite A, by elimination."""
    n = len(b)
    rows = [[*row, right] for row, right in zip(A, b, strict=True)]
    for k in range(n):
        for i in range(k + 1, n):
            factor = graph.div(rows[i][k], rows[k][k])
            rows[i] = [graph.sub(x, graph.mul(factor, y)) for x, y in zip(rows[i], rows[k], strict=True)]
    x: list[Node] = []
    for k in reversed(range(n)):
        x = [graph.div(graph.sub(rows[k][n], _dot(graph, rows[k][k + 1 : n], x)), rows[k][k]), *x]
    return x


class Expressions:
    """A robot's functions as expressions of a row: positions, speeds, inputs, dry friction and directions of sliding."""

    def __init__(self, robot: Robot, names: tuple[str, ...], positions: tuple[str, ...], parameters: tuple[str, ...]):
        self.graph, self.names, self.positions = Graph(), names, positions
        zero = jnp.zeros(())
        p, x = (zero,) * len(parameters), (zero,) * len(robot.states)
        u = (zero,) * len(robot.channels.inputs)

        def state(x: Sequence[Scalar]):
            return dict(zip(robot.states, x, strict=True))

        def numbers(p: Sequence[Scalar]):
            return dict(zip(parameters, p, strict=True))

        def rubbing(x: Sequence[Scalar], p: Sequence[Scalar]):
            return tuple(jnp.asarray(s, float) for s in robot.rubbing(state(x), numbers(p)))

        def levels(x: Sequence[Scalar], p: Sequence[Scalar]):
            return tuple(jnp.asarray(f, float) for both in robot.coulomb(state(x), numbers(p)) for f in both)

        def rates(x: Sequence[Scalar], u: Sequence[Scalar], dry: Sequence[Scalar], p: Sequence[Scalar]):
            found = robot.rates(state(x), tuple(u), tuple(dry), numbers(p))
            return tuple(jnp.asarray(found[name], float) for name in robot.states)

        rubs = jax.make_jaxpr(rubbing)(x, p)
        self.axes = len(rubs.out_avals)
        self.widths = [len(positions), len(names), len(u), self.axes, self.axes]
        row = iter(scalars(inputs(self.graph, "row", sum(self.widths))))
        self.place, self.v, self.u, self.zeros, self.signs = ([next(row) for _ in range(n)] for n in self.widths)
        own = dict(zip(positions, self.place, strict=True)) | dict(zip(names, self.v, strict=True))
        self.state = {name: own[name] for name in robot.states}
        self.p = dict(zip(parameters, scalars(inputs(self.graph, "p", len(parameters))), strict=True))

        def translated(jaxpr: ClosedJaxpr, *groups: Iterable[Node]) -> list[Node]:
            given = [np.array(node, dtype=object) for group in (*groups, self.p.values()) for node in group]
            return scalars(run(self.graph, jaxpr, given))

        x_ = self.state.values()
        self.rubbing = translated(rubs, x_)
        found = translated(jax.make_jaxpr(levels)(x, p), x_)
        self.levels = list(zip(found[::2], found[1::2], strict=True))  # backward, forward
        found = translated(jax.make_jaxpr(rates)(x, u, (zero,) * self.axes, p), x_, self.u, self.zeros)
        self.rates = dict(zip(robot.states, found, strict=True))

    def slopes(self, results: Sequence[Node], by: Sequence[Node]) -> list[list[Node]]:
        """d results [R] / d by [n], as [R][n]."""
        one = self.graph.constant(1.0)
        columns = [forward(self.graph, results, {seed: one}) for seed in by]
        return [[column[i] for column in columns] for i in range(len(results))]

    def momentum(self) -> list[Node]:
        """M(q) v; `zeros` stand for the dry friction about which K is taken."""
        graph = self.graph
        B = self.slopes(self.rubbing, self.v)  # [axes][nv]
        K = [[graph.neg(x) for x in row] for row in self.slopes([self.rates[name] for name in self.names], self.zeros)]
        solved = _solved(graph, [[_dot(graph, a, b) for b in K] for a in K], self.v)
        on_axes = [_dot(graph, [row[a] for row in K], solved) for a in range(self.axes)]
        return [_dot(graph, [row[j] for row in B], on_axes) for j in range(len(self.v))]


def _flat(rows: Sequence[Sequence[Node]]) -> list[Node]:
    return [node for row in rows for node in row]


@lru_cache(_MOST_ROBOTS)
def expressions(
    robot: Robot, names: tuple[str, ...], positions: tuple[str, ...], parameters: tuple[str, ...]
) -> Expressions:
    """A robot's structure, traced once. Raises `Untranslated`."""
    return Expressions(robot, names, positions, parameters)


@lru_cache(_MOST_ROBOTS)
def rubbing_slopes(
    robot: Robot, names: tuple[str, ...], positions: tuple[str, ...], parameters: tuple[str, ...]
) -> Map:
    """positions, speeds -> d(rubbing speeds)/d(measured speeds) [axes x nv]. Raises `Untranslated`."""

    def make() -> list[Mapped]:
        to = expressions(robot, names, positions, parameters)
        return [Mapped(to.graph, sum(to.widths[:2]), _flat(to.slopes(to.rubbing, to.v)))]

    return compiled_maps(identity_of(robot, names, positions, parameters), "rubbing slopes", make)[0]


@lru_cache(_MOST_ROBOTS)
def balance(
    robot: Robot,
    names: tuple[str, ...],
    positions: tuple[str, ...],
    parameters: tuple[str, ...],
    free: tuple[str, ...],
    mass: bool,
    substeps: int,
) -> Balance:
    """The balances of a robot's structure: of momentum with its `mass` matrix, else of speed. Raises `Untranslated`."""
    identity = identity_of(robot, names, positions, parameters, free, mass, substeps)

    def make() -> list[Mapped]:
        return _balances(expressions(robot, names, positions, parameters), names, free, mass, substeps)

    return Balance(*compiled_maps(identity, "balance", make))


def _balances(
    to: Expressions, names: tuple[str, ...], free: tuple[str, ...], mass: bool, substeps: int
) -> list[Mapped]:
    """What a `Balance` is compiled from, in its order."""
    graph, by = to.graph, [to.p[name] for name in free]
    P = to.momentum() if mass else to.v

    def force(rates: dict[str, Node]) -> list[Node]:
        if not mass:
            return [rates[name] for name in names]
        return forward(graph, P, {to.state[name]: rate for name, rate in rates.items()})

    up = [graph.apply("gt", s, graph.constant(0.0)) for s in to.signs]
    dry = [graph.mul(graph.select(w, b, f), s) for w, s, (b, f) in zip(up, to.signs, to.levels, strict=True)]
    sliding = graph.replaced(list(to.rates.values()), dict(zip(to.zeros, dry, strict=True)))
    Q = force(dict(zip(to.rates, sliding, strict=True)))
    half = graph.constant(0.5)
    mean = [graph.mul(half, graph.add(b, f)) for b, f in to.levels]
    shares = [
        [graph.mul(graph.apply("abs", slope), level) for slope, level in zip(slopes, mean, strict=True)]
        for slopes in to.slopes(force(to.rates), to.zeros)
    ]
    widths = [sum(to.widths[:k]) for k in range(1, 6)]
    return [
        Mapped(graph, widths[1], to.rubbing),
        Mapped(graph, widths[3], [*P, *_flat(to.slopes(P, by)), *_flat(shares)]),
        Mapped(graph, widths[4], [*Q, *_flat(to.slopes(Q, by)), *_flat(to.slopes(Q, to.v))]),
        Mapped(graph, widths[3], [to.rates[name] for name in names]),
        _walk(to, substeps),
    ]


def _walk(to: Expressions, substeps: int) -> Mapped:
    """Positions by Runge-Kutta in half sub-steps, speeds interpolated by a parabola through both samples."""
    graph, nu, nv, nk = to.graph, len(to.u), len(to.v), len(to.place)
    widths = [1, nu, nv, nv, nv, 1, nk]
    row = iter(scalars(inputs(graph, "row", sum(widths))))
    (dt,), u, v, w, bends, (first,), own = ([next(row) for _ in range(width)] for width in widths)
    at = [graph.select(first, x, start) for x, start in zip(scalars(inputs(graph, "carried", nk)), own, strict=True)]
    held = dict(zip(to.u, u, strict=True)) | dict.fromkeys(to.zeros, graph.constant(0.0))
    moving = [to.rates[name] for name in to.positions]
    two, nodes, step = graph.constant(2.0), list(at), 1.0 / (2 * substeps)

    def rates(place: Sequence[Node], share: float) -> list[Node]:
        part, bow = graph.constant(share), graph.constant(share * (share - 1.0))
        speeds = [
            graph.add(graph.add(a, graph.mul(part, graph.sub(b, a))), graph.mul(bow, bend))
            for a, b, bend in zip(v, w, bends, strict=True)
        ]
        there = dict(zip(to.place, place, strict=True)) | dict(zip(to.v, speeds, strict=True))
        return graph.replaced(moving, held | there)

    def ahead(place: Sequence[Node], rates: Sequence[Node], share: float) -> list[Node]:
        size = graph.mul(graph.constant(share), dt)
        return [graph.add(x, graph.mul(size, rate)) for x, rate in zip(place, rates, strict=True)]

    for i in range(2 * substeps):
        k1 = rates(at, i * step)
        k2 = rates(ahead(at, k1, 0.5 * step), (i + 0.5) * step)
        k3 = rates(ahead(at, k2, 0.5 * step), (i + 0.5) * step)
        k4 = rates(ahead(at, k3, step), (i + 1) * step)
        mean = [
            graph.add(graph.add(a, d), graph.mul(two, graph.add(b, c)))
            for a, b, c, d in zip(k1, k2, k3, k4, strict=True)
        ]
        at = ahead(at, mean, step / 6)
        nodes += at
    return Mapped(graph, sum(widths), nodes, at)
