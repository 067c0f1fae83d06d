"""Force and tangent of neo-Hookean elements, per cell of a cut body.

With J = det F the potential per volume is ½μ(‖F‖² − d) + H(J), and its gradient

    P = μ F + h(J) cof F,   h = dH/dJ,   ∂P/∂F = μ I + h′ cof F ⊗ cof F + h ∂cof F/∂F.

    neo_hookean          H = −μ ln J + ½λ ln² J
    stable_neo_hookean   H = −μ (J − 1) + ½(λ + μ)(J − 1)²

Both have Hooke's tangent at rest. The second is from Smith, de Goes & Kim (ACM TOG 37, 2018). As in
Macklin & Müller (MIG 2021) it lacks the term that keeps ‖F‖ = 0 stable. It is finite for inverted
cells. The first is not: its energy is infinite where J ≤ 0. In plane strain the stretch across is
1, and ‖F‖² − d and J count the two axes.

The stress averaged over a step, of which the work is the change of the energy, is

    P = μ Fₘ + (H₁ − H₀)/(J₁ − J₀) C,   C : (F₁ − F₀) = J₁ − J₀,   C Fₘᵀ symmetric,

so that angular momentum is kept (Gonzalez, CMAME 190, 2000), Fₘ = (F₀ + F₁)/2. In the plane J is
quadratic, and C = cof Fₘ. In space det C is cubic in C = FᵀF. Let K be Simpson's mean of cof C from
C₀ to C₁. Then J₁² − J₀² = K : (C₁ − C₀) exactly, and C = 2 Fₘ K/(J₀ + J₁). For a piece that is
inverted at an end Simpson's mean of cof F itself stands in: it keeps the energy alone.
"""

from typing import NamedTuple

import numpy as np

from verify.compiled import njit
from verify.xfem.arrays import Floats


@njit(cache=True)
def _cofactors(F, C):
    """Write the cofactors of F (d, d) to C; return det F."""
    if len(F) == 2:
        C[0, 0], C[0, 1], C[1, 0], C[1, 1] = F[1, 1], -F[1, 0], -F[0, 1], F[0, 0]
        return F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        for l in range(3):
            m, n = (l + 1) % 3, (l + 2) % 3
            C[k, l] = F[a, m] * F[b, n] - F[a, n] * F[b, m]
    return F[0, 0] * C[0, 0] + F[0, 1] * C[0, 1] + F[0, 2] * C[0, 2]


@njit(cache=True)
def add_hyperelastic_force(elements, stable, F, force):
    """Add the internal forces of F (p, d, d) to the corners (N, d); return the energy.

    Where J ≤ 0, a law without an energy there gives infinity, and forces that are no numbers.
    """
    cells, parent, gradients, volumes, _, lam, mu, axes, corners, _ = elements
    d, c = len(axes), len(corners)
    C = np.empty((d, d))
    energy = 0.0
    for p in range(len(cells)):
        cell = parent[p]
        J = _cofactors(F[p], C)
        if J <= 0.0 and not stable:
            energy = np.inf
            force[cells[p]] = np.nan
            continue
        l, m, w = lam[cell], mu[cell], volumes[p]
        # ½μ(‖F‖² − d) − μ(J − 1) without cancellation at rest: H = F − I leaves ½μ‖H‖² and minors
        square = trace = 0.0
        for a in range(d):
            trace += F[p, a, a] - 1.0
            for b in range(d):
                one = F[p, a, b] - 1.0 if a == b else F[p, a, b]
                square += one * one
        away = J - 1.0
        shape = 0.5 * m * square - m * (away - trace)
        if stable:
            h = (l + m) * away - m
            energy += w * (shape + 0.5 * (l + m) * away * away)
        else:
            log = np.log(J)
            h = (l * log - m) / J
            energy += w * (shape + m * (away - log) + 0.5 * l * log * log)
        for i in range(c):
            for k in range(d):
                total = 0.0
                for n in range(d):
                    total += (m * F[p, k, n] + h * C[k, n]) * gradients[cell, i, n]
                force[cells[p, i], k] += w * total
    return energy


@njit(cache=True, error_model="numpy")  # a cell pressed to nothing has moduli that are no numbers
def hyperelastic_moduli(elements, stable, F):
    """Compute the second derivative of the potential by F (p, d, d): (p, d, d, d, d) per volume."""
    _, parent, _, _, _, lam, mu, axes, _, _ = elements
    d = len(axes)
    C = np.empty((d, d))
    A = np.empty((len(F), d, d, d, d))
    for p in range(len(F)):
        cell = parent[p]
        J, l, m = _cofactors(F[p], C), lam[cell], mu[cell]
        if stable:
            h, rate = (l + m) * (J - 1.0) - m, l + m
        else:
            log = np.log(J)
            h, rate = (l * log - m) / J, (l + m - l * log) / J**2
        for k in range(d):
            for n in range(d):
                for q in range(d):
                    for r in range(d):
                        value = rate * C[k, n] * C[q, r]
                        if k == q and n == r:
                            value += m
                        if k != q and n != r:  # ∂cof F: F without rows k, q
                            sign = 1.0 if (q - k - r + n) % 3 == 0 else -1.0
                            rest = F[p, 3 - k - q, 3 - n - r] if d == 3 else 1.0
                            value += sign * h * rest
                        A[p, k, n, q, r] = value
    return A


class Law(NamedTuple):
    """λ and μ (p,) of pieces, Pa, and whether their energy is the stable one."""

    lam: Floats
    mu: Floats
    stable: bool


