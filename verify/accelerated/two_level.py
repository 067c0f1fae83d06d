"""Conjugate gradients with a coarse space: the rigid motions of parts of the body.

Gauß–Seidel alone leaves smooth errors, so that iterations grow with the number of nodes across a
body. The nodes are therefore divided into parts of some hundred, each connected and compact. Let Z
be the rigid motions of all parts, E = Zᵀ K Z, and M the sweeps of Gauß–Seidel forth and back. A
residual r is preconditioned by

    z = M r + Z E⁻¹ Zᵀ (r − K M r)

(A-DEF2 of J. M. Tang, R. Nabben, C. Vuik, Y. A. Erlangga, J. Sci. Comput. 39, 2009). A part that a
cut divides is two parts. Sweeps read the matrix in 32 bits: neither M nor the K above need be
exact, and half the memory is read faster.
"""

import numpy as np
from numba import njit
from scipy.sparse import csr_array

from verify.accelerated.conjugate_gradients import FUSED, SUMS, ConjugateGradients, solve_lower
from verify.xfem.arrays import Bools, Floats, Ints, SingularStiffnessError
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.linear_solvers import SparseLU
from verify.xfem.mesh import connected

_NODES = 4.0  # of a part, times N^⅓: the coarse solution then costs less than a sweep
_FEW = 0.1  # of them: what a cut leaves of a part goes to a neighbour
_LOST = 1e4  # times the square of the wanted residual: 1e-11 of the load for 1e-13
_SEEN = 1e-6  # of a residual: its share in rigid motions is more than round-off
_ALIKE = 1e-8  # of the largest: a rigid motion that moves the nodes of a part less is none
# displacement axes of rotations about z, x, y, and the axes of the arms that they are made of
_TURNS = ((1, 3, 0, 1.0), (0, 3, 1, -1.0), (2, 4, 1, 1.0), (1, 4, 2, -1.0), (0, 5, 2, 1.0),
          (2, 5, 0, -1.0))  # fmt: skip


class TwoLevel(ConjugateGradients):
    """Iterative solver of the statics of large solids, K x = b; see the module.

    Parameters
    ----------
    pattern : BlockPattern
    points : (N, 3) float array
        Nodes, m.
    fixed : (N, 3) bool array
        Components that supports prescribe, of which K has the diagonal alone.
    tolerance, limit
        As of `ConjugateGradients`.
    """

    def __init__(
        self, pattern: BlockPattern, points: Floats, fixed: Bools, tolerance: float, limit: int
    ) -> None:
        super().__init__(pattern, 3, tolerance, limit)
        self._part = _parts(pattern, points)
        self._modes = _rigid_motions(points, fixed, self._part)
        self._sparsity, self._place = _coarse_pattern(self._rows, self._columns, self._part)
        node, axis, mode = np.nonzero(self._modes)
        self._motions = csr_array(
            (self._modes[node, axis, mode], (3 * node + axis, 6 * self._part[node] + mode)),
            shape=(fixed.size, 6 * self._sparsity.node_count),
        )
        self._sums = self._motions.T.tocsr()
        self._independent = _independent(self._modes, self._part)

    def factorize(self, blocks: Floats) -> None:
        """Take the matrix, and factorise E; see `LinearSolver`."""
        super().factorize(blocks)
        self._short = self._upper.astype(np.float32)
        pattern, ways = self._sparsity, self._independent
        coarse = np.zeros((len(pattern.columns), 6, 6))
        add_coarse(
            self._rows, self._columns, self._upper, self._diagonal, self._modes, self._place,
            pattern.diagonal[self._part], coarse,
        )  # fmt: skip
        coarse += coarse[pattern.mirror].transpose(0, 2, 1)
        row = np.repeat(np.arange(pattern.node_count), np.diff(pattern.starts))
        coarse = ways[row].transpose(0, 2, 1) @ coarse @ ways[pattern.columns]
        coarse[pattern.diagonal] += np.eye(6) * ~ways.any(axis=1)[:, None]
        self._coarse = SparseLU(pattern, 6, definite=True)
        try:
            self._coarse.factorize(coarse)
        except SingularStiffnessError:  # where in the body is not known
            raise SingularStiffnessError(None) from None

    def _rigid(self, forces: Floats) -> Floats:
        """Return Z E⁻¹ Zᵀ of nodal forces (N, 3)."""
        ways = self._independent
        sums = (self._sums @ forces.ravel()).reshape(-1, 1, 6) @ ways
        moved = ways @ self._coarse.solve(sums[:, 0])[:, :, None]
        return (self._motions @ moved.ravel()).reshape(forces.shape)

    def _improve(self, is_zero: bool, target: float) -> tuple[int, float]:
        """Improve the first of the work vectors until ‖b − Kx‖² ≤ target; b is the second.

        Where round-off has left much more of the true residual, that is improved once more.
        """
        matrix = self._rows, self._columns, self._upper
        short = self._rows, self._columns, self._short
        x, r, s, t, w, p, q, load = self._work
        load[:] = r
        iteration, square = 0, np.inf
        for bearable in (0.0, _LOST * target):
            w[:] = 0.0
            if not is_zero:
                add_product(*matrix, self._diagonal, x, w)
            np.subtract(load, w, out=r)
            if iteration == self.limit or np.vdot(r, r) <= bearable:
                break
            t[:] = self._rigid(r)
            w[:] = p[:] = q[:] = 0.0
            add_product(*matrix, self._diagonal, t, w)
            # E of a free part is round-off, and so is what it promises for the energy of the motion
            promised = float(np.vdot(t, r))
            if promised > _SEEN * np.linalg.norm(t) * np.linalg.norm(r) and not (
                0.5 * promised < np.vdot(t, w) < 2.0 * promised
            ):
                return -1, square
            x += t
            r -= w
            is_zero, rho, square = False, np.inf, float(np.vdot(r, r))
            while square > target and iteration < self.limit:
                s[:] = r
                solve_lower(*short, self._inverse, s, t)
                sweep_back(*short, self._inverse, s, t, w)  # t = M r, w = K M r
                t += self._rigid(np.subtract(r, w, out=s))
                w[:] = 0.0
                add_product(*matrix, self._diagonal, t, w)
                old, rho = rho, float(np.vdot(r, t))
                curvature = turn(t, w, p, q, rho / old)
                if not (curvature > 0.0 and rho > 0.0):
                    return -1, square
                square = advance(x, r, p, q, rho / curvature)
                iteration += 1
        return iteration, square


