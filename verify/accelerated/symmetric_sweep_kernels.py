"""Sweeps over the upper half of a symmetric matrix in nodal blocks, K = L + D + Lᵀ.

Only blocks above the diagonal are read, those of a row as they lie, forwards and backwards: where
the cache holds most of them, the sweep back finds what the sweep there has left. Blocks of three
are multiplied row by row in vectors of four numbers, so that vectors over the nodes have a fourth
component, which is zero (`vector_width`); others take general loops.
"""

from numba import njit

from verify.xfem.lanes.node_vectors import (
    WIDTH,
    add_product,
    add_rows,
    load_node,
    load_three,
    no_node,
    row_sums,
    three,
)
from verify.xfem.lanes.shuffles import address
from verify.xfem.lanes.vectors import fetch, minus, plus, store

__all__ = ["add_lower_product", "solve_lower", "solve_upper", "symmetric_product", "vector_width"]

_AHEAD = 4  # rows by which blocks are brought to the cache before they are read
_LINE = 8  # numbers in a line of the cache


def vector_width(size: int) -> int:
    """Numbers of each node, for blocks of this size, in the vectors that the sweeps take."""
    return WIDTH if size == 3 else size


@njit(cache=True)
def _fetch_row(row, starts, diagonal, blocks):
    """Have the blocks of a row above the diagonal brought to the cache."""
    for place in range(9 * diagonal[row] + 9, 9 * starts[row + 1], _LINE):
        fetch(blocks, place)


@njit(cache=True)
def solve_upper(starts, columns, diagonal, blocks, inverse, p, t, e, u):
    """Find t = (D + Lᵀ)⁻¹ p, with e = Lᵀ t and u = D t = p − e.

    Parameters
    ----------
    starts, columns, diagonal : int arrays
        Pattern.
    blocks : (B, d, d) float array
    inverse : (N, d, `vector_width`) float array
        Of the diagonal blocks.
    p : (N, `vector_width`) float array
    t, e, u : (N, `vector_width`) float array
        Overwritten.
    """
    if blocks.shape[1] == 3:
        _solve_upper_3(
            len(diagonal), address(starts), address(columns), address(diagonal), address(blocks),
            address(inverse), address(p), address(t), address(e), address(u),
        )  # fmt: skip
        return
    size = blocks.shape[1]
    for row in range(len(diagonal) - 1, -1, -1):
        for k in range(size):
            e[row, k] = 0.0
            for at in range(diagonal[row] + 1, starts[row + 1]):
                for l in range(size):
                    e[row, k] += blocks[at, k, l] * t[columns[at], l]
            u[row, k] = p[row, k] - e[row, k]
        for k in range(size):
            t[row, k] = 0.0
            for l in range(size):
                t[row, k] += inverse[row, k, l] * u[row, l]


@njit(cache=True)
def _solve_upper_3(rows, starts, columns, diagonal, blocks, inverse, p, t, e, u):
    for row in range(rows - 1, -1, -1):
        if row >= _AHEAD:
            _fetch_row(row - _AHEAD, starts, diagonal, blocks)
        a = b = c = no_node()
        # backwards: the neighbour whose value is the last to be known comes last
        for back in range(starts[row + 1] - 1 - diagonal[row]):
            place = starts[row + 1] - 1 - back
            at, node = 9 * place, load_node(t, WIDTH * columns[place])
            a = add_product(a, load_node(blocks, at), node)
            b = add_product(b, load_node(blocks, at + 3), node)
            c = add_product(c, load_node(blocks, at + 6), node)
        beside = row_sums(a, b, c)
        rest = minus(load_node(p, WIDTH * row), beside)
        store(e, WIDTH * row, beside)
        store(u, WIDTH * row, rest)
        store(t, WIDTH * row, add_rows(no_node(), inverse, 3 * WIDTH * row, WIDTH, rest))