class Averages(NamedTuple):
    """Stress averaged over a step, and what its derivative needs, of pieces (p,).

    Attributes
    ----------
    stress : (p, d, d) float array
        P, Pa.
    C : (p, d, d) float array
    h, rate : (p,) float arrays
        (H₁ − H₀)/(J₁ − J₀), Pa, and its derivative by J₁.
    K : (p, d, d) float array
        Simpson's mean of cof C; 0 where it does not count.
    J : (p,) float array
        J₀ + J₁.
    """

    stress: Floats
    C: Floats
    h: Floats
    rate: Floats
    K: Floats
    J: Floats


def averages(law: Law, F0: Floats, F1: Floats) -> Averages:
    """Average the stress over a step from F0 to F1, each (p, d, d)."""
    total = F0 + F1
    J0, J1 = np.linalg.det(F0), np.linalg.det(F1)
    h, rate = _volume_slopes(law, J0, J1)
    K = np.zeros(F0.shape)
    if F0.shape[1] == 2:
        C = _cofactors_of(0.5 * total)
    else:
        C = (_cofactors_of(F0) + 4.0 * _cofactors_of(0.5 * total) + _cofactors_of(F1)) / 6.0
        sound = (J0 > 0.0) & (J1 > 0.0)
        C0, C1 = (F[sound].transpose(0, 2, 1) @ F[sound] for F in (F0, F1))
        middle = _cofactors_of(0.5 * (C0 + C1))
        K[sound] = (_cofactors_of(C0) + 4.0 * middle + _cofactors_of(C1)) / 6.0
        C[sound] = total[sound] @ K[sound] / (J0 + J1)[sound, None, None]
    stress = 0.5 * law.mu[:, None, None] * total + h[:, None, None] * C
    return Averages(stress, C, h, rate, K, J0 + J1)


def moduli_of_averages(law: Law, F0: Floats, F1: Floats) -> Floats:
    """Differentiate the stress of `averages` by F₁: (p, d, d, d, d), the last two indices of F₁."""
    _, C, h, rate, K, J = averages(law, F0, F1)
    identity = np.eye(F0.shape[1])
    last = _cofactors_of(F1)
    if len(identity) == 2:
        dC = np.broadcast_to(0.5 * _MINORS[2], (len(C), 2, 2, 2, 2)).copy()
    else:
        dC = _cofactor_slopes((F0 + 2.0 * F1) / 6.0)
        sound = K.any(axis=(1, 2))
        one, other, total = F0[sound], F1[sound], (F0 + F1)[sound]
        metric = one.transpose(0, 2, 1) @ one + 2.0 * other.transpose(0, 2, 1) @ other
        slope = _cofactor_slopes(metric / 6.0)  # ∂K/∂C₁, and ∂C₁ = ∂FᵀF₁ + F₁ᵀ∂F
        dK = np.einsum("panmb,plb->panlm", slope, other)
        dK += np.einsum("panbm,plb->panlm", slope, other)
        dC[sound] = np.einsum("kl,pmn->pknlm", identity, K[sound])
        dC[sound] += np.einsum("pka,panlm->pknlm", total, dK)
        dC[sound] -= np.einsum("pkn,plm->pknlm", C[sound], last[sound])
        dC[sound] /= J[sound, None, None, None, None]
    found = h[:, None, None, None, None] * dC
    found += np.einsum("p,pkn,plm->pknlm", rate, C, last)
    shear = 0.5 * law.mu[:, None, None, None, None]
    return found + shear * np.einsum("kl,nm->knlm", identity, identity)


def _volume_slopes(law: Law, J0: Floats, J1: Floats) -> tuple[Floats, Floats]:
    """Compute (H₁ − H₀)/(J₁ − J₀) and its derivative by J₁; no numbers where ln J is none."""
    (lam, mu, stable), total = law, J0 + J1
    if stable:
        return (lam + mu) * (0.5 * total - 1.0) - mu, 0.5 * (lam + mu)
    with np.errstate(invalid="ignore", divide="ignore"):
        # ln J₁ − ln J₀ = 2 artanh x, x = (J₁ − J₀)/(J₁ + J₀): q = artanh(x)/x is even and smooth
        x, logs = (J1 - J0) / total, np.log(J0) + np.log(J1)
        near = np.abs(x) < _CLOSE
        apart = np.where(near, 1.0, x)
        q = np.where(near, 1.0 + x**2 / 3.0 + x**4 / 5.0 + x**6 / 7.0, np.arctanh(x) / apart)
        slope = (1.0 / (1.0 - x**2) - q) / apart
        slope = np.where(near, 2.0 * x / 3.0 + 4.0 * x**3 / 5.0 + 6.0 * x**5 / 7.0, slope)
        mean, bulk = 2.0 * q / total, 0.5 * lam * logs - mu
        change = (4.0 * J0 * slope / total - 2.0 * q) / total**2
        return mean * bulk, change * bulk + 0.5 * mean * lam / J1


_CLOSE = 0.01  # of x: below it the terms that the series leaves out are round-off
# ∂cof F/∂F in the plane; in space its derivative by F
_EVEN = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.cross(np.eye(3)[:, None], np.eye(3))
_MINORS = {
    2: np.einsum("kl,nm->knlm", _EVEN[0], _EVEN[0]),
    3: np.einsum("kab,ncd->knacbd", _EVEN[1], _EVEN[1]),
}


def _cofactor_slopes(A: Floats) -> Floats:
    """Compute ∂cof A/∂A (p, 3, 3, 3, 3)."""
    return np.einsum("knacbd,pac->pknbd", _MINORS[3], A)


def _cofactors_of(A: Floats) -> Floats:
    if A.shape[1] == 2:
        return np.einsum("knlm,plm->pkn", _MINORS[2], A)
    return 0.5 * np.einsum("pknbd,pbd->pkn", _cofactor_slopes(A), A)
