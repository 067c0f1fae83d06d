"""Dense loops over columns of a matrix, in vectors of eight that stay in registers.

What the compiler makes of such loops keeps sums in memory and leaves the end of each column to
single numbers, half of it for columns as short as those of a small body. Columns here begin
at multiples of eight and end there, with zeros. There are no bounds checks: callers count.

Matrices are given by where they begin (`lanes.shuffles.address`), columns lie `step` numbers apart.
"""

from typing import Any

from numba import njit, types
from numba.core import cgutils
from numba.core.cgutils import ir  # of llvmlite, which numba comes with
from numba.extending import intrinsic

__all__ = [
    "COLUMNS",
    "ROWS",
    "add_run",
    "padded",
    "project_columns",
    "substitute",
    "subtract_columns",
    "subtract_product",
]

ROWS = 8  #: numbers in a vector; rows come in multiples of it
COLUMNS = 4  #: of a tile

_NUMBER, _INDEX = ir.DoubleType(), ir.IntType(64)
_VECTOR = ir.VectorType(_NUMBER, ROWS)
_FLAGS = ("contract",)  # to fused multiply-adds


@njit(cache=True)
def padded(length):
    """Round a number of rows up to one that vectors fill."""
    return (length + ROWS - 1) // ROWS * ROWS


def _vector(builder, address, at):
    return builder.bitcast(builder.gep(address, [at]), _VECTOR.as_pointer())


def _repeated(builder, number):
    """Vector of one number."""
    alone = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), number, _INDEX(0))
    first = ir.Constant(ir.VectorType(ir.IntType(32), ROWS), [0] * ROWS)
    return builder.shuffle_vector(alone, ir.Constant(_VECTOR, ir.Undefined), first)


def _tile(vectors):
    """Make C −= A Bᵀ for `ROWS` · `vectors` rows and `COLUMNS` columns of C."""

    def subtract(typing, target, at, target_step, factor, left, right, step, depth):
        def generate(context, builder, signature, arguments):
            target, at, target_step, factor, left, right, step, depth = arguments
            sums = [
                [cgutils.alloca_once_value(builder, ir.Constant(_VECTOR, [0.0] * ROWS))
                 for _ in range(vectors)]
                for _ in range(COLUMNS)
            ]  # fmt: skip
            with cgutils.for_range(builder, depth) as loop:
                column = builder.mul(loop.index, step)
                rows = builder.add(left, column)
                a = [
                    builder.load(_vector(builder, factor, builder.add(rows, _INDEX(ROWS * v))),
                                 align=8)
                    for v in range(vectors)
                ]  # fmt: skip
                others = builder.add(right, column)
                for k in range(COLUMNS):
                    place = builder.gep(factor, [builder.add(others, _INDEX(k))])
                    b = _repeated(builder, builder.load(place))
                    for v in range(vectors):
                        product = builder.fmul(a[v], b, flags=_FLAGS)
                        total = builder.fadd(builder.load(sums[k][v]), product, flags=_FLAGS)
                        builder.store(total, sums[k][v])
            for k in range(COLUMNS):
                rows = builder.add(at, builder.mul(target_step, _INDEX(k)))
                for v in range(vectors):
                    into = _vector(builder, target, builder.add(rows, _INDEX(ROWS * v)))
                    left_over = builder.fsub(builder.load(into, align=8), builder.load(sums[k][v]))
                    builder.store(left_over, into, align=8)
            return context.get_dummy_value()

        counts = (types.intp, types.intp)
        return types.void(target, *counts, factor, *counts, *counts), generate

    return subtract


_subtract_3: Any = intrinsic(_tile(3))
_subtract_2: Any = intrinsic(_tile(2))
_subtract_1: Any = intrinsic(_tile(1))


