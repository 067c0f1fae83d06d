"""Neo-Hookean bodies: UFL against the elements of `verify.xfem`, the comparison, exact fields."""

from dataclasses import replace

import numpy as np
import pytest
from fourth_order import difference
from large_bodies import space_of
from reference_scenes import needs_fenicsx

import verify.xfem as xfem
from reference.exact import exact_solution
from reference.law import Law
from verify.compare.hooke import law_of
from verify.errors import InputError
from verify.scene import Material, Scene, load_scene
from verify.solvers import find_solver
from verify.xfem import hyperelastic
from verify.xfem.hyperelastic import averages

pytestmark = needs_fenicsx

MODELS = ("neo_hookean", "stable_neo_hookean")


def tissue(model, **more):
    return Material(young=1.0, poisson=0.3, model=model, **more)


def scene_of(model, d):
    file = "rotation/neo_hookean_halves" if d == 2 else "rotation/tissue_strip_solid"
    content = load_scene(file).model_dump(mode="json", by_alias=True)
    content["material"] |= {"young": 1.0, "poisson": 0.3, "model": model}
    return Scene.model_validate(content)


@pytest.mark.parametrize(("model", "d"), [("neo_hookean", 3), ("stable_neo_hookean", 2)])
def test_energies_and_forces_are_those_of_other_elements_and_of_the_comparison(model, d):
    """And the mean force of a step does the change of energy and turns nothing."""
    space = space_of(1, (2, 2) if d == 2 else (1, 1, 1))
    law = Law(tissue(model, plane="strain" if d == 2 else None), space, model)
    x, rng = space.node_points, np.random.default_rng(3)
    u, later = 0.07 * rng.standard_normal((2, *x.shape))
    body = xfem.cut_mesh(xfem.SimplexMesh(x, space.cell_nodes), [])
    kind = "plane strain" if d == 2 else "solid"
    other = xfem.InternalForce(body, replace(xfem.isotropic(1.0, 0.3, kind), law=model))
    theirs, same = other.evaluate(u)
    assert same == pytest.approx(law.energy(u.ravel()), rel=1e-12)
    force = law.force(u.ravel()).reshape(x.shape)
    assert theirs == pytest.approx(force, abs=1e-12 * np.abs(force).max())
    slopes = [
        np.einsum("mci,mcj->mij", one[body.mesh.cells], body.mesh.gradients) for one in (u, later)
    ]
    density = law_of(scene_of(model, d)).energy_density(slopes[0])
    assert body.volumes @ density == pytest.approx(same, rel=1e-12)
    force = law.averaged(u.ravel(), later.ravel()).reshape(x.shape)
    change = law.energy(later.ravel()) - law.energy(u.ravel())
    assert np.sum(force * (later - u)) == pytest.approx(change, rel=1e-12)
    torque = (x + (u + later) / 2).T @ force
    assert torque == pytest.approx(torque.T, abs=1e-13 * np.abs(torque).max())
    assert np.abs(force.sum(axis=0)).max() < 1e-13 * np.abs(force).max()
    F0, F1 = (np.eye(d) + slope for slope in slopes)
    lam, mu = (np.full(len(F0), value[0]) for value in (other.elements.lam, other.elements.mu))
    P = averages(hyperelastic.Law(lam, mu, model == "stable_neo_hookean"), F0, F1).stress
    theirs = np.zeros(x.shape)
    shares = np.einsum("m,mij,mcj->mci", body.volumes, P, body.mesh.gradients)
    np.add.at(theirs, body.mesh.cells, shares)
    assert theirs == pytest.approx(force, abs=1e-12 * np.abs(force).max())
    # its tangent, by a difference
    step, way = 1e-5, rng.standard_normal(later.size)
    ends = (law.averaged(u.ravel(), later.ravel() + sign * step * way) for sign in (1.0, -1.0))
    slope = np.subtract(*ends) / (2 * step)
    tangent = law.averaged_tangent(u.ravel(), later.ravel())
    vector = tangent.createVecRight()
    vector.array[:] = space.own_part(way)
    found = space.everywhere((tangent * vector).array).ravel()
    assert found == pytest.approx(slope, abs=1e-7 * np.abs(slope).max())
    tangent.destroy()


@pytest.mark.parametrize("model", MODELS)
def test_halves_bent_to_circles_are_in_equilibrium_with_free_faces(model):
    """Energy less radial stress times stretch is the same all across (first integral)."""
    law = law_of(scene_of(model, 2))
    given = {"point": [0, 0], "angle": 90.0, "thickness": [0.25, 0.4], "curvature": [1.2, 2.0]}
    one = exact_solution("rolled_halves", given, tissue(model, plane="strain"))
    for sign, thick in ((-1.0, 0.25), (1.0, 0.4)):
        x = np.column_stack([sign * thick * np.linspace(1e-9, 1 - 1e-9, 9), np.full(9, 0.3)])
        gradient = one.gradient(x)
        assert difference(one.displacement, x[1:-1], 1e-3) == pytest.approx(
            gradient[1:-1], abs=1e-9
        )
        stress = law.piola(gradient)
        assert np.abs(stress[[0, -1], :, 0]).max() < 1e-8  # over E
        radial = np.einsum("ni,ni->n", stress[:, :, 0], gradient[:, :, 0] + [1.0, 0.0])
        first = law.energy_density(gradient) - radial
        assert np.ptp(first) < 1e-9 * np.abs(law.energy_density(gradient)).max()


