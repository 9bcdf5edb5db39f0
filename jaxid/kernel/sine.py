"""Sine and cosine of vectors, in vector instructions; the C library's would be called lane by lane.

The angle is reduced to [-π/4, π/4] by whole quarters in three parts of π/2, each product exact (Cody and Waite, Software Manual
for the Elementary Functions, 1980), and put into the polynomials of FreeBSD's libm (msun, k_sin.c and k_cos.c), whose errors
are below the last digit's. Angles of more than a thousand million, and what is no number, are the library's.
"""

from typing import Any

from llvmlite import ir

Builder = Any
Value = Any
_DOUBLE = ir.DoubleType()

_PARTS = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33)
_SINE = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
_COSINE = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)
_LARGEST = 1e9


class _Vector:
    """Arithmetic on vectors."""

    def __init__(self, module: ir.Module, build: Builder, lanes: int):
        self.module, self.build, self.lanes = module, build, lanes
        self.kind = ir.VectorType(_DOUBLE, lanes)

    def constant(self, value: float) -> Value:
        return ir.Constant(self.kind, [value] * self.lanes)

    def called(self, name: str, *values: Value) -> Value:
        full = f"llvm.{name}.v{self.lanes}f64"
        kind = ir.FunctionType(self.kind, [self.kind] * len(values))
        return self.build.call(self.module.globals.get(full) or ir.Function(self.module, kind, full), values)

    def fma(self, a: Value, b: Value, c: Value) -> Value:
        return self.called("fma", a, b, c)

    def polynomial(self, x: Value, coefficients: tuple[float, ...]) -> Value:
        total = self.constant(coefficients[-1])
        for c in reversed(coefficients[:-1]):
            total = self.fma(total, x, self.constant(c))
        return total


def sine_and_cosine(module: ir.Module, lanes: int) -> ir.Function:
    """The module's function of a vector that gives its sines and cosines, {vector, vector}."""
    name = "sine_and_cosine"
    if name in module.globals:
        return module.globals[name]
    kind = ir.VectorType(_DOUBLE, lanes)
    both = ir.LiteralStructType([kind, kind])
    function = ir.Function(module, ir.FunctionType(both, [kind]), name)
    function.linkage = "internal"
    (x,) = function.args
    build: Builder = ir.IRBuilder(function.append_basic_block("entry"))
    to = _Vector(module, build, lanes)
    size = to.called("fabs", x)
    usual = build.fcmp_ordered("<", size, to.constant(_LARGEST))
    word = ir.IntType(lanes)
    all_usual = build.icmp_unsigned("==", build.bitcast(usual, word), ir.Constant(word, -1))
    fast, slow = function.append_basic_block("fast"), function.append_basic_block("slow")
    build.cbranch(all_usual, fast, slow)

    build.position_at_end(slow)
    results = []
    for which in ("sin", "cos"):
        results.append(to.called(which, x))
    build.ret(_pair(build, both, *results))

    build.position_at_end(fast)
    quarters = to.called("rint", build.fmul(x, to.constant(2.0 / 3.141592653589793)))
    back, r = build.fneg(quarters), x
    for part in _PARTS:
        r = to.fma(back, to.constant(part), r)
    z = build.fmul(r, r)
    sine = to.fma(build.fmul(r, z), to.polynomial(z, _SINE), r)
    half = build.fmul(z, to.constant(0.5))
    most = build.fsub(to.constant(1.0), half)
    rest = build.fsub(build.fsub(to.constant(1.0), most), half)
    cosine = build.fadd(most, to.fma(build.fmul(z, z), to.polynomial(z, _COSINE), rest))
    whole = to.called("floor", build.fmul(quarters, to.constant(0.25)))
    turn = to.fma(to.constant(-4.0), whole, quarters)  # 0, 1, 2 or 3
    is_1, is_3 = (build.fcmp_ordered("==", turn, to.constant(value)) for value in (1.0, 3.0))
    odd = build.or_(is_1, is_3)
    a, b = build.select(odd, cosine, sine), build.select(odd, sine, cosine)
    down = build.fcmp_ordered(">=", turn, to.constant(2.0))
    left = build.or_(is_1, build.fcmp_ordered("==", turn, to.constant(2.0)))
    a, b = build.select(down, build.fneg(a), a), build.select(left, build.fneg(b), b)
    build.ret(_pair(build, both, a, b))
    return function


def _pair(build: Builder, both: ir.Type, a: Value, b: Value) -> Value:
    return build.insert_value(build.insert_value(ir.Constant(both, ir.Undefined), a, 0), b, 1)
