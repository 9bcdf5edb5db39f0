"""One program for what a least-squares fit asks of rollouts: weighted residuals, and their derivatives reduced to triangles.

The directions are fixed: some initial states, and the parameters that move, each by itself. Arrays are laid out as in
`rollout_kernel`, with Y outputs, s initial states and n parameters that move, N = s + n + 1:

    measured, weight [G, T, Y, L]   by_state [G, s, L]   by_parameter [G, n, L]: units of the directions
    rows [G, T Y, N, L]   R [G, N, N, L]   squares [G, Y, L]

A row has the derivatives by the initial states, by the parameters, and the residual. Rows are written as they are, or reduced
a few at a time under the triangle R that is there before (of priors, say): then nothing as long as the logs is ever written.
What was not measured, weight zero, is zero, even where the simulation is not finite.
"""

from collections.abc import Sequence

from llvmlite import ir

from .dense_kernel import ROWS, write_reduction, write_uprighting
from .emit import INDEX, Loop, Value, place, reached
from .expressions import Node
from .rollout_kernel import ARGUMENTS, Derivatives, Program, Rollout

SEEN: tuple[str, ...] = (*ARGUMENTS, "measured", "weight")
LOOKED: tuple[str, ...] = ("by_state", "by_parameter", "rows", "R", "squares")
MOST_OUTPUTS = ROWS


class _Fit(Rollout):
    """What costs and linearisations have in common."""

    def __init__(self, program: Program, lanes: int, name: str, arrays: Sequence[str], flags: int):
        super().__init__(program, lanes, name, 4 + flags, (*SEEN, *arrays))
        self.G, self.T, self.R, self.substeps = self.function.args[:4]

    def residual(self, i: int, sample: tuple, squares: Sequence[Value]) -> tuple[Value, Value, Value]:
        """Residual of output i, weighted and counted among the squares; its weight, and whether it was measured."""
        build, Y, zero = self.build, len(self.program.output), self.writer.constant(0.0)
        weight = self._load("weight", *sample, (i, Y))
        there = build.fcmp_ordered(">", weight, zero)
        off = build.fsub(self.writer.values[self.program.output[i]], self._load("measured", *sample, (i, Y)))
        value = build.select(there, build.fmul(off, weight), zero)
        total = build.fadd(build.load(squares[i]), build.fmul(value, value, flags=("contract",)), flags=("contract",))
        build.store(total, squares[i])
        return value, weight, there

    def clear(self, squares: Sequence[Value]) -> None:
        for slot in squares:
            self.build.store(self.writer.constant(0.0), slot)

    def keep(self, squares: Sequence[Value]) -> None:
        for i, slot in enumerate(squares):
            self._store(self.build.load(slot), "squares", (self.group, self.G), (i, len(squares)))


class _Costs(_Fit):
    """Writes `void costs(G, T, R, substeps, shares, p, x, u, dt, fixed, measured, weight, squares)`."""

    def write(self) -> ir.Module:
        program, build = self.program, self.build
        squares = [build.alloca(self.vector) for _ in program.output]
        depth = self.depths([*program.state, *program.output])
        stepping, showing = reached(program.graph, program.state), reached(program.graph, program.output)
        with Loop(build, self.G, "group") as self.group:
            constant = self.begin(depth)
            self.clear(squares)
            with Loop(build, self.T, "sample") as self.t:
                sample = (self.group, self.G), (self.t, self.T)
                self.set_fixed(sample)
                interval = self._load("dt", *sample)
                self.row, self.writer.values = ir.Constant(INDEX, 0), dict(constant)
                self.writer.write(build, showing, self._given)
                for i in range(len(squares)):
                    self.residual(i, sample, squares)
                with Loop(build, self.substeps, "substep") as step:
                    self.begin_step(step, interval, constant, stepping)
                    self.end_step()
            self.keep(squares)
        build.ret_void()
        return self.module


