"""Masses of a cut body: exact totals, moments and changes of basis."""

import numpy as np
import pytest
from cut_bodies import DENSITY, cut_body, cut_membrane, cut_square, material
from scipy.sparse import csr_array
from thesis_blocks import transformation

import verify.xfem as xfem
from verify.accelerated import FAST
from verify.methods.mass_variants import shifted_mass
from verify.xfem import body as body_in_motion
from verify.xfem.arrays import XfemError
from verify.xfem.cuts import Plane
from verify.xfem.implicit import Trapezoidal
from verify.xfem.linear_solvers import PLAIN
from verify.xfem.mass import Mass, consistent_mass, second_moments, side_wise_mass
from verify.xfem.mesh import box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.polar import SPINS
from verify.xfem.subdivision import extrapolation, subdivide

LUMPINGS = ("enrichment", "row sum", "weighted diagonal")


def _all_masses(v):
    shifted = [shifted_mass(v, DENSITY, lumping) for lumping in LUMPINGS]
    return [side_wise_mass(v, DENSITY), consistent_mass(v, DENSITY), *shifted]


@pytest.mark.parametrize("body", [lambda: cut_body(2), lambda: cut_body(3), cut_membrane])
def test_every_mass_gives_a_body_that_moves_as_one_its_own_kinetic_energy(body):
    v = body()
    total = DENSITY * v.mesh.measures.sum()
    ones = np.ones((v.node_count, 1))
    for mass in _all_masses(v):
        assert np.sum(ones * mass.apply(ones)) == pytest.approx(total, rel=1e-13)
        assert mass.weights.sum() == pytest.approx(total, rel=1e-13)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_separated_half_keeps_its_inertia_only_if_the_mass_knows_the_sides(dim):
    v = cut_body(dim)
    above = (v.node_side[:, :1] > 0).astype(float)
    expected = DENSITY * v.volumes[v.bodies[v.cells[:, 0]] == v.bodies[np.argmax(above)]].sum()
    side_wise, consistent, *shifted = _all_masses(v)
    for mass in (side_wise, consistent):
        assert np.sum(above * mass.apply(above)) == pytest.approx(expected, rel=1e-13)
    for mass in shifted:  # (2.76–81): too heavy, M_ua is missing
        assert np.sum(above * mass.apply(above)) > 1.01 * expected


def test_with_the_thesis_lumping_a_freed_half_falls_too_slowly():
    """(2.80–81) leave out M_ua: at mid-cell, 8 × 8, −8.757 instead of −9.8."""
    v = cut_square(8, (0.5, 0.4375), (0.0, 1.0))
    lower = (v.node_side[:, :1] < 0).astype(float)
    for mass, g in ((side_wise_mass(v, 1.0), 9.8), (shifted_mass(v, 1.0, "enrichment"), 8.757)):
        pull = np.sum(lower * mass.weight([0.0, 9.8])[:, 1:])
        assert pull / np.sum(lower * mass.apply(lower)) == pytest.approx(g, abs=5e-4)


@pytest.mark.parametrize("dim", [2, 3])
def test_second_moments_are_those_of_a_rule_of_higher_order(dim):
    v = cut_body(dim)
    moments = second_moments(v)
    assert np.allclose(moments.sum(axis=2), v.shape_integrals, rtol=1e-12, atol=1e-18)
    # independent: midpoints of edges (2D) and the 4-point rule (3D) are exact for quadratics
    sub = v.sub_cells
    a = 0.5 if dim == 2 else (5.0 - np.sqrt(5.0)) / 20.0
    rule = np.full((dim + 1, dim + 1), a) + (1.0 - (dim + 1) * a) * np.eye(dim + 1)
    expected = np.zeros_like(moments)
    for point in rule:
        N = np.einsum("v,kvi->ki", point, sub.barycentric)
        w = sub.fraction * v.mesh.measures[v.parent[sub.piece]] / (dim + 1)
        np.add.at(expected, sub.piece, w[:, None, None] * N[:, :, None] * N[:, None, :])
    assert np.allclose(moments[v.split], expected[v.split], rtol=1e-12, atol=1e-18)


