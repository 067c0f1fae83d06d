"""C4 from its page: gmsh's tetrahedra with the disc as a face, quadratic elements of scikit-fem.

Nodes are doubled on the disc; edges along the front are curved, and the nodes of edges that meet it
lie at a quarter of them, which gives the elements the root of the distance. Opening and factors
belong to the ellipsoid that fits the jump of the displacement.
"""

import gmsh
import numpy as np
import skfem
from scipy.sparse import coo_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import cg
from skfem.helpers import ddot, sym_grad, trace

YOUNG, POISSON, PRESSURE = 1.0, 0.3, 0.5
LAME = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
SHEAR = YOUNG / (2 * (1 + POISSON))
CENTRE = np.array([0.07, -0.04, 0.03])
# along the shear, across it, normal
AXES = np.array([[-0.48, 0.64, 0.6], [-0.8, -0.6, 0.0], [0.36, -0.48, 0.8]])
PULL, SLIDE = 0.64 + PRESSURE, 0.48
PAIRS = ((0, 1), (1, 2), (0, 2))  # corners of a triangle, with a node between


def field(points):
    """Exact displacement (3, n) at points (3, n) off the disc."""
    x, y, z = s = AXES @ (points - CENTRE[:, None])
    side, z = np.sign(z), np.abs(z)
    q = x**2 + y**2 + z**2 - 1
    zeta = np.sqrt((q + np.sqrt(q**2 + 4 * z**2)) / 2)
    m = z / zeta
    angle, nu = np.arctan2(1, zeta), POISSON
    f_z, f_r = -3 * m * (1 - zeta * angle), -1.5 * (angle - zeta / (1 + zeta**2))
    f_zz = 3 * (angle - zeta / (zeta**2 + m**2))
    f_rz = 3 * m / ((1 + zeta**2) * (zeta**2 + m**2))
    g = (-2 * f_r - f_zz) / (x**2 + y**2)
    b = 2 * PULL / (3 * np.pi) / (2 * SHEAR)
    c = 4 * SLIDE / (3 * np.pi * (2 - nu)) / (2 * SHEAR)
    spread = b * ((1 - 2 * nu) * f_r + z * f_rz)
    u = np.array([
        spread * x + c * side * (-2 * (1 - nu) * f_z + z * f_r + z * g * x**2),
        spread * y + c * side * z * g * x * y,
        side * b * (-2 * (1 - nu) * f_z + z * f_zz) + c * x * (-(1 - 2 * nu) * f_r + z * f_rz),
    ])  # fmt: skip
    strain = np.diag([-nu, -nu, 1.0]) / YOUNG
    return AXES.T @ u + strain @ (AXES.T @ s)


def solve(size):
    """Every quantity by its name, with elements of `size` at the front and four times that away."""
    mesh = opened(*tetrahedra(size))
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP2()), intorder=4)

    @skfem.BilinearForm
    def stiffness(u, v, _):
        strain = sym_grad(u)
        return LAME * trace(strain) * trace(sym_grad(v)) + 2 * SHEAR * ddot(strain, sym_grad(v))

    outside = np.abs(mesh.p[:, mesh.facets]).min(axis=1).max(axis=0) > 2 - 1e-9
    facets = mesh.boundary_facets()
    border, faces = facets[outside[facets]], facets[~outside[facets]]
    matrix = stiffness.assemble(basis)
    sides = [six_nodes(basis, facet) for facet in faces]
    held, known = basis.get_dofs(border), np.zeros(basis.N)
    for n in range(3):
        dofs = held.all(f"u^{n + 1}")
        known[dofs] = field(basis.doflocs[:, dofs])[n]
    free = basis.complement_dofs(held.all())
    inner = matrix[free][:, free]
    right = (pushed(basis, sides) - matrix @ known)[free]
    known[free], failed = cg(inner, right, rtol=1e-7, M=diags(1 / inner.diagonal()))
    assert not failed
    radius, top = ellipsoid(basis, known, sides)
    values = {"strain_energy": 0.5 * float(known @ (matrix @ known)), "opening": float(top[2])}
    along, across, normal = top * SHEAR * np.sqrt(np.pi / radius) / 2
    for degrees in range(0, 360, 45):
        x, y = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
        values[f"K_I_{degrees}"] = float(normal / (1 - POISSON))
        values[f"K_II_{degrees}"] = float((x * along + y * across) / (1 - POISSON))
        values[f"K_III_{degrees}"] = float(y * along - x * across)
    return values


def six_nodes(basis, facet):
    """Unknowns (6, 3) of a face of the disc, corners first, and the side of the body: 1 or -1."""
    mesh = basis.mesh
    cell, corners = mesh.f2t[0, facet], mesh.facets[:, facet]
    of_cell = mesh.t2e[:, cell]
    ends = mesh.edges[:, of_cell]
    between = [of_cell[np.isin(ends, corners[list(p)]).all(axis=0)][0] for p in PAIRS]
    side = np.sign((mesh.p[:, mesh.t[:, cell]].mean(axis=1) - CENTRE) @ AXES[2])
    return np.hstack([basis.nodal_dofs[:, corners], basis.edge_dofs[:, between]]).T, side


