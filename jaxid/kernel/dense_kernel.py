"""Programs for decompositions of small dense matrices: one matrix a lane, L lanes of a group side by side.

Arrays are laid out group by group: A [G, m, n, L].
"""

from collections.abc import Callable

from llvmlite import ir

from .emit import DOUBLE, INDEX, Builder, Loop, Value, place

ROWS = 32
"""Rows of a matrix that are reduced at a time: with some tens of columns they stay in the processor's nearest cache."""
_CHAINS = 4
"""Sums that run side by side, since each addition waits for the one before it."""
_LEAST_SQUARE = 1e-280
"""Sum of squares below which a column is zero: its reciprocal root would overflow."""
_SWEEPS = 40


class _Dense:
    """Writes `void <name>(sizes..., A, results...)`, into a module of its own or beside what another one has."""

    def __init__(self, name: str, sizes: int, arrays: int, lanes: int, module: ir.Module | None = None):
        self.module = ir.Module(name=name) if module is None else module
        self.lanes, self.vector = lanes, ir.VectorType(DOUBLE, lanes)
        kinds = [INDEX] * sizes + [DOUBLE.as_pointer()] * arrays
        self.function = ir.Function(self.module, ir.FunctionType(ir.VoidType(), kinds), name)
        self.sizes, self.arrays = self.function.args[:sizes], self.function.args[sizes:]
        for array in self.arrays:
            array.add_attribute("noalias")
        self.build: Builder = ir.IRBuilder(self.function.append_basic_block("entry"))

    def constant(self, value: float) -> Value:
        return ir.Constant(self.vector, [value] * self.lanes)

    def called(self, name: str, *values: Value) -> Value:
        kind = ir.FunctionType(self.vector, [self.vector] * len(values))
        full = f"llvm.{name}.v{self.lanes}f64"
        known = self.module.globals.get(full)
        return self.build.call(known or ir.Function(self.module, kind, full), values)

    def at(self, array: Value, *digits: tuple[Value | int, Value | int]) -> Value:
        """Address of a lane's group of numbers."""
        build = self.build
        if array.type == self.vector.as_pointer():
            return build.gep(array, [place(build, *digits)])
        behind = build.gep(array, [build.mul(place(build, *digits), ir.Constant(INDEX, self.lanes))])
        return build.bitcast(behind, self.vector.as_pointer())

    def load(self, array: Value, *digits: tuple[Value | int, Value | int]) -> Value:
        return self.build.load(self.at(array, *digits), align=8)

    def store(self, value: Value, array: Value, *digits: tuple[Value | int, Value | int]) -> None:
        self.build.store(value, self.at(array, *digits), align=8)

    def plus_product(self, total: Value, a: Value, b: Value) -> Value:
        flags = ("contract",)
        return self.build.fadd(total, self.build.fmul(a, b, flags=flags), flags=flags)

    def minus_product(self, total: Value, a: Value, b: Value) -> Value:
        flags = ("contract",)
        return self.build.fsub(total, self.build.fmul(a, b, flags=flags), flags=flags)

    def chained(self, count: Value, each: Callable[[Value, Value], Value], name: str) -> Value:
        """Sum over `count` indices, a multiple of `_CHAINS`: `each(sum so far, index)`."""
        build = self.build
        with build.goto_entry_block():
            sums = [build.alloca(self.vector) for _ in range(_CHAINS)]
        for slot in sums:
            build.store(self.constant(0.0), slot)
        with Loop(build, build.sdiv(count, ir.Constant(INDEX, _CHAINS)), name) as block:
            for c, slot in enumerate(sums):
                i = build.add(build.mul(block, ir.Constant(INDEX, _CHAINS)), ir.Constant(INDEX, c))
                build.store(each(build.load(slot), i), slot)
        first, second, third, fourth = (build.load(slot) for slot in sums)
        return build.fadd(build.fadd(first, second), build.fadd(third, fourth))

    def after(self, index: Value) -> Value:
        return self.build.add(index, ir.Constant(INDEX, 1))


