"""CutFEM in NGSolve with ngsxfem: two sides of a level set, ghost penalty, linear elasticity.

The level set is that of `cut_body`; a cut that ends inside an element ends at its nearer facet.
"""

import ngsolve as ng
import numpy as np
from cut_body import CutBody, forces, prescribed
from exchange_files import RefusedError, loose_parts, run
from ngsolve.la import SparseMatrixd
from split_cells import SplitMesh
from xfem import NEG, POS, GetFacetsWithNeighborTypes, dCut

SIDES = ((NEG, -1), (POS, 1))


def mean_size(case):
    """Return the mean length of the elements' edges."""
    k = case.cells.shape[1]
    pairs = [(i, j) for i in range(k) for j in range(i)]
    edges = [case.points[case.cells[:, i]] - case.points[case.cells[:, j]] for i, j in pairs]
    return np.linalg.norm(edges, axis=2).mean()


def mesh_of(case):
    """Return the mesh in NGSolve; its vertices are the nodes, in order."""
    from netgen.meshing import FaceDescriptor, Mesh

    mesh = Mesh(dim=case.dimension)
    points = np.zeros((len(case.points), 3))
    points[:, : case.dimension] = case.points
    mesh.AddPoints(points)
    mesh.Add(FaceDescriptor(surfnr=1, domin=1, bc=1))
    cells = case.cells.astype(np.int32).copy()
    edges = case.points[cells[:, 1:]] - case.points[cells[:, :1]]
    turned = np.linalg.det(edges) < 0
    cells[turned, :2] = cells[turned][:, [1, 0]]
    mesh.AddElements(dim=case.dimension, index=1, data=cells, base=0)
    return ng.Mesh(mesh)


def bits(marks):
    """Return marks as NGSolve has them."""
    return ng.BitArray(np.asarray(marks, dtype=bool).tolist())


def assemble(case, body, mesh, ghost):
    """Stiffness and body forces of the three copies of the nodal values: below, above, own."""
    lame, shear = float(case.constant("lame")[0]), float(case.constant("shear")[0])
    space = ng.VectorH1(mesh, order=1, dgjumps=True)
    product = space * space * space
    level = ng.GridFunction(ng.H1(mesh, order=1))
    # ngsxfem's quadrature wants no node on the level set; areas change by 1e-12 of an element's
    zero = 1e-12 * case.problem["size"]
    level.vec.FV().NumPy()[:] = np.where(body.phi == 0, zero, body.phi)
    trial, test = product.TnT()

    def energy(u, v):
        strain = [0.5 * (ng.Grad(w) + ng.Grad(w).trans) for w in (u, v)]
        stress = 2 * shear * strain[0] + lame * ng.Trace(strain[0]) * ng.Id(case.dimension)
        return ng.InnerProduct(stress, strain[1])

    form, load = ng.BilinearForm(product), ng.LinearForm(product)
    weight = np.zeros(case.dimension)
    for one in case.problem["loads"]:
        if one["kind"] == "body_force":
            if "uniform" not in one:
                raise RefusedError("body forces in formulas are not offered")
            weight += one["uniform"]
    weight = ng.CF(tuple(weight))
    where = [bits(~body.cut & (body.side == side)) for side in (-1, 1, 0)]
    for copy in range(3):
        dx = ng.dx(definedonelements=where[copy])
        form += energy(trial[copy], test[copy]) * dx
        load += weight * test[copy] * dx
    cut = bits(body.cut)
    for copy, (domain, sign) in enumerate(SIDES):
        if not body.cut.any():
            break
        dx = dCut(level, domain, definedonelements=cut)
        form += energy(trial[copy], test[copy]) * dx
        load += weight * test[copy] * dx
        beside = bits(body.cut | (body.side == sign))
        facets = GetFacetsWithNeighborTypes(mesh, a=beside, b=cut, bnd_val_a=False, bnd_val_b=False)
        if ghost:
            jump = [ng.Grad(w) - ng.Grad(w.Other()) for w in (trial[copy], test[copy])]
            factor = ghost * (lame + 2 * shear) * mean_size(case)
            ds = ng.dx(skeleton=True, definedonelements=facets)
            form += factor * ng.InnerProduct(*jump) * ds
    form.Assemble()
    load.Assemble()
    return form.mat, load.vec


def solve(case):
    """Solve linear statics and write the answer."""
    ghost = float(case.parameters.get("ghost", 0.1))
    if ghost < 0:
        raise RefusedError(f"ghost = {ghost}; expected a number from 0 on")
    d, body = case.dimension, CutBody(case)
    held, value = prescribed(case, body)
    side = np.where(body.side == 0, 2, (body.side + 1) // 2)
    answer = SplitMesh(case.points, case.cells, body.phi, body.cut, side, body.group)
    loose = loose_parts(answer.points, answer.cells, answer.held(held))
    if len(loose):
        raise RuntimeError(f"nothing holds the part around {loose[0]}")
    mesh, outer = mesh_of(case), forces(case, body)
    n = len(case.points)
    rows = np.arange(3 * d * n)
    columns = np.concatenate([body.group[k] + c * body.count for k in range(3) for c in range(d)])
    joined = SparseMatrixd.CreateFromCOO(
        list(map(int, rows)), list(map(int, columns)), [1.0] * len(rows), len(rows), d * body.count
    )
    turned = joined.CreateTranspose()

    def assembled():
        matrix, load = assemble(case, body, mesh, ghost)
        return turned @ matrix @ joined, (turned * load).Evaluate()

    matrix, load = case.timed("assembly", assembled)
    used = answer.used(body.count)
    free = bits((~held & used[:, None]).T.ravel())

    def solved():
        u = load.CreateVector()
        u.FV().NumPy()[:] = value.T.ravel()
        rest = load.CreateVector()
        rest.FV().NumPy()[:] = load.FV().NumPy() + outer.T.ravel()
        rest.data -= matrix * u
        u.data += matrix.Inverse(free, inverse="sparsecholesky") * rest
        return u.FV().NumPy().reshape(d, -1).T.copy()

    u = case.timed("solve", solved)
    case.answer(
        answer.points, answer.cells, answer.values(u), unknowns=int(used.sum()) * d,
        cut_facets=answer.facets(body.on_a_cut),
        notes={"method": "CutFEM", "ghost": str(ghost), "ngsolve": ng.__version__},
    )  # fmt: skip


if __name__ == "__main__":
    run(solve)
