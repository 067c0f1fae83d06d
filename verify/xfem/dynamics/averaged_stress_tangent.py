"""Derivative of the stress averaged over a step by the deformation at its end.

With G = F₀ + F₁, A = U₀ + U₁ and c = λ(½(t₀ + t₁) − d) − 2μ, the stress P = μ G + c T has

    dP = μ dF + ½λ (R₁ : dF) T + c dT,   dT = (dF − T dU₁) A⁻¹.

The derivative of a polar decomposition F = R U: dR = R Ω with the axis ω of Ω from
(tr(U) I − U) ω = axis of RᵀdF − dFᵀR, and dU = RᵀdF − Ω U. In the plane
dT = (d(t₁R₁) − T dt₁)/(t₀ + t₁), t₁R₁ being linear in F₁. The substitute that inverted pieces take
is differentiated likewise. All pieces at once, in numpy: this is not the cost of a step, and as
loops it would be half of the time that all of the solver takes to compile.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.xfem.corotation.averaged_stress_kernels import is_moving
from verify.xfem.corotation.polar_kernels import nearest_rotation

__all__ = ["add_averaged_stiffness", "stress_slope"]

_Floats = NDArray[np.float64]

_EPSILON = np.zeros((3, 3, 3))
_EPSILON[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
_EPSILON[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = -1.0
_SINGULAR = 1e-18  # determinant over the cube of the trace: a rotation without a slope
# d(t R)/dF in the plane: t R = [[a, −b], [b, a]], a = F₀₀ + F₁₁, b = F₁₀ − F₀₁
_TURN_IN_PLANE = np.einsum("kn,lm->knlm", np.eye(2), np.eye(2)) + np.einsum(
    "kn,lm->knlm", [[0.0, -1.0], [1.0, 0.0]], [[0.0, -1.0], [1.0, 0.0]]
)


def _inner(A: _Floats, B: _Floats) -> _Floats:
    return np.einsum("pkl,pkl->p", A, B)


def _identity(size: int) -> _Floats:
    return np.einsum("kl,nm->knlm", np.eye(size), np.eye(size))


def _polar_slope(R: _Floats, F: _Floats) -> tuple[_Floats, _Floats]:
    """Return dR and dU (p, 3, 3, 3, 3) of F = R U; zero dR where the rotation has no slope."""
    U = R.transpose(0, 2, 1) @ F
    trace = np.einsum("pkk->p", U)
    H = trace[:, None, None] * np.eye(3) - 0.5 * (U + U.transpose(0, 2, 1))
    singular = ~(np.abs(np.linalg.det(H)) > _SINGULAR * np.abs(trace) ** 3)
    H[singular] = np.eye(3)
    Z = np.linalg.inv(H)
    Z[singular] = 0.0
    axis = np.einsum("pij,jmk,plk->pilm", Z, _EPSILON, R, optimize=True)
    spin = -np.einsum("ijk,pklm->pijlm", _EPSILON, axis)
    dU = np.einsum("plk,nm->pknlm", R, np.eye(3)) - np.einsum("pijlm,pjn->pinlm", spin, U)
    return np.einsum("pai,pijlm->pajlm", R, spin), dU


def _in_plane(R0: _Floats, R1: _Floats, t0: _Floats, t1: _Floats) -> tuple[_Floats, _Floats]:
    total = t0 + t1
    defined = total > 0.0
    safe = np.where(defined, total, 1.0)[:, None, None]
    T = np.where(
        defined[:, None, None], (t0[:, None, None] * R0 + t1[:, None, None] * R1) / safe, R1
    )
    dT = (_TURN_IN_PLANE - np.einsum("pkn,plm->pknlm", T, R1)) / safe[..., None, None]
    return T, np.where(defined[:, None, None, None, None], dT, 0.0)


def _plain(
    F0: _Floats, F1: _Floats, R0: _Floats, R1: _Floats, normals: _Floats
) -> tuple[_Floats, _Floats]:
    A = R0.transpose(0, 2, 1) @ F0 + R1.transpose(0, 2, 1) @ F1
    A = 0.5 * (A + A.transpose(0, 2, 1)) + 2.0 * np.einsum("pk,pl->pkl", normals, normals)
    inverse = np.linalg.inv(A)
    T = (F0 + F1) @ inverse
    _, dU = _polar_slope(R1, F1)
    change = _identity(3) - np.einsum("pka,pablm->pkblm", T, dU)
    return T, np.einsum("pkblm,pbn->pknlm", change, inverse)


def _substitute(
    F0: _Floats, F1: _Floats, R0: _Floats, R1: _Floats, rise: _Floats
) -> tuple[_Floats, _Floats]:
    """T and dT of the substitute; `rise` is t₁ − t₀."""
    G = F0 + F1
    Rm = np.empty_like(G)
    for piece in range(len(G)):
        nearest_rotation(G[piece], Rm[piece])
    dT, _ = _polar_slope(Rm, G)
    C1 = F1.transpose(0, 2, 1) @ F1
    change = C1 - F0.transpose(0, 2, 1) @ F0
    half = np.einsum("ma,plb->pablm", np.eye(3), F1)
    dC = half + half.transpose(0, 2, 1, 3, 4)
    square = _inner(change, change)
    moving = is_moving(square, _inner(C1, C1))
    square = np.where(moving, square, 1.0)[:, None, None]
    factor = np.where(moving, rise - _inner(Rm, F1 - F0), 0.0)[:, None, None] / square
    slope = R1 - Rm - np.einsum("pknlm,pkn->plm", dT, F1 - F0)
    slope = (slope - 2.0 * factor * np.einsum("pab,pablm->plm", change, dC)) / square
    slope[~moving] = 0.0
    D = G @ change
    dT += np.einsum("plm,pkn->pknlm", slope, D)
    moved = np.einsum("kl,pmn->pknlm", np.eye(3), change) + np.einsum("pka,panlm->pknlm", G, dC)
    dT += factor[..., None, None] * moved
    return Rm + factor * D, dT


def stress_slope(
    F0: _Floats,
    F1: _Floats,
    R0: _Floats,
    R1: _Floats,
    lam: _Floats,
    mu: _Floats,
    dim: int,
    normals: _Floats,
    substituted: NDArray[np.bool_],
) -> _Floats:
    """Return dP/dF₁ (p, d, d, d, d), the last two indices those of F₁.

    Parameters
    ----------
    F0, F1, R0, R1 : (p, d, d) float array
    lam, mu : (p,) float array
    dim : int
        Of the pieces.
    normals : (p, 3) float array
        Unit normals of membranes, else zero.
    substituted : (p,) bool array
        Pieces that have taken the substitute.
    """
    t0, t1 = _inner(R0, F0), _inner(R1, F1)
    if F0.shape[1] == 2:
        T, dT = _in_plane(R0, R1, t0, t1)
    else:
        T, dT = np.empty_like(F0), np.empty((len(F0), 3, 3, 3, 3))
        some = ~substituted
        T[some], dT[some] = _plain(F0[some], F1[some], R0[some], R1[some], normals[some])
        if substituted.any():
            of = substituted
            T[of], dT[of] = _substitute(F0[of], F1[of], R0[of], R1[of], (t1 - t0)[of])
    factor = lam * (0.5 * (t0 + t1) - dim) - 2.0 * mu
    slope = factor[:, None, None, None, None] * dT
    slope += np.einsum("p,pkn,plm->pknlm", 0.5 * lam, T, R1)
    slope += mu[:, None, None, None, None] * _identity(F0.shape[1])
    return slope


def add_averaged_stiffness(
    cells: NDArray[np.int64],
    targets: NDArray[np.int32],
    gradients: _Floats,
    parent: NDArray[np.int64],
    volumes: _Floats,
    normals: _Floats,
    lam: _Floats,
    mu: _Floats,
    first: _Floats,
    second: _Floats,
    start: _Floats,
    end: _Floats,
    substituted: NDArray[np.bool_],
    blocks: _Floats,
) -> None:
    """Add the derivative of `averaged_force` by the end of the step to the nodal blocks.

    The derivative is not symmetric; arguments as there, and as the last call of it left them.
    """
    corners, space = cells.shape[1], gradients.shape[2]
    b = gradients[parent]
    normal = normals[parent] if corners == space else np.zeros((len(cells), 3))
    rest = np.broadcast_to(np.eye(space), (len(cells), space, space))
    if corners == space:
        rest = rest - np.einsum("pk,pl->pkl", normal, normal)
    F0, F1 = (rest + np.einsum("pik,pil->pkl", u[cells], b) for u in (start, end))
    slope = stress_slope(
        F0, F1, first, second, lam[parent], mu[parent], corners - 1, normal, substituted
    )
    half = np.einsum("p,pin,pknlm->piklm", volumes, b, slope, optimize=True)
    _add(targets, np.einsum("piklm,pjm->pijkl", half, b, optimize=True), blocks)


@njit(cache=True)
def _add(targets, element, blocks):
    for piece in range(element.shape[0]):
        for i in range(element.shape[1]):
            for j in range(element.shape[1]):
                for k in range(blocks.shape[1]):
                    for l in range(blocks.shape[1]):
                        blocks[targets[piece, i, j], k, l] += element[piece, i, j, k, l]
