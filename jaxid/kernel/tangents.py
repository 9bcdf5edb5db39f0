"""Derivatives of scalar expressions, forward and backward; what a tangent cannot reach costs nothing.

Backward (Griewank and Walther, Evaluating Derivatives, 2nd edition, section 3.2) each result takes one sweep, whatever the
number of inputs: of a step with few states and many parameters, a third of the products that forward takes.
"""

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


def _arguments(graph: Graph, node: Node) -> list[Node]:
    """What an expression's derivative is made of."""
    if node in graph.partials:
        return [argument for argument, _ in graph.partials[node]]
    operation, x = graph.nodes[node]
    return [] if operation in ("const", "input") else list(x)


def _below(graph: Graph, outputs: Sequence[Node]) -> set[Node]:
    """`outputs` and all that their derivatives are made of."""
    needed, stack = set(), list(outputs)
    while stack:
        node = stack.pop()
        if node not in needed:
            needed.add(node)
            stack += _arguments(graph, node)
    return needed


def backward(graph: Graph, output: Node, seeds: Sequence[Node]) -> list[Node]:
    """Derivatives of one result by some inputs.

    A branch that a `select` does not choose has no part in them, even where its own derivatives are not finite, as forward.
    """
    needed, zero = _below(graph, [output]), graph.constant(0.0)
    moved = set(seeds)
    for node in sorted(needed):  # arguments have smaller numbers
        if any(argument in moved for argument in _arguments(graph, node)):
            moved.add(node)
    chosen = [n for n in needed if graph.nodes[n][0] == "select" and n not in graph.partials]
    maybe_not = _below(graph, [branch for node in chosen for branch in graph.nodes[node][1][1:]])
    adjoints = {output: graph.constant(1.0)}
    for node in sorted(needed & moved, reverse=True):
        adjoint = adjoints.get(node, zero)
        if adjoint == zero:
            continue
        operation, x = graph.nodes[node]
        if operation == "select" and node not in graph.partials:
            terms = [(x[1], graph.select(x[0], adjoint, zero)), (x[2], graph.select(x[0], zero, adjoint))]
        else:
            terms = [(a, graph.mul(partial, adjoint)) for a, partial in _partials(graph, node) if a in moved]
            if node in maybe_not and graph.value(adjoint) is None:
                unused = graph.apply("eq", adjoint, zero)
                terms = [(a, term if term == adjoint else graph.select(unused, term, zero)) for a, term in terms]
        for argument, term in terms:
            if argument in moved:
                before = adjoints.get(argument)
                adjoints[argument] = term if before is None else graph.add(before, term)
    return [adjoints.get(seed, zero) for seed in seeds]


def forward(graph: Graph, outputs: Sequence[Node], seeds: Mapping[Node, Node]) -> list[Node]:
    """Tangents of `outputs` for the tangents `seeds` of some inputs."""
    tangents = dict(seeds)
    zero = graph.constant(0.0)
    for node in sorted(_below(graph, outputs)):  # arguments have smaller numbers
        if node not in tangents:
            tangent = _passed_on(graph, node, tangents)
            if tangent is not None and tangent != zero:
                tangents[node] = tangent
    return [tangents.get(node, zero) for node in outputs]
