"""Forward derivatives of scalar expressions; what a tangent cannot reach costs nothing."""

from collections.abc import Mapping, Sequence

from .expressions import Graph, Node
from .symbolic import Untranslated

_FLAT = {
    "floor",
    "round",
    "sign",
    "trunc",
    "lt",
    "le",
    "gt",
    "ge",
    "eq",
    "ne",
    "and",
    "or",
    "not",
    "is_finite",
    "input",
}


_LEAST = 1e-15
"""Roots below which their slope, endless at zero, grows no further: v |v|^(1/2) and the root of v² + w² have slopes at rest,
which would come out as zero times infinity."""


def _partials(graph: Graph, node: Node) -> list[tuple[Node, Node]]:
    """(argument, partial derivative by it) of one expression, by JAX's own rules, ties included, but for roots at zero."""
    if node in graph.partials:
        return graph.partials[node]
    operation, x = graph.nodes[node]
    one = graph.constant(1.0)
    if operation in _FLAT or operation == "const":
        return []
    if operation == "add":
        return [(x[0], one), (x[1], one)]
    if operation == "sub":
        return [(x[0], one), (x[1], graph.constant(-1.0))]
    if operation == "neg":
        return [(x[0], graph.constant(-1.0))]
    if operation == "mul":
        return [(x[0], x[1]), (x[1], x[0])]
    if operation == "reciprocal":
        return [(x[0], graph.neg(graph.mul(node, node)))]
    if operation in ("max", "min"):
        # A tie goes halves to both, as in JAX.
        half, zero = graph.constant(0.5), graph.constant(0.0)
        tie = graph.apply("eq", x[0], x[1])
        first = graph.apply("gt" if operation == "max" else "lt", x[0], x[1])
        share = graph.select(tie, graph.select(first, zero, one), half)
        return [(x[0], share), (x[1], graph.sub(one, share))]
    if operation == "select":
        zero = graph.constant(0.0)
        return [(x[1], graph.select(x[0], one, zero)), (x[2], graph.select(x[0], zero, one))]
    if operation == "abs":
        up = graph.apply("ge", x[0], graph.constant(0.0))
        return [(x[0], graph.select(up, graph.constant(-1.0), one))]
    if operation == "sqrt":
        return [(x[0], graph.div(graph.constant(0.5), graph.apply("max", node, graph.constant(_LEAST))))]
    if operation == "exp":
        return [(x[0], node)]
    if operation == "log":
        return [(x[0], graph.div(one, x[0]))]
    if operation == "tanh":
        return [(x[0], graph.sub(one, graph.mul(node, node)))]
    if operation == "sin":
        return [(x[0], graph.apply("cos", x[0]))]
    if operation == "cos":
        return [(x[0], graph.neg(graph.apply("sin", x[0])))]
    if operation == "expm1":
        return [(x[0], graph.add(node, one))]
    if operation == "log1p":
        return [(x[0], graph.div(one, graph.add(one, x[0])))]
    if operation == "pow" and (exponent := graph.value(x[1])) is not None:
        base = x[0] if exponent >= 1.0 else graph.apply("max", x[0], graph.constant(_LEAST**2))
        return [(x[0], graph.mul(x[1], graph.apply("pow", base, graph.sub(x[1], one))))]
    if operation == "atan2":
        square = graph.add(graph.mul(x[0], x[0]), graph.mul(x[1], x[1]))
        return [(x[0], graph.div(x[1], square)), (x[1], graph.neg(graph.div(x[0], square)))]
    raise Untranslated(f"the derivative of {operation!r}")


def _passed_on(graph: Graph, node: Node, tangents: Mapping[Node, Node]) -> Node | None:
    """Tangent of one expression, given those of its arguments that have any."""
    operation, x = graph.nodes[node]
    if operation == "select" and node not in graph.partials:
        zero = graph.constant(0.0)
        a, b = tangents.get(x[1], zero), tangents.get(x[2], zero)
        return None if a == b == zero else graph.select(x[0], a, b)
    total: Node | None = None
    for argument, partial in _partials(graph, node):
        tangent = tangents.get(argument)
        if tangent is not None:
            term = graph.mul(partial, tangent)
            total = term if total is None else graph.add(total, term)
    return total


def forward(graph: Graph, outputs: Sequence[Node], seeds: Mapping[Node, Node]) -> list[Node]:
    """Tangents of `outputs` for the tangents `seeds` of some inputs."""
    needed, stack = set(), list(outputs)
    while stack:
        node = stack.pop()
        if node in needed:
            continue
        needed.add(node)
        if node in graph.partials:
            stack += [argument for argument, _ in graph.partials[node]]
        elif graph.nodes[node][0] not in ("const", "input"):
            stack += graph.nodes[node][1]
    tangents = dict(seeds)
    zero = graph.constant(0.0)
    for node in sorted(needed):  # arguments have smaller numbers
        if node not in tangents:
            tangent = _passed_on(graph, node, tangents)
            if tangent is not None and tangent != zero:
                tangents[node] = tangent
    return [tangents.get(node, zero) for node in outputs]
