"""Generalised-α of the compact solver and of the reference: one motion of the same elements."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx, square

from reference.meshing.imprint import structured_triangles
from reference.meshing.opening import open_cut
from verify.scene import Material
from verify.xfem.body import DynamicBody, RayleighDamping
from verify.xfem.elasticity import isotropic
from verify.xfem.generalised_alpha import GeneralisedAlpha
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import consistent_mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.supports import Supports

pytestmark = needs_fenicsx


@pytest.mark.parametrize("rho", [0.3, 0.8])
def test_linear_motion_of_the_same_triangles_is_the_same(rho):
    from reference.dynamics import LinearMotion, generalised_alpha
    from reference.space import conforming_space

    points, cells = structured_triangles((0.0, 0.0), (1.3, 1.0), (7, 5))
    points = points + 0.02 * np.sin(9.0 * points[:, ::-1])  # general triangles
    space = conforming_space(open_cut(points, cells, np.zeros((0, 2), dtype=np.int64)), 1)

    import ufl
    from dolfinx import fem

    left = np.flatnonzero(space.node_points[:, 0] < 0.03)
    tissue = Material(young=1e4, poisson=0.3, plane="strain", density=1000.0)
    weight = fem.Constant(space.function_space.mesh, np.array([300.0, -9800.0]))
    rest = np.zeros_like(space.node_points)
    theirs = LinearMotion(
        tissue,
        space,
        (2 * left[:, None] + [0, 1]).ravel().astype(np.int32),
        rest,
        rest,
        lambda v: ufl.inner(weight, v) * ufl.dx,
        damping=(0.2, 1e-3),
    )
    *_, last = theirs.run(generalised_alpha(rho), 0.01, 40, 40)

    v = cut_mesh(SimplexMesh(space.node_points, space.cell_nodes.astype(np.int64)), [])
    mass = consistent_mass(v, 1000.0)
    body = DynamicBody(
        InternalForce(v, isotropic(1e4, 0.3, "plane strain"), "linear"),
        mass,
        weight=mass.weight([0.3, -9.8]),
        supports=Supports.none(v).prescribe(v, v.mesh.points[:, 0] < 0.03),
        damping=RayleighDamping(0.2, 1e-3),
    )
    state = body.rest()
    scheme = GeneralisedAlpha(body, 0.01, spectral_radius=rho)
    for _ in range(40):
        scheme.step(state)
    size = np.abs(last.displacement).max()
    assert size > 0.1
    assert state.displacement == pytest.approx(last.displacement, abs=1e-9 * size)
    assert state.velocity == pytest.approx(last.velocity, abs=1e-9 * np.abs(last.velocity).max())


def test_both_solvers_take_it_at_finite_rotation_and_find_the_same_motion():
    from verify.solvers.conforming import ConformingSolver
    from verify.solvers.xfem import XfemSolver

    scene = square(
        supports=[{"where": "left", "displacement": [0, 0]}],
        material={"young": 1e4, "poisson": 0.3, "plane": "strain", "density": 1000.0},
        loads=[{"kind": "gravity", "acceleration": [0, -9.8]}],
        analysis={
            "kind": "dynamic", "kinematics": "corotational", "duration": 0.3, "time_step": 0.01,
            "outputs": 4,
        },
    )  # fmt: skip
    given = {"scheme": "generalised_alpha", "spectral_radius": 0.6}
    ours = XfemSolver().solve(scene, 0, 0, mass="consistent", **given)
    theirs = ConformingSolver().solve(scene, 0, 0, **given)
    pairs = np.linalg.norm(ours.points[:, None] - theirs.points[None], axis=2).argmin(axis=1)
    found, wanted = ours.displacement, theirs.displacement[:, pairs]
    size = np.abs(wanted).max()
    assert size > 0.2
    # the reference ends a step at 1e-11 of its forces, ours at 1e-10 of its accelerations
    assert np.abs(found - wanted).max() < 1e-8 * size
    lost = [one.ledger["algorithmic"][-1] for one in (ours, theirs)]
    assert lost[0] == pytest.approx(lost[1], rel=1e-5)
    assert lost[0] > 0.0
