"""Integrals of NGSolve and ngsxfem on both sides of a level set."""

import ngsolve as ng
import numpy as np
from ngsolve.la import SparseMatrixd
from xfem import NEG, POS, GetFacetsWithNeighborTypes, dCut

__all__ = ["Forms", "bits", "joining", "mesh_of"]

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


class Forms:
    """Integrals over the three copies of the nodal values: below the cut, above it, elsewhere."""

    def __init__(self, case, body, mesh):
        self.case, self.body, self.mesh = case, body, mesh
        self.lame, self.shear = (float(case.constant(name)[0]) for name in ("lame", "shear"))
        space = ng.VectorH1(mesh, order=1, dgjumps=True)
        self.product = space * space * space
        self.level = ng.GridFunction(ng.H1(mesh, order=1))
        # ngsxfem's quadrature wants no node on the level set; areas change by 1e-12 of an element's
        zero = 1e-12 * case.problem["size"]
        self.level.vec.FV().NumPy()[:] = np.where(body.phi == 0, zero, body.phi)
        self.cut = bits(body.cut)

    def regions(self):
        """Yield the number of a copy, and what is integrated over for it."""
        body = self.body
        for copy, side in enumerate((-1, 1, 0)):
            where = bits(~body.cut & (body.side == side))
            yield copy, ng.dx(definedonelements=where)
        if body.cut.any():
            for copy, (domain, _) in enumerate(SIDES):
                yield copy, dCut(self.level, domain, definedonelements=self.cut)

    def energy(self, u, v):
        """Work of the stresses of u in the strains of v."""
        strain = [0.5 * (ng.Grad(w) + ng.Grad(w).trans) for w in (u, v)]
        identity = ng.Id(self.case.dimension)
        stress = 2 * self.shear * strain[0] + self.lame * ng.Trace(strain[0]) * identity
        return ng.InnerProduct(stress, strain[1])

    def matrix(self, stiffness, density, ghost):
        """Matrix of shares of the stiffness, with a ghost penalty, and of the mass."""
        form, (trial, test) = ng.BilinearForm(self.product), self.product.TnT()
        for copy, dx in self.regions():
            if stiffness:
                form += stiffness * self.energy(trial[copy], test[copy]) * dx
            if density:
                form += density * ng.InnerProduct(trial[copy], test[copy]) * dx
        if stiffness and ghost and self.body.cut.any():
            factor = stiffness * ghost * (self.lame + 2 * self.shear) * mean_size(self.case)
            for copy, (_, sign) in enumerate(SIDES):
                beside = bits(self.body.cut | (self.body.side == sign))
                facets = GetFacetsWithNeighborTypes(
                    self.mesh, a=beside, b=self.cut, bnd_val_a=False, bnd_val_b=False
                )
                jump = [ng.Grad(w) - ng.Grad(w.Other()) for w in (trial[copy], test[copy])]
                ds = ng.dx(skeleton=True, definedonelements=facets)
                form += factor * ng.InnerProduct(*jump) * ds
        form.Assemble()
        return form.mat

    def load(self, weight):
        """Return the forces of a uniform force per volume."""
        form, test = ng.LinearForm(self.product), self.product.TestFunction()
        for copy, dx in self.regions():
            form += ng.CF(tuple(weight)) * test[copy] * dx
        form.Assemble()
        return form.vec


def joining(group, count, d):
    """Matrix that gives the three copies (3, n) of the nodes the values of their groups."""
    columns = np.concatenate([row + c * count for row in group for c in range(d)])
    size = len(columns)
    return SparseMatrixd.CreateFromCOO(
        list(range(size)), list(map(int, columns)), [1.0] * size, size, d * count
    )
