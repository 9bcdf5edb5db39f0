"""One program for expressions at many points, or along many sequences of rows: L points or sequences side by side.

Arrays are laid out group by group (G groups, T rows one after the other): p [P], the same for all;

    rows [G, T, n, L]   carried [G, C, L], before the first row   ->   y [G, T, Y, L]
"""

from collections.abc import Sequence
from typing import NamedTuple

from llvmlite import ir

from .emit import DOUBLE, INDEX, Builder, Loop, Value, Writer, levels, place, reached
from .expressions import Graph, Node


class Mapped(NamedTuple):
    """Expressions `outputs` of a row. Inputs of the graph: groups "p", "row" (`rows` of them) and "carried", whose next
    values are `carried`."""

    graph: Graph
    rows: int
    outputs: Sequence[Node]
    carried: Sequence[Node] = ()


def write_map(mapped: Mapped, lanes: int) -> ir.Module:
    """LLVM module with the function `map(G, T, p, rows, carried, y)`."""
    module = ir.Module(name="map")
    kinds = [INDEX] * 2 + [DOUBLE.as_pointer()] * 4
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), "map")
    G, T, p, rows, carried, y = function.args
    for array in (p, rows, carried, y):
        array.add_attribute("noalias")
    build: Builder = ir.IRBuilder(function.append_basic_block("entry"))
    writer = Writer(mapped.graph, module, lanes)
    vector, width = writer.kind, ir.Constant(INDEX, lanes)
    state = [build.alloca(vector, name=f"x{i}") for i in range(len(mapped.carried))]

    def address(array: Value, *digits: tuple[Value | int, Value | int]) -> Value:
        behind = build.gep(array, [build.mul(place(build, *digits), width)])
        return build.bitcast(behind, vector.as_pointer())

    def same(value: Value) -> Value:
        first = build.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
        return build.shuffle_vector(first, first, ir.Constant(ir.VectorType(ir.IntType(32), lanes), [0] * lanes))

    def given(build: Builder, group: str, i: int) -> Value:
        if group == "p":
            return same(build.load(build.gep(p, [ir.Constant(INDEX, i)])))
        if group == "carried":
            return build.load(state[i])
        return build.load(address(rows, (g, G), (t, T), (i, mapped.rows)), align=8)

    needed = reached(mapped.graph, [*mapped.outputs, *mapped.carried])
    depth = levels(mapped.graph, needed, {"p": 0, "row": 1, "carried": 1})
    writer.write(build, [k for k in needed if depth[k] == 0], given)
    constant = dict(writer.values)
    with Loop(build, G, "group") as g:
        for i, slot in enumerate(state):
            build.store(build.load(address(carried, (g, G), (i, len(state))), align=8), slot)
        with Loop(build, T, "row") as t:
            writer.values = dict(constant)
            writer.write(build, needed, given)
            for i, node in enumerate(mapped.outputs):
                build.store(writer.values[node], address(y, (g, G), (t, T), (i, len(mapped.outputs))), align=8)
            for slot, node in zip(state, mapped.carried, strict=True):
                build.store(writer.values[node], slot)
    build.ret_void()
    return module
