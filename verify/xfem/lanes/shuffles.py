"""Between records of `LANES` numbers, one of each lane, and rows that hold one number of each.

A square of `LANES` × `LANES` numbers is transposed in registers on the way. There are no bounds
checks: callers count.
"""

from typing import Any

from numba import types
from numba.core.cgutils import ir  # of llvmlite, which numba comes with
from numba.extending import intrinsic

from verify.xfem.lanes.vectors import LANES, WIDE, wide_at

__all__ = ["add_to_records", "address", "gather_records"]

_MASK = ir.VectorType(ir.IntType(32), LANES)


def _address(typing, array):
    """Where a flat array begins: handed on without counting references, which takes longer."""

    def generate(context, builder, signature, arguments):
        return context.make_array(signature.args[0])(context, builder, arguments[0]).data

    return types.CPointer(array.dtype)(array), generate


def _transpose(builder, held):
    """Exchange neighbouring squares log₂ `LANES` times, each twice as wide as the one before."""
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


def _later(builder, at, distance):
    return builder.add(at, ir.Constant(at.type, distance))


def _record(builder, records, places, first, lane, step):
    """Address of the record of a lane."""
    place = builder.load(builder.gep(places, [_later(builder, first, lane * step)]))
    place = builder.zext(place, first.type)
    return wide_at(builder, records, builder.mul(place, ir.Constant(place.type, LANES)))


def _gather_records(typing, records, places, first, step, rows, at, count):
    """Write the first `count` numbers of the records places[first + `step` lane] as rows.

    Row k goes to `rows` from at + k `LANES` on. `step` and `count` are literal.
    """

    def generate(context, builder, signature, arguments):
        records, places, first, _, rows, at, _ = arguments
        held = [
            builder.load(
                _record(builder, records, places, first, lane, step.literal_value), align=8
            )
            for lane in range(LANES)
        ]
        _transpose(builder, held)
        for k in range(count.literal_value):
            builder.store(held[k], wide_at(builder, rows, _later(builder, at, k * LANES)), align=8)
        return context.get_dummy_value()

    return types.void(records, places, types.intp, step, rows, types.intp, count), generate


def _add_to_records(typing, records, places, first, step, rows, at, count):
    """Add rows to the first `count` numbers of records; the same arguments the other way."""

    def generate(context, builder, signature, arguments):
        records, places, first, _, rows, at, _ = arguments
        held = [
            builder.load(wide_at(builder, rows, _later(builder, at, k * LANES)), align=8)
            for k in range(count.literal_value)
        ]
        held += [ir.Constant(WIDE, None)] * (LANES - len(held))
        _transpose(builder, held)
        for lane in range(LANES):
            record = _record(builder, records, places, first, lane, step.literal_value)
            builder.store(builder.fadd(builder.load(record, align=8), held[lane]), record, align=8)
        return context.get_dummy_value()

    return types.void(records, places, types.intp, step, rows, types.intp, count), generate


# as they are called in kernels, without the context of typing
address: Any = intrinsic(_address)
gather_records: Any = intrinsic(prefer_literal=True)(_gather_records)
add_to_records: Any = intrinsic(prefer_literal=True)(_add_to_records)