@njit(cache=True)
def solve_lower(starts, columns, diagonal, blocks, inverse, g, s):
    """Find s = (D + L)⁻¹ g; of g only D s is left.

    Parameters
    ----------
    starts, columns, diagonal, blocks, inverse
        As for `solve_upper`.
    g : (N, `vector_width`) float array
        Right-hand side.
    s : (N, `vector_width`) float array
        Overwritten.
    """
    if blocks.shape[1] == 3:
        _solve_lower_3(
            len(diagonal), address(starts), address(columns), address(diagonal), address(blocks),
            address(inverse), address(g), address(s),
        )  # fmt: skip
        return
    size = blocks.shape[1]
    for row in range(len(diagonal)):
        for k in range(size):
            s[row, k] = 0.0
            for l in range(size):
                s[row, k] += inverse[row, k, l] * g[row, l]
        for at in range(diagonal[row] + 1, starts[row + 1]):
            for k in range(size):
                for l in range(size):
                    g[columns[at], l] -= blocks[at, k, l] * s[row, k]


@njit(cache=True)
def _solve_lower_3(rows, starts, columns, diagonal, blocks, inverse, g, s):
    for row in range(rows):
        if row + _AHEAD < rows:
            _fetch_row(row + _AHEAD, starts, diagonal, blocks)
        rest = load_node(g, WIDTH * row)
        store(g, WIDTH * row, three(rest))  # the fourth number is what stood beside blocks
        node = add_rows(no_node(), inverse, 3 * WIDTH * row, WIDTH, rest)
        store(s, WIDTH * row, node)
        negative = minus(no_node(), node)
        for place in range(diagonal[row] + 1, starts[row + 1]):
            other = WIDTH * columns[place]
            store(g, other, add_rows(load_node(g, other), blocks, 9 * place, 3, negative))


@njit(cache=True)
def add_lower_product(starts, columns, diagonal, blocks, s, out):
    """Add L s (N, `vector_width`) to `out`."""
    size = blocks.shape[1]
    if size == 3:
        _add_lower_product_3(
            len(diagonal), address(starts), address(columns), address(diagonal), address(blocks),
            address(s), address(out),
        )  # fmt: skip
        return
    for row in range(len(diagonal)):
        for at in range(diagonal[row] + 1, starts[row + 1]):
            for k in range(size):
                for l in range(size):
                    out[columns[at], l] += blocks[at, k, l] * s[row, k]


@njit(cache=True)
def _add_lower_product_3(rows, starts, columns, diagonal, blocks, s, out):
    for row in range(rows):
        if row + _AHEAD < rows:
            _fetch_row(row + _AHEAD, starts, diagonal, blocks)
        node = load_node(s, WIDTH * row)
        for place in range(diagonal[row] + 1, starts[row + 1]):
            other = WIDTH * columns[place]
            store(out, other, add_rows(load_node(out, other), blocks, 9 * place, 3, node))
        store(out, WIDTH * row, three(load_node(out, WIDTH * row)))


@njit(cache=True)
def symmetric_product(starts, columns, diagonal, blocks, x, out):
    """Write K x (N, `vector_width`) to `out`."""
    out[:] = 0.0
    size = blocks.shape[1]
    if size == 3:
        _symmetric_product_3(
            len(diagonal), address(starts), address(columns), address(diagonal), address(blocks),
            address(x), address(out),
        )  # fmt: skip
        return
    for row in range(len(diagonal)):
        for k in range(size):
            for at in range(diagonal[row], starts[row + 1]):
                for l in range(size):
                    out[row, k] += blocks[at, k, l] * x[columns[at], l]
    add_lower_product(starts, columns, diagonal, blocks, x, out)


@njit(cache=True)
def _symmetric_product_3(rows, starts, columns, diagonal, blocks, x, out):
    for row in range(rows):
        if row + _AHEAD < rows:
            _fetch_row(row + _AHEAD, starts, diagonal, blocks)
        here, middle = load_node(x, WIDTH * row), 9 * diagonal[row]
        a = add_product(no_node(), load_node(blocks, middle), here)
        b = add_product(no_node(), load_node(blocks, middle + 3), here)
        c = add_product(no_node(), load_three(blocks, middle + 6), here)  # the last of all, once
        for place in range(diagonal[row] + 1, starts[row + 1]):
            at, other = 9 * place, WIDTH * columns[place]
            node = load_node(x, other)
            a = add_product(a, load_node(blocks, at), node)
            b = add_product(b, load_node(blocks, at + 3), node)
            c = add_product(c, load_node(blocks, at + 6), node)
            store(out, other, add_rows(load_node(out, other), blocks, at, 3, here))
        store(out, WIDTH * row, plus(three(load_node(out, WIDTH * row)), row_sums(a, b, c)))