def test_the_energy_of_a_bent_strip_is_the_catalogues():
    """h = 0.1, c = π, L = 1, E = 1, ν = 0.3: 4.47404718e-4 J/m, found by another method."""
    material = tissue("neo_hookean", plane="strain")
    given = {"point": [0, 0], "angle": 90.0, "thickness": [0.1, 0.1], "curvature": [np.pi, np.pi]}
    one, law = exact_solution("rolled_halves", given, material), law_of(scene_of("neo_hookean", 2))
    node, weight = np.polynomial.legendre.leggauss(20)
    x = np.column_stack([0.05 * (1 + node), np.full(20, 0.2)])
    energy = 0.05 * weight @ law.energy_density(one.gradient(x))
    assert energy == pytest.approx(4.47404718e-4, rel=1e-8)


@pytest.mark.parametrize("model", MODELS)
def test_mode_iii_is_exact_at_any_strain_and_the_other_modes_are_refused(model):
    given = {"point": [0, 0, 0], "normal": [0, 1, 0], "axis": [1, 0, 0], "intensity": [0, 0, 2.0]}
    one, law = exact_solution("straight_front", given, tissue(model)), law_of(scene_of(model, 3))
    x = np.random.default_rng(8).uniform(0.1, 0.4, (20, 3))

    def stress(points):
        return law.piola(one.gradient(points)).reshape(len(points), 9)

    slope = difference(stress, x, 1e-3).reshape(len(x), 3, 3, 3)
    assert np.abs(np.einsum("nijj->ni", slope)).max() < 1e-6 * np.abs(slope).max()
    assert np.linalg.norm(one.gradient(x), axis=(1, 2)).max() > 2.0
    face = np.column_stack([-x[:, 0], np.full(20, 1e-12), x[:, 2]])
    assert np.abs(law.piola(one.gradient(face))[:, :, 1]).max() < 1e-4
    with pytest.raises(InputError, match="III alone"):
        exact_solution("straight_front", given | {"intensity": [1.0, 0, 0]}, tissue(model))


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("d", [2, 3])
def test_stretched_halves_leave_the_faces_of_the_cut_free(model, d):
    strain = [0.6, -0.3] if d == 2 else [[0.6, 0.2], [-0.3, 0.1]]
    given = {"point": d * [0.0], "strain": strain, **({"angle": 30.0} if d == 2 else {})}
    given |= {} if d == 2 else {"normal": [1, 2, 3], "axis": [2, -1, 0]}
    material = tissue(model, plane="strain" if d == 2 else None)
    one = exact_solution("patch" if d == 2 else "solid_patch", given, material)
    normal = np.array([-0.5, 0.75**0.5]) if d == 2 else np.array([1, 2, 3]) / 14**0.5
    gradient = one.gradient(np.array([normal, -normal]))
    stress = law_of(scene_of(model, d)).piola(gradient)
    assert np.abs(stress @ normal).max() < 1e-14
    along = [1.6, 0.7] if d == 2 else [1.6 * 1.2, 0.7 * 1.1]
    across = np.einsum("i,nij,j->n", normal, gradient, normal) + 1.0
    assert np.linalg.det(np.eye(d) + gradient) == pytest.approx(along * across, rel=1e-13)
    # what is drawn out in length contracts across, but by less than to its old volume
    assert 1.0 / along[0] < across[0] < 1.0
    assert 1.0 < across[1] < 1.0 / along[1]
    with pytest.raises(InputError, match="integrated over the body"):
        one.strain_energy(np.zeros((2, d)))


def test_other_exact_fields_are_of_hookes_law():
    with pytest.raises(InputError, match="Hooke's law"):
        exact_solution("penny", {}, tissue("neo_hookean"))


BLADE = {
    "kind": "tool_path", "name": "incision", "points": [[0.046, 0.0695], [0.053, 0.029]],
    "speed": 1.0, "starts_at": 0.0, "expected": "edge",
}  # fmt: skip


def test_a_blade_stops_in_stretched_tissue_and_its_account_closes():
    """Nodes let go beside its end travel farther in a step than their elements are large.

    The step in which it stops is taken in halves, from where the body was.
    """
    content = load_scene("rotation/neo_gaping_strip").model_dump(mode="json", by_alias=True)
    for name in ("quantities", "acceptance", "tags"):
        del content[name]
    content["cuts"] = [BLADE]
    content["supports"][1] |= {"displacement": [0.03], "history": None}
    content["initial"] = {"kind": "equilibrium"}
    content["reference"] = {"size": 0.016, "degree": 1}
    content["analysis"] |= {"duration": 0.045, "time_step": 0.001, "outputs": 4}
    found = find_solver("reference").solve(Scene.model_validate(content), 1, 0)
    assert "steps in halves" in found.notes
    corners = found.points[found.cells] + found.displacement[-1][found.cells]
    before = np.linalg.det(np.diff(found.points[found.cells], axis=1))
    assert (np.linalg.det(np.diff(corners, axis=1)) / before).min() > 0.0
    total = found.ledger["total"]
    assert np.ptp(total) <= 1e-9 * found.ledger["strain"].max()
    assert found.ledger["cut_work"][-1] > 0.1 * np.ptp(found.ledger["strain"])