@pytest.mark.parametrize("dim", [2, 3])
def test_every_mass_is_positive_definite_and_solved_by_its_inverse(dim):
    v = cut_body(dim)
    forces = np.random.default_rng(0).normal(size=v.node_points.shape)
    for mass in _all_masses(v):
        assert np.linalg.eigvalsh(mass.matrix.toarray())[0] > 0.0
        assert np.allclose(mass.apply(mass.solve(forces)), forces, rtol=1e-9)
        if mass.root is not None:
            inverse = (mass.root @ mass.root.T).toarray()
            assert np.allclose(inverse @ mass.matrix.toarray(), np.eye(v.node_count), atol=1e-9)


def test_enrichment_lumping_is_diagonal_in_the_shifted_unknowns():
    """(2.80–81): Tᵀ M T = diag(Σ m/n, Σ m/n (V_a ψ_a² + V_b ψ_b²)/V), p = T q."""
    v = cut_body(2)
    mesh, T = v.mesh, transformation(v)
    M = T.T @ shifted_mass(v, DENSITY, "enrichment").matrix.toarray() @ T
    expected = np.zeros(v.node_count)
    np.add.at(expected, mesh.cells, (DENSITY * mesh.measures / 3.0)[:, None])
    place = dict(zip(v.enriched_nodes, range(len(mesh.points), v.node_count), strict=True))
    for piece in np.flatnonzero(v.split):  # ψ is 0 on the side of the node, ±1 on the other
        for node in mesh.cells[v.parent[piece]]:
            if node in place and v.node_side[node, 0] != v.label[piece, 0]:
                expected[place[node]] += DENSITY * v.volumes[piece] / 3.0
    assert np.abs(M - np.diag(expected)).max() < 1e-12 * expected.max()


def _beside_nodes(dim, fraction, kernels=FAST):
    """A body with a consistent mass, a cut at a share of an element from a node, and supports.

    One support holds a side in all components, another a further side in the last one.
    """
    mesh = rectangle_mesh((5, 4)) if dim == 2 else box_mesh((4, 3, 3))
    node = mesh.points[np.argmin(np.linalg.norm(mesh.points - 0.5, axis=1))]
    point = node + fraction * np.eye(dim)[-1] / 4.0
    v = xfem.cut_mesh(
        mesh, [Plane(point, [0.0, 0.0, 1.0][-dim:]), Plane([0.37] * dim, [1.0, 0.3, 0.2][:dim])]
    )
    held = xfem.Supports.none(v).prescribe(v, mesh.points[:, 0] == 0.0)
    held = held.prescribe(v, mesh.points[:, 1] == 0.0, components=[dim - 1])
    force = xfem.InternalForce(v, material(dim), kernels=kernels)
    return xfem.DynamicBody(force, consistent_mass(v, DENSITY), supports=held)


@pytest.mark.parametrize("kernels", [FAST, PLAIN])
@pytest.mark.parametrize("fraction", [0.3, 1e-4, 1e-8, 1e-12])
@pytest.mark.parametrize("dim", [2, 3])
def test_accelerations_balance_the_forces_on_every_unknown_of_slivers_too(
    dim, fraction, kernels, monkeypatch
):
    """By factors each equation of M a = f to round-off of its terms; by iterations all together.

    These are for large solids, and for the first solution; there all but 1e-15 of ‖D^-½ f‖ is left,
    with D the diagonal, as masses of slivers weigh ε³. Where a component is held it does not move.
    """
    body = _beside_nodes(dim, fraction, kernels)
    supports, random = (
        [body.supports, xfem.Supports.none(body.force.phantom)],
        np.random.default_rng(5),
    )
    for iterates in (False, True):
        monkeypatch.setattr(body_in_motion, "_LARGE", 0 if iterates else 10_000)
        for held in supports:
            given = body.held_by(held)
            wanted = np.where(given.fixed, 0.0, random.normal(size=body.shape))
            forces, M, free = body.mass.apply(wanted), body.mass.matrix, ~given.fixed
            found = given.free_mass.solve(forces.copy())
            assert not found[given.fixed].any()
            left = np.where(free, M @ found - forces, 0.0)
            scale = np.sqrt(M.diagonal())[:, None]
            assert np.linalg.norm(left / scale) < 1e-14 * np.linalg.norm(forces / scale)
            if iterates and dim == 3:
                found = given.free_mass.solve(forces.copy())  # by factors from now on
                left = M @ found - forces
            assert (np.abs(left)[free] < 1e-14 * (abs(M) @ np.abs(found))[free]).all()


