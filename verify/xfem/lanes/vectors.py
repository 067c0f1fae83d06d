"""Vectors of `LANES` numbers in kernels, which the compiler does not find in every loop by itself.

They hold 64-bit floats, on whatever width the machine has. There are no bounds checks: callers
count. A block of 3 × 3 is a vector of its first eight entries, and its ninth.
"""

from typing import Any

from numba import types
from numba.core.cgutils import ir  # of llvmlite, which numba comes with
from numba.extending import intrinsic, models, register_model

__all__ = [
    "LANES",
    "WIDE",
    "Vector",
    "fetch",
    "load",
    "mean",
    "minus",
    "no_lanes",
    "plus",
    "store",
    "transposed",
    "wide_at",
]

LANES = 8  #: pieces that a kernel computes with at once
WIDE = ir.VectorType(ir.DoubleType(), LANES)  #: such a vector for the compiler
_TRANSPOSED = [0, 3, 6, 1, 4, 7, 2, 5]  # where the first eight entries of a transposed block are


class Vector(types.Type):
    """Type of a vector in a kernel.

    Parameters
    ----------
    wide : llvmlite.ir.VectorType
        What it is for the compiler.
    """

    def __init__(self, wide: Any) -> None:
        self.wide = wide
        super().__init__(name=f"Vector({wide.count})")


@register_model(Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, kind.wide)


_LANES_TYPE = Vector(WIDE)


def wide_at(builder: Any, address: Any, at: Any, wide: Any = WIDE) -> Any:
    """Address of the vector that begins at place `at`, for what generates code."""
    return builder.bitcast(builder.gep(address, [at]), wide.as_pointer())


def _load(typing, address, at):
    """Consecutive numbers from place `at` on."""

    def generate(context, builder, signature, arguments):
        return builder.load(wide_at(builder, *arguments), align=8)

    return _LANES_TYPE(address, types.intp), generate


def _store(typing, address, at, vector):
    """Write consecutive numbers from place `at` on."""

    def generate(context, builder, signature, arguments):
        address, at, numbers = arguments
        builder.store(numbers, wide_at(builder, address, at, numbers.type), align=8)
        return context.get_dummy_value()

    return types.void(address, types.intp, vector), generate


def _fetch(typing, address, at):
    """Have what is at place `at` brought to the first cache, to be read soon."""

    def generate(context, builder, signature, arguments):
        byte, word = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte, word, word, word])
        prefetch = builder.module.declare_intrinsic("llvm.prefetch", [byte], kind)
        place = builder.bitcast(builder.gep(arguments[0], [arguments[1]]), byte)
        builder.call(prefetch, [place, word(0), word(3), word(1)])
        return context.get_dummy_value()

    return types.void(address, types.intp), generate


def _no_lanes(typing):
    """Nothing but zeros."""

    def generate(context, builder, signature, arguments):
        return ir.Constant(WIDE, None)

    return _LANES_TYPE(), generate


def _plus(typing, a, b):
    def generate(context, builder, signature, arguments):
        return builder.fadd(*arguments)

    return a(a, b), generate


def _minus(typing, a, b):
    def generate(context, builder, signature, arguments):
        return builder.fsub(*arguments)

    return a(a, b), generate


def _mean(typing, a, b):
    def generate(context, builder, signature, arguments):
        half = ir.Constant(WIDE, [0.5] * LANES)
        return builder.fmul(builder.fadd(*arguments), half)

    return _LANES_TYPE(a, b), generate


def _transposed(typing, block):
    """First eight entries of the transposed 3 × 3 block; its ninth stays."""

    def generate(context, builder, signature, arguments):
        places = ir.Constant(ir.VectorType(ir.IntType(32), LANES), _TRANSPOSED)
        return builder.shuffle_vector(arguments[0], ir.Constant(WIDE, ir.Undefined), places)

    return _LANES_TYPE(block), generate


# as they are called in kernels, without the context of typing
load: Any = intrinsic(_load)
store: Any = intrinsic(_store)
fetch: Any = intrinsic(_fetch)
no_lanes: Any = intrinsic(_no_lanes)
plus: Any = intrinsic(_plus)
minus: Any = intrinsic(_minus)
mean: Any = intrinsic(_mean)
transposed: Any = intrinsic(_transposed)