def write_reduction(module: ir.Module, lanes: int) -> ir.Function:
    """Adds `reduction(n, block, R)`: the rows of a `block` [n, ROWS, L], column by column, are taken under the triangle R
    [n, n, L]. The block is used up.

    Householder's reflections (Golub and Van Loan, Matrix Computations, 4th edition, section 5.1 and 6.5).
    """
    to = _Dense("reduction", 1, 2, lanes, module)
    to.function.linkage = "internal"
    to.function.attributes.add("noinline")
    build, (n,), (block, R) = to.build, to.sizes, to.arrays
    rows = ir.Constant(INDEX, ROWS)
    zero, one = to.constant(0.0), to.constant(1.0)

    def over(j: Value, i: Value) -> tuple[tuple[Value | int, Value | int], ...]:
        return (j, n), (i, ROWS)

    def entry(j: Value, k: Value) -> tuple[tuple[Value | int, Value | int], ...]:
        return (j, n), (k, n)

    with Loop(build, n, "column") as j:

        def squared(total: Value, i: Value) -> Value:
            x = to.load(block, *over(j, i))
            return to.plus_product(total, x, x)

        below = to.chained(rows, squared, "length")
        alpha = to.load(R, *entry(j, j))
        some = build.fcmp_ordered(">", below, to.constant(_LEAST_SQUARE))
        length = to.called("sqrt", to.plus_product(below, alpha, alpha))
        beta = build.fsub(zero, to.called("copysign", length, alpha))
        pivot = build.select(some, build.fsub(alpha, beta), one)
        share = build.select(some, build.fdiv(one, pivot), zero)
        tau = build.select(some, build.fdiv(build.fsub(beta, alpha), build.select(some, beta, one)), zero)
        to.store(build.select(some, beta, alpha), R, *entry(j, j))
        with Loop(build, rows, "scale") as i:
            to.store(build.fmul(to.load(block, *over(j, i)), share), block, *over(j, i))
        with Loop(build, build.sub(build.sub(n, j), ir.Constant(INDEX, 1)), "other") as after:
            k = build.add(to.after(j), after)

            def along(total: Value, i: Value) -> Value:
                return to.plus_product(total, to.load(block, *over(j, i)), to.load(block, *over(k, i)))

            top = to.load(R, *entry(j, k))
            w = build.fmul(tau, build.fadd(top, to.chained(rows, along, "along")))
            to.store(build.fsub(top, w), R, *entry(j, k))
            with Loop(build, rows, "reflect") as i:
                x = to.minus_product(to.load(block, *over(k, i)), w, to.load(block, *over(j, i)))
                to.store(x, block, *over(k, i))
    build.ret_void()
    return to.function


def write_uprighting(module: ir.Module, lanes: int) -> ir.Function:
    """Adds `upright(n, R)`: the rows of a triangle R [n, n, L] turned so that its diagonal is not negative."""
    to = _Dense("upright", 1, 1, lanes, module)
    to.function.linkage = "internal"
    build, (n,), (R,) = to.build, to.sizes, to.arrays
    zero = to.constant(0.0)
    with Loop(build, n, "upright") as j:
        down = build.fcmp_ordered("<", to.load(R, (j, n), (j, n)), zero)
        with Loop(build, build.sub(n, j), "turned") as after:
            k = build.add(j, after)
            x = to.load(R, (j, n), (k, n))
            to.store(build.select(down, build.fsub(zero, x), x), R, (j, n), (k, n))
    build.ret_void()
    return to.function


