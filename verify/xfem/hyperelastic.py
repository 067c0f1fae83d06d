"""Force and tangent of neo-Hookean elements, per cell of a cut body.

With J = det F the potential per volume is ½μ(‖F‖² − d) + H(J), and its gradient

    P = μ F + h(J) cof F,   h = dH/dJ,   ∂P/∂F = μ I + h′ cof F ⊗ cof F + h ∂cof F/∂F.

    neo_hookean          H = −μ ln J + ½λ ln² J
    stable_neo_hookean   H = −μ (J − 1) + ½(λ + μ)(J − 1)²

Both have Hooke's tangent at rest. The second is that of Smith, de Goes & Kim (ACM TOG 37, 2018)
without the term that keeps ‖F‖ = 0 stable, as Macklin & Müller (MIG 2021) have it: it is finite for
cells that are inside out. The first is not: its energy is infinite where J ≤ 0.

In the plane (strain) the stretch across is 1, and ‖F‖² − d and J are those of the two axes.
"""

import numpy as np

from verify.compiled import njit


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
    """Add the internal forces of F (p, d, d) to those of the corners (N, d); return the energy.

    It is infinite, and so are no forces of such a cell added, where the law knows no J ≤ 0.
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


@njit(cache=True, error_model="numpy")  # what is pressed to nothing has moduli that are no numbers
def hyperelastic_moduli(elements, stable, F):
    """Second derivative of the potential by F (p, d, d): (p, d, d, d, d) per volume."""
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
                        if k != q and n != r:  # ∂cof F: what is left of F without rows k, q
                            sign = 1.0 if (q - k - r + n) % 3 == 0 else -1.0
                            rest = F[p, 3 - k - q, 3 - n - r] if d == 3 else 1.0
                            value += sign * h * rest
                        A[p, k, n, q, r] = value
    return A