def _parts(pattern: BlockPattern, points: Floats) -> Ints:
    """Divide the nodes into connected parts (N,) in boxes, of about as many nodes each."""
    count = len(points)
    wanted = _NODES * count ** (1 / 3)
    low, extent = points.min(axis=0), np.ptp(points, axis=0)
    size = float(extent.prod() * wanted / count) ** (1 / 3)
    while True:
        boxes = np.ceil(extent / size).astype(np.int64).clip(1)
        at = ((points - low) * (boxes / extent)).astype(np.int64).clip(0, boxes - 1)
        box = np.ravel_multi_index(at.T, boxes)
        if np.count_nonzero(np.bincount(box)) * wanted <= 1.3 * count or (boxes == 1).all():
            break
        size *= 1.1  # thin bodies leave boxes half empty
    row = np.repeat(np.arange(count), np.diff(pattern.starts))
    column = pattern.columns
    inside = (box[row] == box[column]) & (row < column)
    part = connected(count, row[inside], column[inside])
    few = np.bincount(part)[part] < _FEW * wanted
    across = few[row] & ~few[column]
    part[row[across]] = part[column[across]]
    return np.unique(part, return_inverse=True)[1].ravel()


def _rigid_motions(points: Floats, fixed: Bools, part: Ints) -> Floats:
    """Return displacements (N, 3, 6) of nodes by the rigid motions of their part; none if fixed."""
    of_part = np.bincount(part)
    middles = np.stack([np.bincount(part, points[:, axis]) / of_part for axis in range(3)], axis=1)
    arms = points - middles[part]
    arms /= np.abs(arms).max()
    modes = np.zeros((len(points), 3, 6))
    modes[:, range(3), range(3)] = 1.0
    for axis, mode, arm, sign in _TURNS:
        modes[:, axis, mode] = sign * arms[:, arm]
    modes[fixed] = 0.0
    return modes


def _independent(modes: Floats, part: Ints) -> Floats:
    """Return combinations (m, 6, 6) of rigid motions that are independent in each part, or zero."""
    order = np.argsort(part, kind="stable")
    first = np.flatnonzero(np.diff(part[order], prepend=-1))
    moments = np.add.reduceat((modes.transpose(0, 2, 1) @ modes)[order], first, axis=0)
    squares, ways = np.linalg.eigh(moments)
    moves = squares > _ALIKE * squares[:, -1:].clip(np.finfo(float).tiny)
    return ways * np.where(moves, 1.0 / np.sqrt(np.where(moves, squares, 1.0)), 0.0)[:, None, :]


def _coarse_pattern(starts: Ints, columns: Ints, part: Ints) -> tuple[BlockPattern, Ints]:
    """Return the sparsity of parts, and the place in it of each block above the diagonal."""
    count = int(part.max()) + 1
    row, column = part[np.repeat(np.arange(len(part)), np.diff(starts))], part[columns]
    own = np.arange(count)
    keys = np.concatenate([row, column, own]) * count + np.concatenate([column, row, own])
    found, place = np.unique(keys, return_inverse=True)
    first = np.searchsorted(found, np.arange(count + 1) * count).astype(np.int32)
    pattern = BlockPattern(first, (found % count).astype(np.int32), np.empty((0, 4, 4), np.int32))
    return pattern, place[: len(columns)]


