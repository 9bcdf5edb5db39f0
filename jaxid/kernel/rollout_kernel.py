"""One program for a rollout with its tangents: loops over groups of lanes, samples, sub-steps and directions.

Arrays are laid out group by group, the L lanes of a group side by side (G groups, T samples, K directions, R rows of
inputs a sample: one where the input is held, else one a sub-step):

    p [G, P, L]   x [G, S, L]   u [G, T, R, U, L]   dt [G, T, L]   fixed [G, T, D, L]   ->  y [G, T, Y, L]
    dp [G, K, n, L]   dx [G, K, S, L]   du [G, T, R, K, U, L]  ->  dy [G, T, Y, K, L]

A step's derivatives by the state, by the n parameters that move and by the inputs are worked out once and serve all
directions.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from llvmlite import ir

from .emit import DOUBLE, INDEX, Builder, Loop, Value, Writer, levels, place, reached
from .expressions import Graph, Node

Rows = Sequence[Sequence[Node]]


class Derivatives(NamedTuple):
    """Derivatives of results [R] by the states [R][S], by the parameters that move [R][n] and by the inputs [R][U] (empty
    where the inputs do not move)."""

    by_x: Rows
    by_p: Rows
    by_u: Rows


class Program(NamedTuple):
    """A sampled system as expressions. Inputs of the graph: groups "p", "x", "u" and "h", the sub-step.

    `fixed`: states that are set at every sample. `state_by` and `output_by` are None for a rollout alone.
    """

    graph: Graph
    parameters: int
    inputs: int
    state: Sequence[Node]
    output: Sequence[Node]
    fixed: Sequence[int] = ()
    state_by: Derivatives | None = None
    output_by: Derivatives | None = None


ARGUMENTS: tuple[str, ...] = ("shares", "p", "x", "u", "dt", "fixed")
TANGENTS: tuple[str, ...] = ("dp", "dx", "du")


class Rollout:
    """What programs of rollouts have in common: `void <name>(sizes..., arrays...)`, the arrays by name."""

    function: ir.Function
    G: Value
    T: Value
    R: Value
    substeps: Value
    group: Value
    t: Value
    row: Value
    h: Value

    def __init__(self, program: Program, lanes: int, name: str, sizes: int, arrays: Sequence[str]):
        self.program, self.lanes = program, lanes
        self.module = ir.Module(name=name)
        kinds = [INDEX] * sizes + [DOUBLE.as_pointer()] * len(arrays)
        self.function = ir.Function(self.module, ir.FunctionType(ir.VoidType(), kinds), name)
        for argument in self.function.args[sizes:]:
            argument.add_attribute("noalias")
        self.arrays = dict(zip(arrays, self.function.args[sizes:], strict=True))
        self.build: Builder = ir.IRBuilder(self.function.append_basic_block("entry"))
        self.writer = Writer(program.graph, self.module, lanes)
        self.vector = self.writer.kind
        self.state = [self.build.alloca(self.vector, name=f"x{i}") for i in range(len(program.state))]

    def _address(self, base: Value, at: Value) -> Value:
        build = self.build
        behind = build.gep(base, [build.mul(at, ir.Constant(INDEX, self.lanes))])
        return build.bitcast(behind, self.vector.as_pointer())

    def _load(self, array: str, *digits) -> Value:
        return self.build.load(self._address(self.arrays[array], place(self.build, *digits)), align=8)

    def _store(self, value: Value, array: str, *digits) -> None:
        self.build.store(value, self._address(self.arrays[array], place(self.build, *digits)), align=8)

    def _given(self, build: Builder, group: str, i: int) -> Value:
        program = self.program
        if group == "p":
            return self._load("p", (self.group, self.G), (i, program.parameters))
        if group == "h":
            return self.h
        if group == "u":
            row = (self.group, self.G), (self.t, self.T), (self.row, self.R)
            return self._load("u", *row, (i, program.inputs))
        return build.load(self.state[i])

    def depths(self, results: Iterable[Node]) -> dict[Node, int]:
        """How deep in the loops everything stands that `results` are made of."""
        made_of = reached(self.program.graph, results)
        return levels(self.program.graph, made_of, {"p": 0, "h": 1, "u": 2, "x": 3})

    def begin(self, depth: Mapping[Node, int]) -> dict[Node, Value]:
        """A group's start: what depends on its parameters alone, and its initial states."""
        build, S = self.build, len(self.program.state)
        self.writer.values = {}
        self.row = ir.Constant(INDEX, 0)
        self.writer.write(build, [k for k in sorted(depth) if depth[k] == 0], self._given)
        for i in range(S):
            build.store(self._load("x", (self.group, self.G), (i, S)), self.state[i])
        return dict(self.writer.values)

    def set_fixed(self, sample: tuple) -> None:
        """States that are set at every sample."""
        for d, i in enumerate(self.program.fixed):
            self.build.store(self._load("fixed", *sample, (d, len(self.program.fixed))), self.state[i])

    def begin_step(self, step: Value, interval: Value, constant: Mapping[Node, Value], nodes: Sequence[Node]) -> None:
        """A sub-step's expressions."""
        build, zero = self.build, ir.Constant(INDEX, 0)
        self.h = build.fmul(interval, self._load("shares", (step, self.substeps)))
        self.row = build.select(build.icmp_signed("==", self.R, ir.Constant(INDEX, 1)), zero, step)
        self.writer.values = dict(constant)
        self.writer.write(build, nodes, self._given)

    def end_step(self) -> None:
        """The states after it."""
        for i, node in enumerate(self.program.state):
            self.build.store(self.writer.values[node], self.state[i])


