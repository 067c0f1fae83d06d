"""XFEM in GetFEM: level sets with tips, values of both sides.

A cut is a level set that ends where a second one is positive. Elements that it divides wholly have
values of each side; those where it ends have none, so that it ends at the facet before. With
``tip = functions`` there are functions of the tips around its ends, and it ends where it does.
"""

import getfem as gf
import numpy as np
from cut_body import divided, forces, held_at_rest, uniform_weight
from exchange_files import RefusedError, run
from scipy.sparse import csr_matrix, diags, hstack
from scipy.sparse.linalg import splu
from tip_functions import RULES, SHARE, TipAreas
from tip_mesh import TipMesh

PULLED = 1e-3  # share by which points of evaluation are drawn into their own cell
PULLED_AT_TIPS = 1e-6  # where what is evaluated is not linear in it


class Space:
    """The enriched spaces on the scene's mesh, scalar and of displacements.

    ``areas`` are those around tips that have functions, None without any.
    """

    def __init__(self, case, body, areas):
        d = case.dimension
        name = {2: "TRIANGLE", 3: "TETRAHEDRON"}[d]
        self.mesh = gf.Mesh("empty", d)
        linear = gf.GeoTrans(f"GT_PK({d},1)")
        self.mesh.add_convex(linear, np.asfortranarray(case.points[case.cells].transpose(2, 1, 0)))
        element = gf.Fem(f"FEM_PK({d},1)")
        rules = [gf.Integ(text) for text in (RULES if areas else [f"IM_{name}(2)"])]
        self.cuts = gf.MeshLevelSet(self.mesh)
        self.levels = []
        for cut in body.cuts:
            level = gf.LevelSet(self.mesh, 1, "ws")
            at = level.mf().basic_dof_nodes().T
            level.set_values(cut.level(at)[0], cut.beyond(at))
            self.cuts.add(level)
            self.levels.append(level)
        if self.levels:
            self.cuts.adapt()
            self.rule = gf.MeshIm("levelset", self.cuts, "all", *rules)
            self.rule.set_integ(rules[0])
        else:
            self.rule = gf.MeshIm(self.mesh, rules[0])
        self.scalar, self.vector = (self._enriched(element, size) for size in (1, d))
        self.areas, self.tips = areas, ()
        if areas:
            hats = gf.MeshFem(self.mesh, 1)
            hats.set_fem(element)
            self.tips = areas.spaces(case, self, hats)

    def _enriched(self, element, size):
        plain = gf.MeshFem(self.mesh, 1)
        plain.set_fem(element)
        whole = plain
        if self.levels:
            whole = gf.MeshFem("sum", gf.MeshFem("levelset", self.cuts, plain))
        whole.set_qdim(size)
        return whole


def matrix_of(found):
    """Return a matrix of GetFEM as SciPy has it."""
    found.to_csc()
    starts, rows = found.csc_ind()
    values, size = found.csc_val(), found.size()
    return csr_matrix((values, rows, starts), shape=(size[1], size[0])).T.tocsr()


def evaluation(answer, scalar, pulled):
    """Values at the nodes of the answer of a scalar space, as a matrix.

    Each is that of one of its cells, from within: on a cut a point belongs to both sides. With
    them come the values at the middles of the cells.
    """
    cell = np.zeros(len(answer.points), dtype=int)
    cell[answer.cells] = np.arange(len(answer.cells))[:, None]
    middles = answer.points[answer.cells].mean(axis=1)
    inside = answer.points + pulled * (middles[cell] - answer.points)
    near, middle = (
        matrix_of(gf.asm_interpolation_matrix(scalar, np.asfortranarray(at.T)))
        for at in (inside, middles)
    )
    return ((near - pulled * middle[cell]) / (1 - pulled)).tocsr(), middle


def unknown_of_groups(case, body, answer, space, middle):
    """Return the scalar unknown (groups,) that is the value of each group, -1 for none."""
    at = space.scalar.basic_dof_nodes().T
    order = {tuple(p): k for k, p in enumerate(case.points.round(9))}
    node = np.array([order.get(tuple(p), -1) for p in at.round(9)])
    row, column = middle.nonzero()
    keep = np.abs(np.asarray(middle[row, column]).ravel()) > 1e-12
    row, column = row[keep], column[keep]
    found = np.full(body.count, -1)
    found[body.group[answer.side[row], node[column]]] = column
    return found