@pytest.mark.parametrize("dim", [2, 3])
def test_beside_a_sliver_the_scaled_mass_is_as_regular_as_of_whole_elements(dim):
    """κ ≤ d + 2 of whole simplices, of either side of a cut at a node little more."""
    for fraction in (1e-3, 1e-6, 1e-12):
        mass = _beside_nodes(dim, fraction).mass
        scale = 1.0 / np.sqrt(mass.matrix.diagonal())
        assert np.linalg.cond(mass.matrix.toarray() * scale * scale[:, None]) < 50.0


def test_where_iterations_fail_the_mass_is_factorised_and_a_singular_one_is_an_error(monkeypatch):
    body = _beside_nodes(3, 1e-3)
    monkeypatch.setattr(body_in_motion, "_LARGE", 0)
    wanted = np.where(body.fixed, 0.0, np.random.default_rng(2).normal(size=body.shape))
    monkeypatch.setattr(body_in_motion, "_LIMIT", 3)
    found = body.free_mass.solve(body.mass.apply(wanted))
    assert found == pytest.approx(wanted, abs=1e-9)
    singular = Mass(csr_array(np.ones((2, 2))), None, np.ones(2))
    with pytest.raises(XfemError, match="singular"):
        singular.solve(np.ones((2, 1)))


def _in_long_doubles(M, forces):
    """M⁻¹ F by elimination with 64 bits of mantissa, of M scaled to a unit diagonal."""
    scale = 1.0 / np.sqrt(np.diag(M).astype(np.longdouble))
    left, right = M * scale * scale[:, None], forces * scale[:, None]
    for k in range(len(M)):
        factors = left[k + 1 :, k] / left[k, k]
        left[k + 1 :] -= np.multiply.outer(factors, left[k])
        right[k + 1 :] -= np.multiply.outer(factors, right[k])
    for k in reversed(range(len(M))):
        right[k] = (right[k] - left[k, k + 1 :] @ right[k + 1 :]) / left[k, k]
    return right * scale[:, None]


def _nearly_meeting(dim, gap):
    mesh = rectangle_mesh((4, 3)) if dim == 2 else box_mesh((2, 2, 2))
    normal = np.array([0.2, 1.0, 0.35][:dim])
    normal /= np.linalg.norm(normal)
    point = np.array([0.5, 0.53, 0.47][:dim])
    return cut_mesh(mesh, [Plane(point, normal), Plane(point + gap * normal, normal)])


@pytest.mark.parametrize("gap", 10.0 ** np.arange(-11, -2))
@pytest.mark.parametrize("dim", [2, 3])
def test_accelerations_between_cuts_that_nearly_meet_have_digits_or_are_refused(dim, gap):
    """The part of thickness g between two cuts has a mass of condition number 1/g².

    Of sixteen digits two are left at 1e-7 of a body of three or four elements; each tenth of the
    gap takes two.
    """
    v = _nearly_meeting(dim, gap)
    mass = consistent_mass(v, DENSITY)
    root = np.sqrt(mass.matrix.diagonal())[:, None]
    forces = root * np.random.default_rng(3).normal(size=(v.node_count, dim))
    if gap < 3e-9:
        with pytest.raises(XfemError, match="too thin"):
            mass.solve(forces)
        return
    try:
        found = mass.solve(forces)
    except XfemError:
        assert gap < 3e-7
        return
    wanted = _in_long_doubles(mass.matrix.toarray(), forces)
    assert np.abs(root * (found - wanted)).max() < 1e-2 * np.abs(root * wanted).max()