@njit(cache=True, fastmath=FUSED)
def add_product(starts, columns, upper, diagonal, x, out):
    """Add K x (N, 3) to `out`, with the diagonal blocks (N, 3, 3)."""
    for row in range(len(x)):
        x0, x1, x2 = x[row, 0], x[row, 1], x[row, 2]
        a = diagonal[row, 0, 0] * x0 + diagonal[row, 0, 1] * x1 + diagonal[row, 0, 2] * x2
        b = diagonal[row, 1, 0] * x0 + diagonal[row, 1, 1] * x1 + diagonal[row, 1, 2] * x2
        c = diagonal[row, 2, 0] * x0 + diagonal[row, 2, 1] * x1 + diagonal[row, 2, 2] * x2
        for at in range(starts[row], starts[row + 1]):
            j = columns[at]
            y0, y1, y2 = x[j, 0], x[j, 1], x[j, 2]
            a += upper[at, 0, 0] * y0 + upper[at, 0, 1] * y1 + upper[at, 0, 2] * y2
            b += upper[at, 1, 0] * y0 + upper[at, 1, 1] * y1 + upper[at, 1, 2] * y2
            c += upper[at, 2, 0] * y0 + upper[at, 2, 1] * y1 + upper[at, 2, 2] * y2
            out[j, 0] += upper[at, 0, 0] * x0 + upper[at, 1, 0] * x1 + upper[at, 2, 0] * x2
            out[j, 1] += upper[at, 0, 1] * x0 + upper[at, 1, 1] * x1 + upper[at, 2, 1] * x2
            out[j, 2] += upper[at, 0, 2] * x0 + upper[at, 1, 2] * x1 + upper[at, 2, 2] * x2
        out[row, 0] += a
        out[row, 1] += b
        out[row, 2] += c


@njit(cache=True, fastmath=FUSED)
def sweep_back(starts, columns, upper, inverse, g, t, w):
    """Find t = (D + Lᵀ)⁻¹ g and w = g + L t, all (N, 3), in one pass over the matrix.

    With g = D (D + L)⁻¹ r, w is K t.
    """
    for row in range(len(inverse)):
        w[row, 0], w[row, 1], w[row, 2] = g[row, 0], g[row, 1], g[row, 2]
    for row in range(len(inverse) - 1, -1, -1):
        a, b, c = g[row, 0], g[row, 1], g[row, 2]
        for at in range(starts[row + 1] - 1, starts[row] - 1, -1):
            j = columns[at]
            x, y, z = t[j, 0], t[j, 1], t[j, 2]
            a -= upper[at, 0, 0] * x + upper[at, 0, 1] * y + upper[at, 0, 2] * z
            b -= upper[at, 1, 0] * x + upper[at, 1, 1] * y + upper[at, 1, 2] * z
            c -= upper[at, 2, 0] * x + upper[at, 2, 1] * y + upper[at, 2, 2] * z
        x = inverse[row, 0, 0] * a + inverse[row, 0, 1] * b + inverse[row, 0, 2] * c
        y = inverse[row, 1, 0] * a + inverse[row, 1, 1] * b + inverse[row, 1, 2] * c
        z = inverse[row, 2, 0] * a + inverse[row, 2, 1] * b + inverse[row, 2, 2] * c
        t[row, 0], t[row, 1], t[row, 2] = x, y, z
        for at in range(starts[row], starts[row + 1]):
            j = columns[at]
            w[j, 0] += upper[at, 0, 0] * x + upper[at, 1, 0] * y + upper[at, 2, 0] * z
            w[j, 1] += upper[at, 0, 1] * x + upper[at, 1, 1] * y + upper[at, 2, 1] * z
            w[j, 2] += upper[at, 0, 2] * x + upper[at, 1, 2] * y + upper[at, 2, 2] * z


@njit(cache=True)
def add_coarse(starts, columns, upper, diagonal, modes, place, own, out):
    """Add Zᵀ (L + ½ D) Z in blocks (b, 6, 6); with its mirror image it is Zᵀ K Z."""
    half = np.empty((3, 6))
    for row in range(len(diagonal)):
        for at in range(starts[row] - 1, starts[row + 1]):
            first = at < starts[row]
            j = row if first else columns[at]
            block = diagonal[row] if first else upper[at]
            share, to = (0.5, own[row]) if first else (1.0, place[at])
            for k in range(3):
                for b in range(6):
                    half[k, b] = share * (
                        block[k, 0] * modes[j, 0, b]
                        + block[k, 1] * modes[j, 1, b]
                        + block[k, 2] * modes[j, 2, b]
                    )
            for a in range(6):
                for b in range(6):
                    for k in range(3):
                        out[to, a, b] += modes[row, k, a] * half[k, b]


@njit(cache=True, fastmath=SUMS)
def turn(t, w, p, q, beta):
    """Set p to t + β p and q to w + β q, and return p·q."""
    a, b, c, d = t.ravel(), w.ravel(), p.ravel(), q.ravel()
    product = 0.0
    for i in range(len(a)):
        c[i] = a[i] + beta * c[i]
        d[i] = b[i] + beta * d[i]
        product += c[i] * d[i]
    return product


@njit(cache=True, fastmath=SUMS)
def advance(x, r, p, q, alpha):
    """Add α p to x, take α q from r, and return r·r."""
    a, b, c, d = x.ravel(), r.ravel(), p.ravel(), q.ravel()
    square = 0.0
    for i in range(len(a)):
        a[i] += alpha * c[i]
        b[i] -= alpha * d[i]
        square += b[i] * b[i]
    return square
