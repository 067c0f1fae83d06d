"""Isotropic elasticity; force and tangent of corotational linear elements, per cell of a cut body.

Let b_i be the material gradient of shape function i and w the volume of a piece. Let F = I + Σ u_i
b_iᵀ = R U and E = sym(Rᵀ F) − I. The piece stores w (μ‖E‖² + ½λ tr² E). The gradient is the force
f_i = w P b_i, P = R (2μE + λ tr(E) I), if R is the nearest rotation. R = I is linear elasticity. A
tangent is K_ij,kl = w b_in A_knlm b_jm, A a derivative of P by F:

    rotation-fixed   A = μ (δ_kl δ_nm + R_km R_ln) + λ R_kn R_lm,
    consistent       A = 2μ δ_kl δ_nm + λ R_kn R_lm + (λ tr(E) − 2μ) ∂R_kn/∂F_lm.

The second follows from P = 2μF + (λ tr(E) − 2μ) R, as RᵀF is symmetric. The first holds R fixed, so
that P is linear in E: its product with a vector v is the force of E = sym(Rᵀ ∇v), without I. A law
that is not linear in E would need another `add_force` for it.

A membrane (`Elements.is_membrane`) is the same with F and I restricted to its tangent plane. In the
first A, δ_kl becomes δ_kl − n_k n_l, n the turned normal. Against a displacement φ along n it has
only the geometric stiffness w (∇φ · S ∇φ) of its tension S. S is the second Piola–Kirchhoff stress.
Its principal values at the stretches λ_k are (2μ(λ_k − 1) + λ(λ_1 + λ_2 − 2))/λ_k. The geometric
stiffness takes the positive part of S alone, so that it has no negative mode.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from verify.compiled import njit
from verify.xfem.arrays import (
    Bools,
    Floats,
    Ints,
    XfemError,
    check_choice,
    finite_array,
    real_array,
)
from verify.xfem.phantom import PhantomMesh
from verify.xfem.polar import SPINS, adjugate

State = Literal["plane strain", "plane stress", "solid"]
Law = Literal["hooke", "neo_hookean", "stable_neo_hookean"]


@dataclass(frozen=True)
class Material:
    """σ = λ tr(ε) I + 2 μ ε, with the λ that suits the state; or a law with that tangent at rest.

    Hooke's law is written out here, in `energy_momentum` (for it alone), `explicit`,
    `ghost_penalty`, and the kernels of `verify.accelerated`; the others, of solids and plane strain
    at finite rotation, in `hyperelastic`. Their rotation-fixed tangent is Hooke's: viscous forces
    and descents of Newton's method are by it.

    Attributes
    ----------
    lam, mu : (m,) or () float array
        Lamé parameters in pascal (of membranes times the thickness, in N/m), for all cells of the
        uncut mesh or one for each.
    law : {"hooke", "neo_hookean", "stable_neo_hookean"}
    """

    lam: Floats
    mu: Floats
    law: Law = "hooke"

    def of_cells(self, count: int) -> tuple[Floats, Floats]:
        """Return λ and μ (m,) of the cells of the uncut mesh, in pascal.

        Raises
        ------
        XfemError
            If there is neither one value nor one for each, or one is not finite. If a change of
            shape, or of size in the plane, stores no energy (μ ≤ 0, λ ≤ -μ).
        """
        for name, values in (("λ", self.lam), ("μ", self.mu)):
            finite_array(values, name, (), (count,))
        if not ((self.mu > 0.0) & (self.lam + self.mu > 0.0)).all():
            raise XfemError(
                f"Lamé parameters λ down to {np.min(self.lam):g} and μ down to "
                f"{np.min(self.mu):g} Pa; expected μ > 0 and λ > -μ"
            )
        lam, mu = (np.broadcast_to(values, count).astype(float) for values in (self.lam, self.mu))
        return lam, mu


def isotropic(young: ArrayLike, poisson: ArrayLike, state: State) -> Material:
    """Convert Young's modulus and Poisson's ratio to Lamé parameters.

    Parameters
    ----------
    young : float or (m,) array_like
        Young's modulus in pascal.
    poisson : float or (m,) array_like
        Poisson's ratio, in (−1, ½); in plane stress in (−1, 1).
    state : {"plane strain", "plane stress", "solid"}
        In plane stress λ becomes 2λμ/(λ + 2μ) = Eν/(1 − ν²).

    Raises
    ------
    XfemError
        If a parameter is outside its bounds, shapes do not match or the state is unknown.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> round(float(xfem.isotropic(2.6e3, 0.3, "plane strain").mu), 9)
    1000.0
    """
    E, nu = real_array(young, "Young's modulus"), real_array(poisson, "Poisson's ratio")
    check_choice(state, State, "state")
    if not (np.isfinite(E).all() and (E > 0.0).all()):
        raise XfemError(f"Young's modulus {E.min():g} Pa; expected positive and finite")
    bound = 1.0 if state == "plane stress" else 0.5
    if not ((nu > -1.0) & (nu < bound)).all():
        worst = nu.flat[int(np.argmax(np.abs(nu)))]
        raise XfemError(f"Poisson's ratio {worst:g}; expected within (-1, {bound:g}) in {state}")
    if E.shape != nu.shape and () not in (E.shape, nu.shape):
        raise XfemError(f"Young's modulus of shape {E.shape}, Poisson's ratio of {nu.shape}")
    mu = E / (2.0 * (1.0 + nu))
    if state == "plane stress":
        return Material(E * nu / (1.0 - nu**2), mu)
    return Material(E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), mu)


_SINGULAR = 1e-8  # determinant over the power of the trace: a rotation without a derivative


class Elements(NamedTuple):
    """Cells of a cut body, as the loops over them read them.

    Attributes
    ----------
    cells : (p, c) int array
        Corners of each piece, as in `PhantomMesh`.
    parent : (p,) int array
        Cells of the uncut mesh.
    gradients : (m, c, d) float array
        Of the shape functions, in 1/m.
    volumes : (p,) float array
        Of the pieces, in m^d.
    normals : (m, d) float array
        Unit normals of membranes; one row of zeros of all other bodies.
    lam, mu : (m,) float array
        Lamé parameters in pascal.
    axes, corners : tuple of int
        0…d − 1 and 0…c − 1: lengths that the compiler knows.
    is_membrane : bool
        Whether cells are triangles in space.
    """

    cells: Ints
    parent: Ints
    gradients: Floats
    volumes: Floats
    normals: Floats
    lam: Floats
    mu: Floats
    axes: tuple[int, ...]
    corners: tuple[int, ...]
    is_membrane: bool

    def part(self, some: slice | Ints) -> "Elements":
        """Return some of the cells."""
        return self._replace(
            cells=self.cells[some], parent=self.parent[some], volumes=self.volumes[some]
        )


def elements_of(phantom: PhantomMesh, material: Material) -> Elements:
    """Collect the elements of a cut body.

    Raises
    ------
    XfemError
        If the material has neither one value nor one per cell of the uncut mesh.
    """
    mesh = phantom.mesh
    normals = np.zeros((1, mesh.space))
    if mesh.is_membrane:
        normals = np.cross(mesh.edge_vectors[:, 0], mesh.edge_vectors[:, 1])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lam, mu = material.of_cells(len(mesh.cells))
    gradients = np.ascontiguousarray(mesh.gradients)
    axes, corners = tuple(range(mesh.space)), tuple(range(mesh.dim + 1))
    return Elements(
        phantom.cells, phantom.parent, gradients, phantom.volumes, normals, lam, mu, axes, corners,
        mesh.is_membrane,
    )  # fmt: skip


@njit(cache=True)
def deform(elements, displacement, unit, F):
    """Write `unit` I + ∇u to F (p, d, d), restricted to the tangent plane of membranes.

    The displacement (N_corners, d) is given at the corners.
    """
    cells, parent, gradients, _, normals, _, _, axes, corners, is_membrane = elements
    d, c = len(axes), len(corners)
    for p in range(len(cells)):
        cell = parent[p]
        for k in range(d):
            for l in range(d):
                total = unit if k == l else 0.0
                if is_membrane:
                    total -= unit * normals[cell, k] * normals[cell, l]
                for i in range(c):
                    total += displacement[cells[p, i], k] * gradients[cell, i, l]
                F[p, k, l] = total


@njit(cache=True)
def add_force(elements, R, F, unit, scale, force):
    """Add `scale` times the forces of E = sym(Rᵀ F) − `unit` I; return `scale` times the energy.

    With F from `deform` and the same `unit`: for one the internal force, for zero the product of
    rotation-fixed tangent and vector.

    Parameters
    ----------
    elements : Elements
    R, F : (p, d, d) float array
    unit, scale : float
    force : (N_corners, d) float array
    """
    cells, parent, gradients, volumes, normals, lam, mu, axes, corners, is_membrane = elements
    d, c = len(axes), len(corners)
    E, P = np.empty((d, d)), np.empty((d, d))
    energy = 0.0
    for p in range(len(cells)):
        cell = parent[p]
        for k in range(d):
            for l in range(d):
                E[k, l] = 0.0
                for m in range(d):
                    E[k, l] += R[p, m, k] * F[p, m, l]
        if is_membrane:  # nothing resists across the turned plane
            for l in range(d):
                across = 0.0
                for k in range(d):
                    across += normals[cell, k] * E[k, l]
                for k in range(d):
                    E[k, l] -= normals[cell, k] * (across - unit * normals[cell, l])
        trace = square = 0.0
        for k in range(d):
            E[k, k] -= unit
            trace += E[k, k]
            for l in range(k):
                E[k, l] = E[l, k] = 0.5 * (E[k, l] + E[l, k])
        for k in range(d):
            for l in range(d):
                square += E[k, l] * E[k, l]
        w, pressure, double = scale * volumes[p], lam[cell] * trace, 2.0 * mu[cell]
        energy += 0.5 * w * (double * square + pressure * trace)
        for k in range(d):
            for l in range(d):
                total = pressure * R[p, k, l]
                for m in range(d):
                    total += double * R[p, k, m] * E[m, l]
                P[k, l] = w * total
        for i in range(c):
            for k in range(d):
                total = 0.0
                for l in range(d):
                    total += P[k, l] * gradients[cell, i, l]
                force[cells[p, i], k] += total
    return energy


@njit(cache=True)
def add_rotation_fixed(elements, R, scale, targets, blocks):
    """Add `scale` times the rotation-fixed tangent to nodal blocks.

    Parameters
    ----------
    elements : Elements
    R : (p, d, d) float array
    scale : float
    targets : (p, c, c) int array
        Block of each pair of corners.
    blocks : (B, d, d) float array
    """
    cells, parent, gradients, volumes, normals, lam, mu, axes, corners, is_membrane = elements
    d, c = len(axes), len(corners)
    g, n = np.empty((c, d)), np.zeros(d)
    for p in range(len(cells)):
        cell = parent[p]
        wl, wm = scale * volumes[p] * lam[cell], scale * volumes[p] * mu[cell]
        for k in range(d):
            for i in range(c):
                g[i, k] = 0.0
                for l in range(d):
                    g[i, k] += R[p, k, l] * gradients[cell, i, l]
            if is_membrane:
                n[k] = 0.0
                for l in range(d):
                    n[k] += R[p, k, l] * normals[cell, l]
        for i in range(c):
            for j in range(i, c):
                dot = 0.0
                for k in range(d):
                    dot += wm * g[i, k] * g[j, k]
                upper, lower = targets[p, i, j], targets[p, j, i]
                for k in range(d):
                    for l in range(d):
                        value = wl * g[i, k] * g[j, l] + wm * g[j, k] * g[i, l]
                        if k == l:
                            value += dot
                        if is_membrane:
                            value -= dot * n[k] * n[l]
                        blocks[upper, k, l] += value
                        if i != j:
                            blocks[lower, l, k] += value


@njit(cache=True)
def add_moduli(elements, A, scale, targets, blocks):
    """Add the tangent of the moduli A (p, d, d, d, d), times `scale`, to nodal blocks."""
    cells, parent, gradients, volumes, _, _, _, axes, corners, _ = elements
    d, c = len(axes), len(corners)
    half = np.empty((d, d, d))
    for p in range(len(cells)):
        cell = parent[p]
        for i in range(c):
            for k in range(d):
                for l in range(d):
                    for m in range(d):
                        total = 0.0
                        for n in range(d):
                            total += gradients[cell, i, n] * A[p, k, n, l, m]
                        half[k, l, m] = scale * volumes[p] * total
            for j in range(c):
                at = targets[p, i, j]
                for k in range(d):
                    for l in range(d):
                        for m in range(d):
                            blocks[at, k, l] += half[k, l, m] * gradients[cell, j, m]


def restricted(elements: Elements) -> Floats:
    """Project on the tangent plane of membranes, (p, d, d); the identity (1, d, d) for solids."""
    identity = np.eye(len(elements.axes))[None]
    if not elements.is_membrane:
        return identity
    normals = elements.normals[elements.parent]
    return identity - normals[:, :, None] * normals[:, None, :]


def polar_slope(R: Floats, F: Floats, singular: float = _SINGULAR) -> tuple[Floats, Bools]:
    """Return ∂R/∂F (p, d, d, d, d) of nearest rotations; zero where there is none.

    With the skew matrices S_a of infinitesimal rotations and G_a = R S_a it is G_a (H⁻¹)_ab G_b.
    Here H = tr(U) I − U in space, tr(U) in the plane. Reason: dR = Σ ω_a G_a keeps RᵀF symmetric,
    so S_b : (dRᵀF + RᵀdF) = 0. That is Σ H_ba ω_a = G_b : dF with H_ba = S_b : (S_a U).

    Parameters
    ----------
    R, F : (p, d, d) float array
    singular : float
        Determinant of H over a power of the trace of U, up to which there is no derivative.

    Returns
    -------
    slope : (p, d, d, d, d) float array
    without : (p,) bool array
    """
    (count, d, _), spins = F.shape, SPINS[F.shape[1]]
    trace = np.einsum("pkl,pkl->p", R, F)
    cofactors, determinant = np.ones((count, 1, 1)), trace
    if d == 3:
        U = R.transpose(0, 2, 1) @ F
        H = trace[:, None, None] * np.eye(3) - 0.5 * (U + U.transpose(0, 2, 1))
        cofactors, determinant = adjugate(H)
    without = ~(determinant > singular * np.abs(trace) ** len(spins))
    inverse = cofactors / np.where(without, 1.0, determinant)[:, None, None]
    inverse[without] = 0.0
    # Σ G_a (H⁻¹)_ab G_b, G_a = R S_a: one large product for all of R S_a
    turns = len(spins)
    G = R.reshape(-1, d) @ spins.swapaxes(0, 1).reshape(d, -1)
    G = G.reshape(count, d, turns, d).swapaxes(1, 2).reshape(count, turns, d * d)
    slope = np.einsum("psi,psj->pij", G, inverse @ G)
    return slope.reshape(count, d, d, d, d), without


def consistent_moduli(elements: Elements, R: Floats, F: Floats) -> tuple[Floats, int]:
    """Compute the second derivative of the potential by F, (p, d, d, d, d) per volume.

    Cells whose rotation is not differentiable have the rotation-fixed moduli; the second value
    is how many they are.
    """
    lam, mu = elements.lam[elements.parent], elements.mu[elements.parent]
    trace = np.einsum("pkl,pkl->p", R, F) - (len(elements.corners) - 1)
    # A = 2μ δ_kl δ_nm + (λ tr(E) − 2μ) ∂R_kn/∂F_lm + λ R_kn R_lm
    A, without = polar_slope(R, F)
    A *= (lam * trace - 2.0 * mu)[:, None, None, None, None]
    rows = R.reshape(len(R), R[0].size)
    square = A.reshape(*rows.shape, -1)  # rows kn, columns lm
    np.einsum("pii->pi", square)[:] += (2.0 * mu)[:, None]
    if without.any():
        turned = R[without] @ restricted(elements)[without if elements.is_membrane else [0]]
        plane = turned @ turned.transpose(0, 2, 1)
        # μ (δ_kl δ_nm + R_km R_ln), of membranes δ_kl in the turned tangent plane
        fixed = np.einsum("pkl,nm->pknlm", plane, np.eye(F.shape[1]))
        fixed += np.einsum("pkm,pln->pknlm", R[without], R[without])
        A[without] = mu[without, None, None, None, None] * fixed
    square += np.einsum("pi,pj->pij", lam[:, None] * rows, rows)
    return A, int(without.sum())


_COLLAPSED = 1e-6  # stretch below which a direction carries no tension that could be meant


def turned_normals(elements: Elements, R: Floats) -> Floats:
    """Turn the normals of membranes by rotations (p, 3, 3): n (p, 3)."""
    return np.einsum("pkl,pl->pk", R, elements.normals[elements.parent])


def tension_moduli(elements: Elements, R: Floats, F: Floats, least: float) -> Floats:
    """Compute moduli A (p, 3, 3, 3, 3) of the geometric stiffness, as of a tangent of `element`."""
    n = turned_normals(elements, R)
    # A_knlm = n_k n_l S_nm
    return np.einsum("pk,pl,pnm->pknlm", n, n, positive_tension(elements, R, F, least))


def tension_forces(elements: Elements, R: Floats, F: Floats, vectors: Floats) -> Floats:
    """Multiply vectors (p, 3, 3) at corners by the geometric stiffness: forces (p, 3, 3)."""
    n, S = turned_normals(elements, R), positive_tension(elements, R, F, 0.0)
    b, w = elements.gradients[elements.parent], elements.volumes
    # f_i = w n (b_i · S ∇φ), ∇φ = Σ_j b_j (n · v_j)
    slope = b.transpose(0, 2, 1) @ (vectors @ n[:, :, None])
    return w[:, None, None] * (b @ S @ slope) * n[:, None, :]


def positive_tension(elements: Elements, R: Floats, F: Floats, least: float) -> Floats:
    """Compute positive part (p, 3, 3) of the tension of membranes, α I + β U in the tangent plane.

    Smaller principal values are replaced by `least` times μ: without it slack cells have no
    stiffness.
    """
    lam, mu = elements.lam[elements.parent], elements.mu[elements.parent]
    U = R.transpose(0, 2, 1) @ F
    U = 0.5 * (U + U.transpose(0, 2, 1))
    trace, square = np.einsum("pkk->p", U), np.einsum("pkl,pkl->p", U, U)
    gap = np.sqrt(np.maximum(2.0 * square - trace**2, 0.0))
    high, low = 0.5 * (trace + gap), 0.5 * (trace - gap)

    def tension(stretch: Floats) -> Floats:
        carries = stretch > _COLLAPSED
        value = 2.0 * mu * (stretch - 1.0) + lam * (trace - 2.0)
        return np.maximum(
            least * mu, np.where(carries, value / np.where(carries, stretch, 1.0), -np.inf)
        )

    first, second = tension(high), tension(low)
    apart = gap > 1e-12 * trace
    beta = np.where(apart, (first - second) / np.where(apart, gap, 1.0), 0.0)
    alpha = np.where(apart, first - beta * high, 0.5 * (first + second))
    return alpha[:, None, None] * np.eye(3) + beta[:, None, None] * U