class _Look(_Fit):
    """Writes `void look(G, T, R, substeps, reduced, shares, p, x, u, dt, fixed, measured, weight, by_state, by_parameter,
    rows, R, squares)`. `starts`: which initial states move."""

    def __init__(self, program: Program, starts: Sequence[int], lanes: int):
        super().__init__(program, lanes, "look", LOOKED, 1)
        assert program.state_by is not None and program.output_by is not None
        self.step_by, self.show_by = program.state_by, program.output_by
        self.starts, self.n = tuple(starts), len([*self.step_by.by_p, *self.show_by.by_p][0])
        self.N = len(self.starts) + self.n + 1
        self.reduced = self.build.icmp_signed("!=", self.function.args[4], ir.Constant(INDEX, 0))

    def _product(self, by_x: Sequence[Node], by_p: Sequence[Node], k: int, moved: Sequence[Value]) -> Value:
        """Tangent of one result in direction k."""
        build, graph, s = self.build, self.program.graph, len(self.starts)
        total: Value | None = None
        for partial, tangent in zip(by_x, moved, strict=True):
            value = graph.value(partial)
            if value == 0.0:
                continue
            flags = ("contract",)
            term = tangent if value == 1.0 else build.fmul(self.writer.values[partial], tangent, flags=flags)
            total = term if total is None else build.fadd(total, term, flags=flags)
        if k >= s and graph.value(by_p[k - s]) != 0.0:
            term = self.writer.values[by_p[k - s]]
            total = term if total is None else build.fadd(total, term, flags=("contract",))
        return self.writer.constant(0.0) if total is None else total

    def _tangents(self, derivatives: Derivatives, k: int) -> list[Value]:
        moved = [self.build.load(slot) for slot in self.slots[k]]
        pairs = zip(derivatives.by_x, derivatives.by_p, strict=True)
        return [self._product(by_x, by_p, k, moved) for by_x, by_p in pairs]

    def _row(self, row: Value, k: int) -> Value:
        """Address of a row's entry k."""
        build = self.build
        step = [
            build.select(self.reduced, ir.Constant(INDEX, a), ir.Constant(INDEX, b))
            for a, b in ((1, self.N), (ROWS, 1))
        ]
        at = build.add(build.mul(row, step[0]), build.mul(ir.Constant(INDEX, k), step[1]))
        return self._address(self.arrays["rows"], at)

    def _reduce(self) -> None:
        """Fill the block up with zeros and take it under the triangle."""
        build, rows = self.build, ir.Constant(INDEX, ROWS)
        filled = build.load(self.filled)
        with Loop(build, build.sub(rows, filled), "fill") as i:
            for k in range(self.N):
                build.store(self.writer.constant(0.0), self._row(build.add(filled, i), k), align=8)
        n, R = ir.Constant(INDEX, self.N), self._triangle()
        build.call(self.reduction, [n, self.arrays["rows"], R])
        build.store(ir.Constant(INDEX, 0), self.filled)

    def _triangle(self) -> Value:
        behind = place(self.build, (self.group, self.G), (0, self.N * self.N * self.lanes))
        return self.build.gep(self.arrays["R"], [behind])

    def write(self) -> ir.Module:
        program, build, writer = self.program, self.build, self.writer
        step_by, show_by = self.step_by, self.show_by
        S, Y, s, K = len(program.state), len(program.output), len(self.starts), self.N - 1
        self.reduction = write_reduction(self.module, self.lanes)
        upright = write_uprighting(self.module, self.lanes)
        squares = [build.alloca(self.vector) for _ in program.output]
        self.slots = [[build.alloca(self.vector) for _ in range(S)] for _ in range(K)]
        self.filled = build.alloca(INDEX)
        zero = writer.constant(0.0)
        every = [e for by in (step_by, show_by) for rows in by for row in rows for e in row]
        depth = self.depths([*program.state, *program.output, *every])
        stepping = reached(program.graph, [*program.state, *(e for rows in step_by for row in rows for e in row)])
        showing = reached(program.graph, [*program.output, *(e for rows in show_by for row in rows for e in row)])
        with Loop(build, self.G, "group") as self.group:
            constant = self.begin(depth)
            self.clear(squares)
            build.store(ir.Constant(INDEX, 0), self.filled)
            for k, own in enumerate(self.slots):
                for i, slot in enumerate(own):
                    moves = k < s and self.starts[k] == i
                    build.store(self._load("by_state", (self.group, self.G), (k, s)) if moves else zero, slot)
            with Loop(build, self.T, "sample") as self.t:
                sample = (self.group, self.G), (self.t, self.T)
                self.set_fixed(sample)
                for i in program.fixed:
                    for own in self.slots:
                        build.store(zero, own[i])
                interval = self._load("dt", *sample)
                self.row, writer.values = ir.Constant(INDEX, 0), dict(constant)
                writer.write(build, showing, self._given)
                crowded = build.icmp_signed(
                    ">", build.add(build.load(self.filled), ir.Constant(INDEX, Y)), ir.Constant(INDEX, ROWS)
                )
                with build.if_then(build.and_(crowded, self.reduced), likely=False):
                    self._reduce()
                filled = build.load(self.filled)
                first = build.select(self.reduced, filled, build.mul(place(build, *sample), ir.Constant(INDEX, Y)))
                seen = [self.residual(i, sample, squares) for i in range(Y)]
                for k in range(K):
                    unit = None if k < s else self._load("by_parameter", (self.group, self.G), (k - s, self.n))
                    for i, value in enumerate(self._tangents(show_by, k)):
                        _, weight, there = seen[i]
                        own = build.fmul(value, weight)
                        if unit is not None:
                            there = build.and_(there, build.fcmp_unordered("!=", unit, zero))
                            own = build.fmul(own, unit)
                        at = self._row(build.add(first, ir.Constant(INDEX, i)), k)
                        build.store(build.select(there, own, zero), at, align=8)
                for i, (value, _, _) in enumerate(seen):
                    build.store(value, self._row(build.add(first, ir.Constant(INDEX, i)), K), align=8)
                build.store(build.add(filled, ir.Constant(INDEX, Y)), self.filled)
                with Loop(build, self.substeps, "substep") as step:
                    self.begin_step(step, interval, constant, stepping)
                    for k, own in enumerate(self.slots):
                        for slot, value in zip(own, self._tangents(step_by, k), strict=True):
                            build.store(value, slot)
                    self.end_step()
            with build.if_then(self.reduced):
                self._reduce()
                build.call(upright, [ir.Constant(INDEX, self.N), self._triangle()])
            self.keep(squares)
        build.ret_void()
        return self.module


def write_costs(program: Program, lanes: int) -> ir.Module:
    """LLVM module with the function `costs`: sums of squared weighted residuals."""
    return _Costs(program, lanes, "costs", ("squares",), 0).write()


def write_look(program: Program, starts: Sequence[int], lanes: int) -> ir.Module:
    """LLVM module with the function `look`: rows or triangles, and the sums of squares. The program has derivatives."""
    return _Look(program, starts, lanes).write()
