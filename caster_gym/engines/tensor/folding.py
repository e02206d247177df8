"""Removes sums and products with zero parameters of a robot from what Torch compiles.

A robot without friction, offsets and armatures multiplies nearly half of its terms by zero. Torch's compiler keeps
them, since 0 · x and 0 / x are not zero where x is no number, or 0; in the mechanics such an x shows in the inertial
terms anyway. Graphs that write into tensors are left as they are.
"""

import operator
from typing import Any, TypeAlias

from torch._inductor.custom_graph_pass import CustomGraphPass, get_hash_for_files
from torch.fx import Graph, Node
from torch.fx.node import map_arg

Worth: TypeAlias = Any  # a node, or the number that it always is


class Folding(CustomGraphPass):
    """A pass of Torch's compiler over a function's graph, before it is differentiated."""

    def uuid(self) -> Any:
        """What stands for this pass in the keys of the compiler's cache."""
        return get_hash_for_files((__file__,))

    def __call__(self, graph: Graph) -> None:
        """Fold the graph."""
        if any(_writes(node) for node in graph.nodes):
            return
        worth: dict[Node, Worth] = {}

        def same(node: Node) -> Node:
            found = worth.get(node)
            return found if isinstance(found, Node) else node  # a number is a tensor to whoever reads it

        for node in graph.nodes:
            if node.op == "call_function" and node.target in _RULES and _kind(node)[1].is_floating_point:
                operands = tuple(worth.get(one, one) if isinstance(one, Node) else one for one in node.args)
                folded = _RULES[node.target](*operands)
                if folded is not None and (not isinstance(folded, Node) or _kind(folded) == _kind(node)):
                    worth[node] = folded
                    continue
                if any(isinstance(one, Node) and _kind(one) == _kind(node) for one in operands):
                    node.args = operands
                    continue
            node.args, node.kwargs = map_arg(node.args, same), map_arg(node.kwargs, same)
        graph.eliminate_dead_code()


def _writes(node: Node) -> bool:
    """Whether a node changes a tensor: a method with an underscore behind its name, or an operator's own."""
    if node.op == "call_method":
        return str(node.target).endswith("_")
    return node.op == "call_function" and node.target in _WRITING


def _is(operand: Worth, number: float) -> bool:
    return isinstance(operand, int | float) and operand == number


def _product(a: Worth, b: Worth) -> Worth:
    """0, or the factor beside 1; None where neither holds."""
    if _is(a, 0.0) or _is(b, 0.0):
        return 0.0
    return b if _is(a, 1.0) else a if _is(b, 1.0) else None


def _quotient(a: Worth, b: Worth) -> Worth:
    return 0.0 if _is(a, 0.0) else a if _is(b, 1.0) else None


def _sum(a: Worth, b: Worth) -> Worth:
    return b if _is(a, 0.0) else a if _is(b, 0.0) else None


def _difference(a: Worth, b: Worth) -> Worth:
    return a if _is(b, 0.0) else None


def _kind(node: Node) -> Any:
    """Shape and precision: an operand that is broadcast cannot stand for the result."""
    value = node.meta["example_value"]
    return value.shape, value.dtype


_RULES = {operator.mul: _product, operator.truediv: _quotient, operator.add: _sum, operator.sub: _difference}
_WRITING = {operator.setitem, operator.iadd, operator.isub, operator.imul, operator.itruediv}
