"""From expressions to LLVM instructions on vectors: one lane an experiment."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from llvmlite import ir

from .expressions import Graph, Node
from .sine import sine_and_cosine

Builder = Any
Value = Any
"""Of llvmlite, whose types say less than its functions take."""
DOUBLE = ir.DoubleType()
INDEX = ir.IntType(64)
_MATHS = {"sqrt": "sqrt", "exp": "exp", "log": "log", "floor": "floor", "abs": "fabs", "round": "rint",
          "trunc": "trunc"}  # fmt: skip
_CIRCLE = ("sin", "cos")
_ORDERED = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}


class Loop:
    """A counted loop: `with Loop(build, count, name) as i:`."""

    def __init__(self, build: Builder, count: Value, name: str):
        self.build, self.count, self.name = build, count, name

    def __enter__(self) -> Value:
        build = self.build
        before = build.block
        self.head = build.append_basic_block(f"{self.name}.body")
        self.after = build.append_basic_block(f"{self.name}.after")
        zero = ir.Constant(INDEX, 0)
        build.cbranch(build.icmp_signed(">", self.count, zero), self.head, self.after)
        build.position_at_end(self.head)
        self.index = build.phi(INDEX, self.name)
        self.index.add_incoming(zero, before)
        return self.index

    def __exit__(self, *exception: object) -> None:
        build = self.build
        following = build.add(self.index, ir.Constant(INDEX, 1))
        self.index.add_incoming(following, build.block)
        build.cbranch(build.icmp_signed("<", following, self.count), self.head, self.after)
        build.position_at_end(self.after)


def place(build: Builder, *digits: tuple[Value | int, Value | int]) -> Value:
    """Row-major position of an element: (index, length) of each axis, the first axis outermost."""

    def value(x: Value | int) -> Value:
        return ir.Constant(INDEX, x) if isinstance(x, int) else x

    total = value(digits[0][0])
    for index, length in digits[1:]:
        total = build.add(build.mul(total, value(length)), value(index))
    return total


def reached(graph: Graph, outputs: Iterable[Node]) -> list[Node]:
    """What `outputs` are made of, arguments first."""
    seen: set[Node] = set()
    stack = list(outputs)
    while stack:
        node = stack.pop()
        if node in seen:
            continue
        seen.add(node)
        operation, arguments = graph.nodes[node]
        if operation not in ("const", "input"):
            stack += arguments
    return sorted(seen)


def levels(graph: Graph, nodes: Sequence[Node], level_of: Mapping[str, int]) -> dict[Node, int]:
    """How deep in the loops each expression must stand, from the levels of the groups of inputs it is made of."""
    found: dict[Node, int] = {}
    for node in nodes:
        operation, arguments = graph.nodes[node]
        if operation == "const":
            found[node] = 0
        elif operation == "input":
            found[node] = level_of[arguments[0]]
        else:
            found[node] = max(found[a] for a in arguments)
    return found


class Writer:
    """Writes expressions as instructions on vectors of `lanes` numbers, each at most once where it stands first."""

    def __init__(self, graph: Graph, module: ir.Module, lanes: int):
        self.graph, self.module = graph, module
        self.kind = ir.VectorType(DOUBLE, lanes)
        self.truth = ir.VectorType(ir.IntType(1), lanes)
        self.lanes = lanes
        self.values: dict[Node, Value] = {}
        self.circles: dict[Value, Value] = {}

    def constant(self, value: float) -> ir.Constant:
        return ir.Constant(self.kind, [value] * self.lanes)

    def _intrinsic(self, name: str, arguments: int = 1) -> ir.Function:
        full = f"llvm.{name}.v{self.lanes}f64"
        found = self.module.globals.get(full)
        return found or ir.Function(self.module, ir.FunctionType(self.kind, [self.kind] * arguments), full)

    def _library(self, build: Builder, name: str, arguments: Sequence[Value]) -> Value:
        """A function of the C library, lane by lane."""
        function = self.module.globals.get(name) or ir.Function(
            self.module, ir.FunctionType(DOUBLE, [DOUBLE] * len(arguments)), name
        )
        result: Value = ir.Constant(self.kind, ir.Undefined)
        for lane in range(self.lanes):
            at = ir.Constant(ir.IntType(32), lane)
            result = build.insert_element(
                result, build.call(function, [build.extract_element(a, at) for a in arguments]), at
            )
        return result

    def _truth(self, build: Builder, value: Value) -> Value:
        return value if value.type == self.truth else build.fcmp_unordered("!=", value, self.constant(0.0))

    def _instruction(self, build: Builder, operation: str, arguments: Sequence[Value]) -> Value:
        flags = ("contract",)
        if operation == "add":
            return build.fadd(*arguments, flags=flags)
        if operation == "sub":
            return build.fsub(*arguments, flags=flags)
        if operation == "mul":
            return build.fmul(*arguments, flags=flags)
        if operation == "neg":
            return build.fneg(arguments[0])
        if operation == "reciprocal":
            return build.fdiv(self.constant(1.0), arguments[0])
        if operation in _MATHS:
            return build.call(self._intrinsic(_MATHS[operation]), arguments)
        if operation in _ORDERED:
            compare = build.fcmp_unordered if operation == "ne" else build.fcmp_ordered
            return compare(_ORDERED[operation], *arguments)
        if operation in ("max", "min"):
            # NaN in either shows in the result, as in JAX.
            a, b = arguments
            first = build.fcmp_ordered(">" if operation == "max" else "<", a, b)
            chosen = build.select(first, a, b)
            return build.select(build.fcmp_unordered("uno", a, a), a, chosen)
        if operation == "select":
            which, if_false, if_true = arguments
            return build.select(self._truth(build, which), if_true, if_false)
        if operation in ("and", "or"):
            a, b = (self._truth(build, x) for x in arguments)
            return build.and_(a, b) if operation == "and" else build.or_(a, b)
        if operation == "not":
            return build.not_(self._truth(build, arguments[0]))
        if operation == "is_finite":
            x = arguments[0]
            return build.fcmp_ordered("==", build.fsub(x, x), self.constant(0.0))
        if operation == "sign":
            x, zero = arguments[0], self.constant(0.0)
            up = build.select(build.fcmp_ordered(">", x, zero), self.constant(1.0), x)
            return build.select(build.fcmp_ordered("<", x, zero), self.constant(-1.0), up)
        return self._library(build, operation, arguments)

    def _circle(self, build: Builder, angle: Node, which: int) -> Value:
        """Sine or cosine, worked out together once where the first stands."""
        x = self.values[angle]
        if x not in self.circles:
            self.circles[x] = build.call(sine_and_cosine(self.module, self.lanes), [x])
        return build.extract_value(self.circles[x], which)

    def write(self, build: Builder, nodes: Iterable[Node], given: Callable[[Builder, str, int], Value]):
        """Write `nodes`, arguments first; `given(build, group, index)` loads an input."""
        for node in nodes:
            if node in self.values:
                continue
            operation, arguments = self.graph.nodes[node]
            if operation == "const":
                self.values[node] = self.constant(arguments[0])
            elif operation == "input":
                self.values[node] = given(build, *arguments)
            elif operation in _CIRCLE:
                self.values[node] = self._circle(build, arguments[0], _CIRCLE.index(operation))
            else:
                self.values[node] = self._instruction(build, operation, [self.values[a] for a in arguments])
