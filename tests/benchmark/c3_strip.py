"""C3, second route: triangles of order 3 and 4 on a mesh of its own, graded, and Newton's method.

Made from docs/benchmark/c3.md alone, with numpy, scipy and scikit-fem. `python c3_strip.py 4`
prints the outputs of the page with elements of order 4, on meshes with ever more layers.
"""

import sys

import numpy as np
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP3,
    ElementTriP4,
    ElementVector,
    Functional,
    LinearForm,
    MeshTri,
    condense,
    solve,
)
from skfem.helpers import ddot, grad

WIDTH, LENGTH, CUT = 0.02, 0.1, (0.01, 0.05)
YOUNG, POISSON, WEIGHT = 1e4, 0.3, 9800.0
SHEAR = YOUNG / (2 * (1 + POISSON))
LAME = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
ELEMENTS = {3: ElementTriP3, 4: ElementTriP4}
RATIO = 0.25  # of a layer to the one around it


def towards(start, end, layers):
    """Points from start to end, ever closer to the end."""
    return end - (end - start) * np.concatenate([RATIO ** np.arange(layers), [0.0]])


def between(points):
    """Join rows of points that share their ends."""
    return np.unique(np.round(np.concatenate(points), 15))


def strip(layers):
    """Mesh of the strip, graded to the tip, the mouth's place and the corners above, cut open."""
    tip, height = CUT
    side = between([towards(0.005, 0.0, layers), towards(0.005, tip, layers)])
    x = between([side, WIDTH - side])
    y = between([
        np.linspace(0.0, 0.03, 4), [0.04], towards(0.04, height, layers),
        towards(0.06, height, layers), np.linspace(0.06, 0.09, 4), towards(0.09, LENGTH, layers),
    ])  # fmt: skip
    mesh = MeshTri.init_tensor(x, y)
    points, triangles = mesh.p, mesh.t.copy()
    on = np.flatnonzero((np.abs(points[1] - height) < 1e-12) & (points[0] < tip - 1e-12))
    copies = np.arange(points.shape[1])
    copies[on] = points.shape[1] + np.arange(len(on))
    above = points[1, triangles].mean(axis=0) > height
    triangles[:, above] = copies[triangles[:, above]]
    return MeshTri(np.hstack([points, points[:, on]]), triangles)


def rotation(F):
    """Trace of the stretch U and the rotation R of F = R U."""
    a, b = F[0, 0] + F[1, 1], F[1, 0] - F[0, 1]
    s = np.hypot(a, b)
    return s, np.array([[a, -b], [b, a]]) / s


def deformation(w):
    """F of the displacement."""
    F = grad(w["u"]).copy()
    F[0, 0] += 1.0
    F[1, 1] += 1.0
    return F


@Functional
def energy(w):
    """μ‖U − I‖² + ½ λ tr²(U − I), with tr(U²) = ‖F‖²."""
    F = deformation(w)
    s, _ = rotation(F)
    return SHEAR * (ddot(F, F) - 2 * s + 2.0) + 0.5 * LAME * (s - 2.0) ** 2


@LinearForm
def residual(v, w):
    """Weight less internal forces."""
    F = deformation(w)
    s, R = rotation(F)
    P = 2 * SHEAR * (F - R) + LAME * (s - 2.0) * R
    return -WEIGHT * w["load"] * v[1] - ddot(P, grad(v))


@BilinearForm
def tangent(u, v, w):
    """Second derivative of the energy."""
    F, D = deformation(w), grad(u)
    s, R = rotation(F)
    turn = (R[0, 0] * (D[1, 0] - D[0, 1]) - R[1, 0] * (D[0, 0] + D[1, 1])) / s
    dR = turn * np.array([[-R[1, 0], -R[1, 1]], [R[0, 0], R[0, 1]]])
    dP = 2 * SHEAR * (D - dR) + LAME * (ddot(R, D) * R + (s - 2.0) * dR)
    return ddot(dP, grad(v))


def outputs(order, layers, steps=3):
    """Return unknowns, strain energy, opening of the mouth and sag of the lower end."""
    mesh = strip(layers)
    basis = Basis(mesh, ElementVector(ELEMENTS[order]()), intorder=2 * order)
    held = basis.get_dofs(lambda p: p[1] > LENGTH - 1e-12).all()
    u = basis.zeros()
    for load in np.arange(1, steps + 1) / steps:
        for _ in range(30):
            now = {"u": basis.interpolate(u), "load": load}
            change = solve(
                *condense(tangent.assemble(basis, **now), residual.assemble(basis, **now), D=held)
            )
            u = u + change
            if np.abs(change).max() < 1e-12:
                break
        else:
            raise RuntimeError("Newton's method does not converge")
    places = mesh.p
    mouth = np.flatnonzero((places[0] < 1e-12) & (np.abs(places[1] - CUT[1]) < 1e-12))
    below, above = mouth  # the copies come last, and are above
    lower = np.flatnonzero((np.abs(places[0] - 0.01) < 1e-12) & (places[1] < 1e-12))[0]
    vertical = basis.nodal_dofs[1]
    return {
        "unknowns": basis.N,
        "strain_energy": energy.assemble(basis, u=basis.interpolate(u)),
        "mouth_opening": u[vertical[above]] - u[vertical[below]],
        "lower_end_sag": u[vertical[lower]],
    }


def second_route():
    """Give {quantity: (value, half-width)}: each layer leaves a share RATIO of the error before."""
    coarse, fine = outputs(4, 5), outputs(4, 6)
    left = {name: (value - coarse[name]) * RATIO / (1 - RATIO) for name, value in fine.items()}
    del left["unknowns"]
    return {name: (fine[name] + rest, abs(rest)) for name, rest in left.items()}


if __name__ == "__main__":
    order = int(sys.argv[1]) if sys.argv[1:] else 4
    for layers in map(int, sys.argv[2:] or ["3", "4", "5"]):
        found = outputs(order, layers)
        print(order, layers, *(f"{name} {value:.10g}" for name, value in found.items()), flush=True)
