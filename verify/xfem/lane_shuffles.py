"""Two operations on vectors of `LANES` numbers that the compiler does not find in loops by itself.

Both work on 64-bit floats, on whatever width the machine has. There are no bounds checks: callers
count.
"""

from typing import Any

from numba import types
from numba.core.cgutils import ir  # of llvmlite, which numba comes with
from numba.extending import intrinsic

from verify.xfem.polar_kernels import LANES

__all__ = ["add_vector", "address", "transpose_square"]

_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_MASK = ir.VectorType(ir.IntType(32), LANES)


def _vector(builder, address, at):
    return builder.bitcast(builder.gep(address, [at]), _VECTOR.as_pointer())


def _address(typing, array):
    """Where a flat array begins: handed on without counting references, which takes longer."""

    def generate(context, builder, signature, arguments):
        return context.make_array(signature.args[0])(context, builder, arguments[0]).data

    return types.CPointer(array.dtype)(array), generate


def _transpose_square(typing, entries, at):
    """Transpose the `LANES` × `LANES` numbers at `entries` from place `at` on, row after row.

    By log₂ `LANES` exchanges of neighbouring squares, each twice as wide as the one before.
    """

    def generate(context, builder, signature, arguments):
        entries, at = arguments
        rows = [
            _vector(builder, entries, builder.add(at, ir.Constant(at.type, LANES * row)))
            for row in range(LANES)
        ]
        held = [builder.load(row, align=8) for row in rows]
        width = 1
        while width < LANES:
            upper = [LANES + l - width if l & width else l for l in range(LANES)]
            lower = [LANES + l if l & width else l + width for l in range(LANES)]
            for row in range(LANES):
                if not row & width:
                    a, b = held[row], held[row + width]
                    held[row] = builder.shuffle_vector(a, b, ir.Constant(_MASK, upper))
                    held[row + width] = builder.shuffle_vector(a, b, ir.Constant(_MASK, lower))
            width *= 2
        for row, numbers in zip(rows, held, strict=True):
            builder.store(numbers, row, align=8)
        return context.get_dummy_value()

    return types.void(entries, types.intp), generate


def _add_vector(typing, target, place, entries, at):
    """Add `LANES` consecutive numbers at `entries`, from `at` on, to those at `target`."""

    def generate(context, builder, signature, arguments):
        target, place, entries, at = arguments
        into, numbers = _vector(builder, target, place), _vector(builder, entries, at)
        total = builder.fadd(builder.load(into, align=8), builder.load(numbers, align=8))
        builder.store(total, into, align=8)
        return context.get_dummy_value()

    return types.void(target, types.intp, entries, types.intp), generate


# as they are called in kernels, without the context of typing
address: Any = intrinsic(_address)
transpose_square: Any = intrinsic(_transpose_square)
add_vector: Any = intrinsic(_add_vector)