def write_triangle(lanes: int) -> ir.Module:
    """`triangle(G, m, n, A, R)`: the triangle R [G, n, n, L] of A = Q R, its diagonal not negative.

    Block of rows by block of rows, each under the triangle of those before it: the matrix is read once, and nothing of its
    size is written.
    """
    to = _Dense("triangle", 3, 2, lanes)
    reduction, upright = write_reduction(to.module, lanes), write_uprighting(to.module, lanes)
    build, (G, m, n), (A, R) = to.build, to.sizes, to.arrays
    rows = ir.Constant(INDEX, ROWS)
    block = build.alloca(to.vector, build.mul(n, rows))  # [n, ROWS]: column by column
    zero = to.constant(0.0)
    with Loop(build, G, "group") as g:
        with Loop(build, n, "clear.row") as j, Loop(build, n, "clear.column") as k:
            to.store(zero, R, (g, G), (j, n), (k, n))
        own = build.bitcast(to.at(R, (g, G), (0, n), (0, n)), DOUBLE.as_pointer())
        with Loop(build, build.sdiv(build.add(m, ir.Constant(INDEX, ROWS - 1)), rows), "block") as b:
            first = build.mul(b, rows)
            left = build.sub(m, first)
            full = build.select(build.icmp_signed("<", left, rows), left, rows)
            with Loop(build, full, "read.row") as i, Loop(build, n, "read.column") as k:
                to.store(to.load(A, (g, G), (build.add(first, i), m), (k, n)), block, (k, n), (i, ROWS))
            with Loop(build, build.sub(rows, full), "fill.row") as i, Loop(build, n, "fill.column") as k:
                to.store(zero, block, (k, n), (build.add(full, i), ROWS))
            build.call(reduction, [n, build.bitcast(block, DOUBLE.as_pointer()), own])
        build.call(upright, [n, own])
    build.ret_void()
    return to.module


def write_rotation(lanes: int) -> ir.Module:
    """`rotation(G, m, n, A, B, V)`: V [G, n, n, L] orthogonal such that the rows of B = (A V)ᵀ [G, n, m, L] are orthogonal,
    V's columns as rows. The rows' lengths are A's singular values.

    One-sided Jacobi rotations (Hestenes 1958; Golub and Van Loan, section 8.6.3), which find the small singular values of
    a badly scaled triangle as accurately as the large ones.
    """
    to = _Dense("rotation", 3, 3, lanes)
    build, (G, m, n), (A, B, V) = to.build, to.sizes, to.arrays
    squares = build.alloca(to.vector, n)
    turned = build.alloca(INDEX)
    zero, one, two = to.constant(0.0), to.constant(1.0), to.constant(2.0)
    tiny = build.fmul(build.sitofp(build.add(m, n), DOUBLE), ir.Constant(DOUBLE, 2.0**-53))
    tiny = build.fmul(tiny, tiny)
    tolerance: Value = ir.Constant(to.vector, ir.Undefined)
    for lane in range(lanes):
        tolerance = build.insert_element(tolerance, tiny, ir.Constant(INDEX, lane))
    with Loop(build, G, "group") as g:

        def column(j: Value, i: Value) -> tuple[tuple[Value | int, Value | int], ...]:
            return (g, G), (j, n), (i, m)

        def unit(j: Value, i: Value) -> tuple[tuple[Value | int, Value | int], ...]:
            return (g, G), (j, n), (i, n)

        with Loop(build, n, "copy.column") as j:
            with Loop(build, m, "copy.row") as i:
                to.store(to.load(A, (g, G), (i, m), (j, n)), B, *column(j, i))
            with Loop(build, n, "one.row") as i:
                diagonal = build.icmp_signed("==", i, j)
                to.store(build.select(diagonal, one, zero), V, *unit(j, i))
        build.store(ir.Constant(INDEX, 1), turned)
        with Loop(build, ir.Constant(INDEX, _SWEEPS), "sweep"):
            again = build.icmp_signed("!=", build.load(turned), ir.Constant(INDEX, 0))
            build.store(ir.Constant(INDEX, 0), turned)
            with build.if_then(again):
                with Loop(build, n, "norm") as j:
                    build.store(zero, build.gep(squares, [j]))
                    with Loop(build, m, "norm.row") as i:
                        x, slot = to.load(B, *column(j, i)), build.gep(squares, [j])
                        build.store(to.plus_product(build.load(slot), x, x), slot)
                with (
                    Loop(build, n, "first") as p,
                    Loop(build, build.sub(build.sub(n, p), ir.Constant(INDEX, 1)), "second") as r,
                ):
                    q = build.add(to.after(p), r)
                    with build.goto_entry_block():
                        slot = build.alloca(to.vector)
                    build.store(zero, slot)
                    with Loop(build, m, "dot") as i:
                        product = to.plus_product(
                            build.load(slot), to.load(B, *column(p, i)), to.load(B, *column(q, i))
                        )
                        build.store(product, slot)
                    dot = build.load(slot)
                    first, second = (build.gep(squares, [x]) for x in (p, q))
                    a, b = build.load(first), build.load(second)
                    askew = build.fcmp_ordered(">", build.fmul(dot, dot), build.fmul(tolerance, build.fmul(a, b)))
                    word = build.bitcast(askew, ir.IntType(lanes))
                    some = build.icmp_unsigned("!=", word, ir.Constant(ir.IntType(lanes), 0))
                    with build.if_then(some):
                        build.store(ir.Constant(INDEX, 1), turned)
                        safe = build.select(askew, dot, one)
                        zeta = build.fdiv(build.fsub(b, a), build.fmul(two, safe))
                        root = to.called("sqrt", to.plus_product(one, zeta, zeta))
                        t = build.fdiv(to.called("copysign", one, zeta), build.fadd(to.called("fabs", zeta), root))
                        cosine = build.fdiv(one, to.called("sqrt", to.plus_product(one, t, t)))
                        t = build.select(askew, t, zero)
                        cosine = build.select(askew, cosine, one)
                        sine = build.fmul(cosine, t)
                        build.store(to.minus_product(a, t, dot), first)
                        build.store(to.plus_product(b, t, dot), second)
                        for array, where, count in ((B, column, m), (V, unit, n)):
                            with Loop(build, count, "turn") as i:
                                x, y = to.load(array, *where(p, i)), to.load(array, *where(q, i))
                                left = to.minus_product(build.fmul(cosine, x), sine, y)
                                to.store(left, array, *where(p, i))
                                to.store(to.plus_product(build.fmul(sine, x), cosine, y), array, *where(q, i))
    build.ret_void()
    return to.module


