"""Scalar expressions as a graph in which equal expressions stand once and known numbers are folded."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

Node = int
"""An expression, by its number in a `Graph`. Arguments have smaller numbers than what uses them."""

_COMPARE: dict[str, Callable[[float, float], bool]] = {
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "gt": lambda a, b: a > b,
    "ge": lambda a, b: a >= b,
    "eq": lambda a, b: a == b,
    "ne": lambda a, b: a != b,
}
_FOLD: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "mul": lambda a, b: a * b,
    "max": lambda a, b: math.nan if math.isnan(a) or math.isnan(b) else max(a, b),
    "min": lambda a, b: math.nan if math.isnan(a) or math.isnan(b) else min(a, b),
    "abs": abs,
    "floor": math.floor,
    "round": round,  # half to even, as XLA's ROUND_TO_NEAREST_EVEN
    **_COMPARE,
}


class Graph:
    """Expressions built so far: `nodes[i]` is (operation, arguments), a constant ("const", (value,)) or an input
    ("input", (group, index))."""

    def __init__(self) -> None:
        self.nodes: list[tuple[str, tuple]] = []
        self.partials: dict[Node, list[tuple[Node, Node]]] = {}
        """Of expressions with a derivative rule of their own: what they depend on, and the partial derivative by it."""
        self._known: dict[tuple[str, tuple], Node] = {}

    def _intern(self, operation: str, arguments: tuple) -> Node:
        key = (operation, arguments)
        found = self._known.get(key)
        if found is None:
            found = self._known[key] = len(self.nodes)
            self.nodes.append(key)
        return found

    def constant(self, value: float | bool) -> Node:
        """A known number."""
        value = float(value)
        # Minus zero is zero here: no rollout divides by it on purpose.
        return self._intern("const", (0.0 if value == 0.0 else value,))

    def input(self, group: str, index: int) -> Node:
        """A number that is given when the program runs."""
        return self._intern("input", (group, index))

    def value(self, node: Node) -> float | None:
        """The number that a constant stands for, else None."""
        operation, arguments = self.nodes[node]
        return arguments[0] if operation == "const" else None

    def add(self, a: Node, b: Node) -> Node:
        va, vb = self.value(a), self.value(b)
        if va == 0.0:
            return b
        if vb == 0.0:
            return a
        if va is not None and vb is not None:
            return self.constant(va + vb)
        for x, y in ((a, b), (b, a)):
            if self.nodes[y][0] == "neg":
                return self.sub(x, self.nodes[y][1][0])
        return self._intern("add", (min(a, b), max(a, b)))

    def sub(self, a: Node, b: Node) -> Node:
        va, vb = self.value(a), self.value(b)
        if a == b:
            return self.constant(0.0)
        if vb == 0.0:
            return a
        if va == 0.0:
            return self.neg(b)
        if va is not None and vb is not None:
            return self.constant(va - vb)
        if self.nodes[b][0] == "neg":
            return self.add(a, self.nodes[b][1][0])
        return self._intern("sub", (a, b))

    def neg(self, a: Node) -> Node:
        operation, arguments = self.nodes[a]
        if operation == "const":
            return self.constant(-arguments[0])
        if operation == "neg":
            return arguments[0]
        if operation == "sub":
            return self._intern("sub", (arguments[1], arguments[0]))
        return self._intern("neg", (a,))

    def mul(self, a: Node, b: Node) -> Node:
        va, vb = self.value(a), self.value(b)
        if va == 0.0 or vb == 0.0:
            return self.constant(0.0)
        if va is not None and vb is not None:
            return self.constant(va * vb)
        for v, other in ((va, b), (vb, a)):
            if v == 1.0:
                return other
            if v == -1.0:
                return self.neg(other)
        (oa, xa), (ob, xb) = self.nodes[a], self.nodes[b]
        if oa == "neg" and ob == "neg":
            return self.mul(xa[0], xb[0])
        if oa == "neg":
            return self.neg(self.mul(xa[0], b))
        if ob == "neg":
            return self.neg(self.mul(a, xb[0]))
        return self._intern("mul", (min(a, b), max(a, b)))

    def div(self, a: Node, b: Node) -> Node:
        va, vb = self.value(a), self.value(b)
        if va == 0.0:
            return self.constant(0.0)
        if vb is not None and vb != 0.0:
            return self.mul(a, self.constant(1.0 / vb))
        # One reciprocal serves all divisions by the same value.
        return self.mul(a, self._intern("reciprocal", (b,)))

    def select(self, which: Node, if_false: Node, if_true: Node) -> Node:
        v = self.value(which)
        if v is not None:
            return if_true if v else if_false
        if if_false == if_true:
            return if_true
        return self._intern("select", (which, if_false, if_true))

    def power(self, a: Node, exponent: int) -> Node:
        """`a` to a whole power, by repeated squaring."""
        if exponent < 0:
            return self.div(self.constant(1.0), self.power(a, -exponent))
        result, square = self.constant(1.0), a
        while exponent:
            if exponent & 1:
                result = self.mul(result, square)
            exponent >>= 1
            if exponent:
                square = self.mul(square, square)
        return result

    def apply(self, operation: str, *arguments: Node) -> Node:
        """Any other operation, folded where all its arguments are known."""
        values = [self.value(argument) for argument in arguments]
        if operation in _FOLD and all(v is not None for v in values):
            return self.constant(_FOLD[operation](*values))
        if operation in ("sqrt", "exp", "log", "tanh", "sin", "cos") and values[0] is not None:
            if not (operation in ("sqrt", "log") and values[0] <= 0.0):
                return self.constant(getattr(math, operation)(values[0]))
        if operation in ("max", "min") and arguments[0] == arguments[1]:
            return arguments[0]
        return self._intern(operation, arguments)

    def replaced(self, outputs: Sequence[Node], by: Mapping[Node, Node]) -> list[Node]:
        """`outputs` with other expressions in the place of some that they are made of."""
        needed, stack = set(), list(outputs)
        while stack:
            node = stack.pop()
            if node not in needed and node not in by:
                needed.add(node)
                stack += (*self.arguments(node), *(x for pair in self.partials.get(node, ()) for x in pair))
        rules = {"add": self.add, "sub": self.sub, "mul": self.mul, "neg": self.neg, "select": self.select}
        rules["reciprocal"] = partial(self.div, self.constant(1.0))
        after = dict(by)
        for node in sorted(needed):  # arguments have smaller numbers
            there = [after[a] for a in self.arguments(node)]
            operation = self.nodes[node][0]
            same = there == list(self.arguments(node))
            after[node] = node if same else rules.get(operation, partial(self.apply, operation))(*there)
        for node in needed & self.partials.keys():
            if after[node] != node and self.value(after[node]) is None:
                own = [(after[argument], after[slope]) for argument, slope in self.partials[node]]
                self.partials.setdefault(after[node], own)
        return [after[node] for node in outputs]

    def arguments(self, node: Node) -> tuple[Node, ...]:
        """What an expression is made of, one step down."""
        operation, arguments = self.nodes[node]
        return () if operation in ("const", "input") else arguments