@njit(cache=True)
def subtract_product(target, at, target_step, factor, left, right, step, rows, columns, depth):
    """Take A Bᵀ from a matrix.

    Parameters
    ----------
    target, at, target_step
        Matrix, its first number, and the way to the next column.
    factor, left, right, step
        Matrix of which A and B are rows; first number of A and of B.
    rows, columns : int
        Of the matrix: multiples of `ROWS` and of `COLUMNS`.
    depth : int
        Columns of A and B.
    """
    row = 0
    while row < rows:
        # two and two are faster than three and one, whose sums wait for each other
        left_over = rows - row
        count = 3 if left_over >= 5 * ROWS or left_over == 3 * ROWS else min(2, left_over // ROWS)
        for column in range(0, columns, COLUMNS):
            into = at + column * target_step + row
            if count == 3:
                _subtract_3(target, into, target_step, factor, left + row, right + column, step,
                            depth)  # fmt: skip
            elif count == 2:
                _subtract_2(target, into, target_step, factor, left + row, right + column, step,
                            depth)  # fmt: skip
            else:
                _subtract_1(target, into, target_step, factor, left + row, right + column, step,
                            depth)  # fmt: skip
        row += count * ROWS


def _substitute(typing, columns, at, step, rows, factor):
    """Solve X Lᵀ = A in place, A of `COLUMNS` columns and `rows` rows.

    `factor` is L row by row, with the inverses of its diagonal.
    """

    def generate(context, builder, signature, arguments):
        columns, at, step, rows, factor = arguments
        entries = [
            _repeated(builder, builder.load(builder.gep(factor, [_INDEX(k)])))
            for k in range(COLUMNS * (COLUMNS + 1) // 2)
        ]
        begins = [builder.add(at, builder.mul(step, _INDEX(k))) for k in range(COLUMNS)]
        with cgutils.for_range(builder, builder.sdiv(rows, _INDEX(ROWS))) as loop:
            row = builder.mul(loop.index, _INDEX(ROWS))
            places = [_vector(builder, columns, builder.add(begin, row)) for begin in begins]
            solved: list[Any] = []
            for k in range(COLUMNS):
                left_over, first = builder.load(places[k], align=8), k * (k + 1) // 2
                for j in range(k):
                    product = builder.fmul(solved[j], entries[first + j], flags=_FLAGS)
                    left_over = builder.fsub(left_over, product, flags=_FLAGS)
                solved.append(builder.fmul(left_over, entries[first + k]))
            for place, numbers in zip(places, solved, strict=True):
                builder.store(numbers, place, align=8)
        return context.get_dummy_value()

    counts = (types.intp, types.intp, types.intp)
    return types.void(columns, *counts, factor), generate


substitute: Any = intrinsic(_substitute)


def _add_run(typing, target, place, source, at, count):
    """Add `count` consecutive numbers at `source`, from `at` on, to those at `target`."""

    def generate(context, builder, signature, arguments):
        target, place, source, at, count = arguments
        whole = builder.sdiv(count, _INDEX(ROWS))
        with cgutils.for_range(builder, whole) as loop:
            row = builder.mul(loop.index, _INDEX(ROWS))
            into = _vector(builder, target, builder.add(place, row))
            numbers = _vector(builder, source, builder.add(at, row))
            total = builder.fadd(builder.load(into, align=8), builder.load(numbers, align=8))
            builder.store(total, into, align=8)
        done = builder.mul(whole, _INDEX(ROWS))
        left_over = builder.sub(count, done)
        with builder.if_then(builder.icmp_signed(">", left_over, _INDEX(0))):
            into = _vector(builder, target, builder.add(place, done))
            numbers = _vector(builder, source, builder.add(at, done))
            lanes = ir.VectorType(_INDEX, ROWS)
            alone = builder.insert_element(ir.Constant(lanes, ir.Undefined), left_over, _INDEX(0))
            first = ir.Constant(ir.VectorType(ir.IntType(32), ROWS), [0] * ROWS)
            ends = builder.shuffle_vector(alone, ir.Constant(lanes, ir.Undefined), first)
            within = builder.icmp_signed("<", ir.Constant(lanes, list(range(ROWS))), ends)
            load, store = _masked(builder.module)
            nothing, line = ir.Constant(_VECTOR, [0.0] * ROWS), ir.IntType(32)(8)
            total = builder.fadd(
                builder.call(load, [into, line, within, nothing]),
                builder.call(load, [numbers, line, within, nothing]),
            )
            builder.call(store, [total, into, line, within])
        return context.get_dummy_value()

    return types.void(target, types.intp, source, types.intp, types.intp), generate


def _masked(module):
    """Load and store of some lanes of a vector."""
    pointer, lanes = _VECTOR.as_pointer(), ir.VectorType(ir.IntType(1), ROWS)
    line, nothing = ir.IntType(32), ir.VoidType()
    load = ir.FunctionType(_VECTOR, (pointer, line, lanes, _VECTOR))
    store = ir.FunctionType(nothing, (_VECTOR, pointer, line, lanes))
    return (
        cgutils.get_or_insert_function(module, load, f"llvm.masked.load.v{ROWS}f64.p0"),
        cgutils.get_or_insert_function(module, store, f"llvm.masked.store.v{ROWS}f64.p0"),
    )


add_run: Any = intrinsic(_add_run)


def _subtract_columns(typing, target, at, columns, begin, step, rows, factors):
    """Take `COLUMNS` columns, each times its factor, from `rows` numbers of `target`."""

    def generate(context, builder, signature, arguments):
        target, at, columns, begin, step, rows, factors = arguments
        entries = [
            _repeated(builder, builder.load(builder.gep(factors, [_INDEX(k)])))
            for k in range(COLUMNS)
        ]
        begins = [builder.add(begin, builder.mul(step, _INDEX(k))) for k in range(COLUMNS)]
        with cgutils.for_range(builder, builder.sdiv(rows, _INDEX(ROWS))) as loop:
            row = builder.mul(loop.index, _INDEX(ROWS))
            into = _vector(builder, target, builder.add(at, row))
            left_over = builder.load(into, align=8)
            for k in range(COLUMNS):
                column = builder.load(
                    _vector(builder, columns, builder.add(begins[k], row)), align=8
                )
                product = builder.fmul(column, entries[k], flags=_FLAGS)
                left_over = builder.fsub(left_over, product, flags=_FLAGS)
            builder.store(left_over, into, align=8)
        return context.get_dummy_value()

    counts = (types.intp, types.intp, types.intp)
    return types.void(target, types.intp, columns, *counts, factors), generate


subtract_columns: Any = intrinsic(_subtract_columns)


def _project_columns(typing, numbers, at, columns, begin, step, rows, products):
    """Write the products of `COLUMNS` columns with `rows` numbers."""

    def generate(context, builder, signature, arguments):
        numbers, at, columns, begin, step, rows, products = arguments
        sums = [
            cgutils.alloca_once_value(builder, ir.Constant(_VECTOR, [0.0] * ROWS))
            for _ in range(COLUMNS)
        ]
        begins = [builder.add(begin, builder.mul(step, _INDEX(k))) for k in range(COLUMNS)]
        with cgutils.for_range(builder, builder.sdiv(rows, _INDEX(ROWS))) as loop:
            row = builder.mul(loop.index, _INDEX(ROWS))
            vector = builder.load(_vector(builder, numbers, builder.add(at, row)), align=8)
            for k in range(COLUMNS):
                column = builder.load(
                    _vector(builder, columns, builder.add(begins[k], row)), align=8
                )
                product = builder.fmul(column, vector, flags=_FLAGS)
                total = builder.fadd(builder.load(sums[k]), product, flags=_FLAGS)
                builder.store(total, sums[k])
        for k in range(COLUMNS):
            total, width = builder.load(sums[k]), ROWS
            while width > 1:
                width //= 2
                half = ir.VectorType(ir.IntType(32), width)
                low, high = (
                    builder.shuffle_vector(
                        total, total, ir.Constant(half, list(range(first, first + width)))
                    )
                    for first in (0, width)
                )
                total = builder.fadd(low, high)
            alone = builder.extract_element(total, _INDEX(0))
            builder.store(alone, builder.gep(products, [_INDEX(k)]))
        return context.get_dummy_value()

    counts = (types.intp, types.intp, types.intp)
    return types.void(numbers, types.intp, columns, *counts, products), generate


project_columns: Any = intrinsic(_project_columns)