class _Rollout(Rollout):
    """Writes `void rollout(G, T, R, K, substeps, shares, p, x, u, dt, fixed[, dp, dx, du], y or dy)`."""

    def __init__(self, program: Program, lanes: int):
        self.moving = program.state_by is not None
        arrays = (*ARGUMENTS, *TANGENTS, "dy") if self.moving else (*ARGUMENTS, "y")
        super().__init__(program, lanes, "rollout", 5, arrays)
        self.G, self.T, self.R, self.K, self.substeps = self.function.args[:5]
        self.n = len(program.state_by.by_p[0]) if program.state_by is not None else 0

    def _tangent(self, i: int, k: Value) -> Value:
        """Where the tangent of state i in direction k is kept."""
        at = place(self.build, (k, self.K), (i, len(self.program.state)))
        return self.build.gep(self.tangents, [at])

    def _products(self, derivatives: Derivatives, k: Value) -> list[Value]:
        """Tangents of results in direction k."""
        build, graph, program = self.build, self.program.graph, self.program
        S, n, U = len(program.state), self.n, program.inputs
        x = [build.load(self._tangent(j, k)) for j in range(S)]
        p = [self._load("dp", (self.group, self.G), (k, self.K), (j, n)) for j in range(n)]
        u: list[Value] = []
        if derivatives.by_u and derivatives.by_u[0]:
            row = (self.group, self.G), (self.t, self.T), (self.row, self.R), (k, self.K)
            u = [self._load("du", *row, (j, U)) for j in range(U)]
        results = []
        for by_x, by_p, by_u in zip(derivatives.by_x, derivatives.by_p, derivatives.by_u, strict=True):
            total: Value | None = None
            for partial, tangent in zip((*by_x, *by_p, *by_u), (*x, *p, *u), strict=True):
                value = graph.value(partial)
                if value == 0.0:
                    continue
                flags = ("contract",)
                term = tangent if value == 1.0 else build.fmul(self.writer.values[partial], tangent, flags=flags)
                total = term if total is None else build.fadd(total, term, flags=flags)
            results.append(self.writer.constant(0.0) if total is None else total)
        return results

    def write(self) -> ir.Module:
        program, build, writer = self.program, self.build, self.writer
        S, Y = len(program.state), len(program.output)
        if self.moving:
            self.tangents = build.alloca(self.vector, size=build.mul(self.K, ir.Constant(INDEX, S)), name="tangents")
        step_by, show_by = program.state_by or Derivatives((), (), ()), program.output_by or Derivatives((), (), ())
        stepping = reached(program.graph, [*program.state, *(e for rows in step_by for row in rows for e in row)])
        shown = () if self.moving else program.output
        showing = reached(program.graph, [*shown, *(e for rows in show_by for row in rows for e in row)])
        depth = self.depths([*stepping, *showing])
        with Loop(build, self.G, "group") as self.group:
            constant = self.begin(depth)
            if self.moving:
                with Loop(build, self.K, "start") as k:
                    for i in range(S):
                        start = self._load("dx", (self.group, self.G), (k, self.K), (i, S))
                        build.store(start, self._tangent(i, k))
            with Loop(build, self.T, "sample") as self.t:
                sample = (self.group, self.G), (self.t, self.T)
                self.set_fixed(sample)
                if self.moving:
                    for i in program.fixed:
                        with Loop(build, self.K, "still") as k:
                            build.store(writer.constant(0.0), self._tangent(i, k))
                interval = self._load("dt", *sample)
                self.row, writer.values = ir.Constant(INDEX, 0), dict(constant)
                writer.write(build, showing, self._given)
                if self.moving:
                    with Loop(build, self.K, "show") as k:
                        for i, value in enumerate(self._products(show_by, k)):
                            self._store(value, "dy", *sample, (i, Y), (k, self.K))
                else:
                    for i, node in enumerate(program.output):
                        self._store(writer.values[node], "y", *sample, (i, Y))
                with Loop(build, self.substeps, "substep") as step:
                    self.begin_step(step, interval, constant, stepping)
                    if self.moving:
                        with Loop(build, self.K, "move") as k:
                            for i, value in enumerate(self._products(step_by, k)):
                                build.store(value, self._tangent(i, k))
                    self.end_step()
        build.ret_void()
        return self.module


def write_rollout(program: Program, lanes: int) -> ir.Module:
    """LLVM module with the function `rollout`: of outputs, or, where the program has derivatives, of their tangents."""
    return _Rollout(program, lanes).write()