def system(case, space, weight):
    """Return stiffness and forces of a uniform force per volume, regular unknowns first."""
    lame, shear = float(case.constant("lame")[0]), float(case.constant("shear")[0])
    data = gf.MeshFem(space.mesh, 1)
    data.set_classical_fem(0)
    ones = np.ones(data.nbdof())
    found = gf.asm_linear_elasticity(space.rule, space.vector, data, lame * ones, shear * ones)
    load = gf.asm_volumic_source(space.rule, space.vector, data, np.outer(weight, ones))
    found, load = matrix_of(found), np.asarray(load).ravel()
    if not space.areas:
        return found, load
    fields = space.rule, space.vector, space.tips[1]
    more, added = space.areas.stiffness(*fields, lame, shear), space.areas.load(*fields, weight)
    found.resize(added.size, added.size)
    return found + matrix_of(more), np.pad(load, (0, added.size - load.size)) + added


def solution(stiffness, load, u, free):
    """Return `u` with its free components (k,) in equilibrium."""
    scale = 1.0 / np.sqrt(stiffness.diagonal()[free])  # of functions that are much alike
    rest, found = load - stiffness @ u, u.copy()
    inner = diags(scale) @ stiffness[free][:, free] @ diags(scale)
    found[free] += scale * splu(inner.tocsc()).solve(scale * rest[free])
    return found


def solve(case):
    """Solve linear statics and write the answer."""
    d, functions = case.dimension, case.parameters.get("tip") == "functions"
    if functions and d == 3:
        raise RefusedError("tip = 'functions' is offered in the plane")
    body, answer = divided(case, wholly=True)
    held, value = held_at_rest(case, body, answer)
    outer, weight = forces(case, body), uniform_weight(case)
    areas = TipAreas(case, body) if functions else None
    if areas and not len(areas.tips):
        areas = None  # cuts that go through, or none
    space = case.timed("enrichment", lambda: Space(case, body, areas))
    count = space.scalar.nbdof()
    if space.vector.nbdof() != d * count:
        raise RuntimeError("the displacement has another space than its components")
    values, middle = evaluation(answer, space.scalar, PULLED)
    unknown = unknown_of_groups(case, body, answer, space, middle)
    if not np.array_equal(np.sort(unknown[answer.used(body.count)]), np.arange(count)):
        raise RefusedError(
            "two level sets do not give this cut and its ends: it turns too far, or leaves slivers "
            "whose unknowns are not told apart"
        )
    stiffness, load = case.timed("assembly", lambda: system(case, space, weight))
    there, size = unknown >= 0, stiffness.shape[0] // d
    load = load.reshape(size, d).copy()
    np.add.at(load, unknown[there], outer[there])
    u, free = np.zeros((size, d)), np.ones((size, d), dtype=bool)
    free[unknown[there]] = ~held[there]
    u[unknown[there]] = np.where(held[there], value[there], 0.0)
    known = u.ravel()
    u = case.timed("solve", lambda: solution(stiffness, load.ravel(), known, free.ravel()))
    energy = 0.5 * u @ (stiffness @ u)
    facets = answer.facets(body.on_a_cut)
    notes = {"method": "XFEM, values of both sides", "getfem": gf.getfem_env("version")}
    if areas:
        answer = TipMesh(case, body, answer, areas)
        gf.util_warning_level(1)  # says of each point that it is outside of the tips' areas
        values = hstack([evaluation(answer, one, PULLED_AT_TIPS)[0]
                         for one in (space.scalar, space.tips[0])]).tocsr()  # fmt: skip
        facets = answer.facets()
        notes |= {"tips": f"{len(areas.tips)} with functions, up to {SHARE:g} of the cut's length",
                  "answer": "linear on cells that shrink towards the tips"}  # fmt: skip
    case.answer(
        answer.points, answer.cells, values @ u.reshape(size, d), unknowns=size * d,
        cut_facets=facets, ledger={"strain": [energy]}, notes=notes,
    )  # fmt: skip


if __name__ == "__main__":
    run(solve)
