"""Vectors of three components at a node and a fourth number, which fills the vector, in kernels.

As `vectors`: 64-bit floats, without bounds checks.
"""

from typing import Any

from numba import types
from numba.core.cgutils import ir  # of llvmlite, which numba comes with
from numba.extending import intrinsic

from verify.xfem.lanes.vectors import Vector, wide_at

__all__ = [
    "WIDTH",
    "add_product",
    "add_rows",
    "load_node",
    "load_three",
    "no_node",
    "row_sums",
    "three",
]

WIDTH = 4  #: numbers of a node
_WIDE = ir.VectorType(ir.DoubleType(), WIDTH)
_NODE = Vector(_WIDE)
_ZERO = ir.Constant(_WIDE, None)


def _shuffled(builder, a, b, lanes):
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), lanes))


def _fused(builder, total, a, b):
    product = builder.fmul(a, b, flags=("contract",))
    return builder.fadd(total, product, flags=("contract",))


def _load_node(typing, address, at):
    """`WIDTH` consecutive numbers from place `at` on."""

    def generate(context, builder, signature, arguments):
        address, at = arguments
        return builder.load(wide_at(builder, address, at, _WIDE), align=8)

    return _NODE(address, types.intp), generate


def _load_three(typing, address, at):
    """Three numbers from place `at` on, and zero: nothing behind them is read."""

    def generate(context, builder, signature, arguments):
        address, at = arguments
        before = builder.sub(at, ir.Constant(at.type, 1))
        numbers = builder.load(wide_at(builder, address, before, _WIDE), align=8)
        return _shuffled(builder, numbers, _ZERO, [1, 2, 3, WIDTH])

    return _NODE(address, types.intp), generate


def _no_node(typing):
    """Nothing but zeros."""

    def generate(context, builder, signature, arguments):
        return _ZERO

    return _NODE(), generate


def _three(typing, node):
    """Keep three components, and let the fourth number be zero."""

    def generate(context, builder, signature, arguments):
        return _shuffled(builder, arguments[0], _ZERO, [0, 1, 2, WIDTH])

    return _NODE(node), generate


def _add_product(typing, total, a, b):
    """Add a b number by number, rounded once where the machine can."""

    def generate(context, builder, signature, arguments):
        return _fused(builder, *arguments)

    return _NODE(total, a, b), generate


def _add_rows(typing, total, matrix, at, step, node):
    """Add the three rows of a matrix from place `at` on, each times its component at a node.

    That is the transposed matrix times the vector. Rows are `step` numbers apart, which is literal;
    their fourth numbers come into the fourth number of the sum.
    """

    def generate(context, builder, signature, arguments):
        total, matrix, at, _, node = arguments
        for row in range(3):
            place = builder.add(at, ir.Constant(at.type, row * step.literal_value))
            numbers = builder.load(wide_at(builder, matrix, place, _WIDE), align=8)
            each = _shuffled(builder, node, _ZERO, [row] * WIDTH)
            total = _fused(builder, total, numbers, each)
        return total

    return _NODE(total, matrix, types.intp, step, node), generate


def _row_sums(typing, x, y, z):
    """Add up the first three numbers of each; the fourth sum is zero."""

    def generate(context, builder, signature, arguments):
        x, y, z = arguments
        even, odd = _shuffled(builder, x, y, [0, 4, 2, 6]), _shuffled(builder, x, y, [1, 5, 3, 7])
        outer, inner = (_shuffled(builder, z, _ZERO, [k, 4, 2, 4]) for k in (0, 1))
        firsts = _shuffled(builder, even, outer, [0, 1, 4, 5])
        seconds = _shuffled(builder, odd, inner, [0, 1, 4, 5])
        thirds = _shuffled(builder, even, outer, [2, 3, 6, 7])
        return builder.fadd(builder.fadd(firsts, thirds), seconds)

    return _NODE(x, y, z), generate


# as they are called in kernels, without the context of typing
load_node: Any = intrinsic(_load_node)
load_three: Any = intrinsic(_load_three)
no_node: Any = intrinsic(_no_node)
three: Any = intrinsic(_three)
add_product: Any = intrinsic(_add_product)
add_rows: Any = intrinsic(prefer_literal=True)(_add_rows)
row_sums: Any = intrinsic(_row_sums)