def pushed(basis, sides):
    """Forces of the pressure, which pushes both faces apart."""
    (xi, eta), weights = skfem.quadrature.get_quadrature(skfem.refdom.RefTri, 6)
    one = np.array([1 - xi - eta, xi, eta])

    def slope(*by):
        corners = (4 * one - 1) * np.reshape(by, (3, 1))
        return np.vstack([corners, [4 * (one[i] * by[j] + one[j] * by[i]) for i, j in PAIRS]])

    shapes = np.vstack([one * (2 * one - 1), [4 * one[i] * one[j] for i, j in PAIRS]])
    force = np.zeros(basis.N)
    for dofs, side in sides:
        places = basis.doflocs[:, dofs[:, 0]]
        tangents = (places @ slope(-1, 1, 0)).T, (places @ slope(-1, 0, 1)).T
        area = np.linalg.norm(np.cross(*tangents), axis=1)
        force[dofs] += side * PRESSURE * np.outer(shapes @ (weights * area), AXES[2])
    return force


def ellipsoid(basis, u, faces):
    """Radius and height (3,) of the ellipsoid that fits the jump within 0.9 of the radius.

    A uniform load opens a round crack to one. Its radius is that of which the elements act, which
    are stiff at the front: smaller by a part of their size.
    """
    sides = ({}, {})
    for dofs, side in faces:
        for three in dofs:
            sides[int(side < 0)][tuple(np.round(basis.doflocs[:, three[0]], 9) + 0.0)] = u[three]
    places = np.array([p for p in sides[0] if p in sides[1]])
    jump = np.array([AXES @ (sides[0][tuple(p)] - sides[1][tuple(p)]) for p in places])
    square = np.sum((places - CENTRE) ** 2, axis=1)
    inside = square < 0.81
    # the square of each component is linear in that of the distance; the largest tells the radius
    slope, height = np.polyfit(-square[inside], jump[inside, 2] ** 2, 1)
    radius = np.sqrt(height / slope)
    root = np.sqrt(1 - square[inside] / radius**2)
    return radius, jump[inside].T @ root / (root @ root)


def tetrahedra(size):
    """Points (n, 3), cells (k, 4) of a block with the disc among their faces, and those faces."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    block = gmsh.model.occ.addBox(-2, -2, -2, 4, 4, 4)
    disc = gmsh.model.occ.addDisk(0, 0, 0, 1, 1)
    turn = np.eye(4)
    turn[:3, :3], turn[:3, 3] = AXES.T, CENTRE
    gmsh.model.occ.affineTransform([(2, disc)], turn.ravel())
    found = gmsh.model.occ.fragment([(3, block)], [(2, disc)])[1][1]
    gmsh.model.occ.synchronize()
    front = [line for _, line in gmsh.model.getBoundary(found)]
    distance = gmsh.model.mesh.field.add("Distance")
    gmsh.model.mesh.field.setNumbers(distance, "CurvesList", np.abs(front))
    grading = gmsh.model.mesh.field.add("Threshold")
    limits = {"SizeMin": size, "SizeMax": 4 * size, "DistMin": 0.1, "DistMax": 1.2}
    for name, value in (limits | {"InField": distance}).items():
        gmsh.model.mesh.field.setNumber(grading, name, value)
    gmsh.model.mesh.field.setAsBackgroundMesh(grading)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    gmsh.model.mesh.generate(3)
    tags, points, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, dtype=int)
    number[tags] = np.arange(len(tags))
    cells = number[gmsh.model.mesh.getElementsByType(4)[1]].reshape(-1, 4)
    triangles = gmsh.model.mesh.getElementsByType(2, found[0][1])[1]
    gmsh.finalize()
    return points.reshape(-1, 3), cells, number[triangles].reshape(-1, 3)


def opened(points, cells, on_disc):
    """Double the nodes on the disc: corners share a node if a way through faces joins them."""
    mesh = skfem.MeshTet(points.T, np.sort(cells.T, axis=0)).remove_unused_nodes()
    middle = np.round(mesh.p[:, mesh.facets].mean(axis=1).T, 9)
    wanted = {tuple(p) for p in np.round(points[on_disc].mean(axis=1), 9) + 0.0}
    cut = np.array([tuple(p) in wanted for p in middle + 0.0])
    assert cut.sum() == len(on_disc)
    one, two = mesh.f2t[:, (mesh.f2t[1] >= 0) & ~cut]
    nodes = mesh.facets[:, (mesh.f2t[1] >= 0) & ~cut]
    i, j = np.hstack([
        [4 * t + np.argmax(mesh.t[:, t] == node, axis=0) for t in (one, two)] for node in nodes
    ])  # fmt: skip
    graph = coo_matrix((np.ones(len(i)), (i, j)), shape=(4 * mesh.nelements,) * 2)
    count, node = connected_components(graph, directed=False)
    doubled = np.empty((3, count))
    doubled[:, node] = mesh.p[:, mesh.t.T.ravel()]
    straight = skfem.MeshTet(doubled, np.sort(node.reshape(-1, 4).T, axis=0))
    return with_quarter_points(straight)


def with_quarter_points(straight):
    """Give the elements quadratic sides: on the circle along the front, else root-like from it."""
    mesh = skfem.MeshTet2.from_mesh(straight)
    local = AXES @ (straight.p - CENTRE[:, None])
    on_front = (np.abs(local[2]) < 1e-6) & (np.abs(np.hypot(*local[:2]) - 1) < 1e-6)
    places = mesh.doflocs.copy()
    start, end = straight.edges
    for near, far in ((start, end), (end, start)):
        meets = on_front[near] & ~on_front[far]
        quarter = 0.75 * straight.p[:, near] + 0.25 * straight.p[:, far]
        places[:, straight.nvertices + np.flatnonzero(meets)] = quarter[:, meets]
    along = straight.nvertices + np.flatnonzero(on_front[start] & on_front[end])
    spokes = places[:, along] - CENTRE[:, None]
    places[:, along] = CENTRE[:, None] + spokes / np.linalg.norm(spokes, axis=0)
    return skfem.MeshTet2(places, mesh.t)