@pytest.mark.parametrize("dim", [2, 3])
def test_a_critical_step_between_cuts_that_nearly_meet_is_refused_as_the_accelerations_are(dim):
    for gap, fits in ((1e-4, True), (1e-10, False)):
        v = _nearly_meeting(dim, gap)
        mass, force = consistent_mass(v, DENSITY), xfem.InternalForce(v, material(dim), "linear")
        K = mass.pattern(v).matrix(force.stiffness(mass.pattern(v)))
        if not fits:
            with pytest.raises(XfemError, match="too thin"):
                xfem.critical_step(K, mass)
            continue
        # Rayleigh: u = n (x·n − m) stores V (λ + 2μ)/2 and has the mass ρ V g²/12
        lam, mu = material(dim).of_cells(1)
        highest = np.sqrt(12.0 * (lam[0] + 2.0 * mu[0]) / DENSITY) / gap
        assert 0.0 < xfem.critical_step(K, mass) < 2.0 / highest * (1.0 + 1e-6)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_mass_on_the_points_of_the_subdivision_moves_as_that_on_dof_nodes(dim):
    """Phantom nodes are no points: what they do follows from those of their pieces.

    Up to three planes anywhere, so parts without a node of their own and small parts too; energies
    of random velocities are sums of squares, so round-off of the smallest cell remains small.
    """
    generator = np.random.default_rng(2701 + dim)
    mesh = rectangle_mesh((4, 3)) if dim == 2 else box_mesh((2, 2, 2))
    for _ in range(4):
        count = generator.integers(1, 4)
        planes = [Plane(generator.uniform(0.2, 0.8, dim), generator.normal(size=dim))
                  for _ in range(count)]  # fmt: skip
        v = cut_mesh(mesh, planes)
        body = subdivide(v)
        back = extrapolation(v, body)
        velocity = generator.normal(size=(v.node_count, dim))
        shown = body.interpolation @ velocity
        for mass in (side_wise_mass(v, DENSITY), consistent_mass(v, DENSITY)):
            on_points = back.T @ mass.matrix @ back
            energy = np.sum(velocity * mass.apply(velocity))
            assert np.sum(shown * (on_points @ shown)) == pytest.approx(energy, rel=1e-9)
            weights = np.asarray(on_points.sum(axis=1)).ravel()
            assert weights @ shown == pytest.approx(mass.weights @ velocity, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("fraction", [1e-2, 1e-5, 1e-10])
@pytest.mark.parametrize("dim", [2, 3])
def test_slivers_with_a_consistent_mass_are_solved_for_as_all_the_rest(dim, fraction):
    """A body that turns, cut beside nodes: where there is material, as with a closer tolerance.

    And by at most one correction a step more than with the side-wise mass.
    """
    mesh = xfem.rectangle_mesh((5, 4)) if dim == 2 else xfem.box_mesh((3, 2, 2))
    node = mesh.points[np.argmin(np.linalg.norm(mesh.points - 0.5, axis=1))]
    cut = xfem.Plane(node + fraction * np.eye(dim)[-1] / 4.0, [0.1, 0.0, 1.0][-dim:])
    v = xfem.cut_mesh(mesh, [cut])
    force, shown = xfem.InternalForce(v, material(dim)), subdivide(v).interpolation
    found, solves = [], []
    cases = ((side_wise_mass, 1e-10), (consistent_mass, 1e-10), (consistent_mass, 1e-13))
    for mass, tolerance in cases:
        body = xfem.DynamicBody(force, mass(v, DENSITY))
        scheme, state = Trapezoidal(body, 0.005), body.rest()
        scheme.tolerance = tolerance
        state.velocity[:] = (v.node_points - 0.5) @ (2.0 * SPINS[dim][0] + 0.5 * np.eye(dim))
        for _ in range(20):
            scheme.step(state)
        found.append(shown @ state.displacement)
        solves.append(scheme.solves)
    size = np.abs(found[2]).max()
    assert np.abs(found[1] - found[2]).max() < 1e-8 * size  # twenty steps of 1e-10 each
    assert solves[1] <= solves[0] + 20