def write_solution(lanes: int) -> ir.Module:
    """`solution(G, n, m, A, X)`: X [G, n, m - n, L] of S X = B, A = [S, B] [G, n, m, L] and S symmetric positive definite.

    Gaussian elimination, which needs no pivoting there (Golub and Van Loan, section 4.2).
    """
    to = _Dense("solution", 3, 2, lanes)
    build, (G, n, m), (A, X) = to.build, to.sizes, to.arrays
    work = build.alloca(to.vector, build.mul(n, m))
    one = ir.Constant(INDEX, 1)
    k = build.sub(m, n)

    def entry(i: Value, j: Value) -> tuple[tuple[Value | int, Value | int], ...]:
        return (i, n), (j, m)

    with Loop(build, G, "group") as g:
        with Loop(build, n, "copy.row") as i, Loop(build, m, "copy.column") as j:
            to.store(to.load(A, (g, G), (i, n), (j, m)), work, *entry(i, j))
        with Loop(build, n, "pivot") as p, Loop(build, build.sub(build.sub(n, p), one), "below") as below:
            i = build.add(to.after(p), below)
            share = build.fdiv(to.load(work, *entry(i, p)), to.load(work, *entry(p, p)))
            with Loop(build, build.sub(m, p), "along") as along:
                j = build.add(p, along)
                left = to.minus_product(to.load(work, *entry(i, j)), share, to.load(work, *entry(p, j)))
                to.store(left, work, *entry(i, j))
        with Loop(build, n, "up") as from_below:
            p = build.sub(build.sub(n, one), from_below)
            with Loop(build, k, "column") as c:
                j = build.add(n, c)
                with Loop(build, from_below, "known") as known:
                    q = build.add(to.after(p), known)
                    solved = to.load(work, *entry(q, j))
                    left = to.minus_product(to.load(work, *entry(p, j)), to.load(work, *entry(p, q)), solved)
                    to.store(left, work, *entry(p, j))
                x = build.fdiv(to.load(work, *entry(p, j)), to.load(work, *entry(p, p)))
                to.store(x, work, *entry(p, j))
                to.store(x, X, (g, G), (p, n), (c, k))
    build.ret_void()
    return to.module
