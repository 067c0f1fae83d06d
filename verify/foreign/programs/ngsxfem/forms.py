"""Integrals of NGSolve and ngsxfem on both sides of a level set."""

import ngsolve as ng
import numpy as np
from ngsolve.la import SparseMatrixd
from xfem import (
    NEG,
    POS,
    CutInfo,
    GetFacetsWithNeighborTypes,
    XFESpace,
    dCut,
    neg,
    neg_grad,
    pos,
    pos_grad,
)

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
        self.level = ng.GridFunction(ng.H1(mesh, order=1))
        # ngsxfem's quadrature wants no node on the level set; areas change by 1e-12 of an element's
        zero = 1e-12 * case.problem["size"]
        self.level.vec.FV().NumPy()[:] = np.where(body.phi == 0, zero, body.phi)
        self.cut, self.product = bits(body.cut), self._space()

    def _space(self):
        space = ng.VectorH1(self.mesh, order=1, dgjumps=True)
        return space * space * space

    def fields(self, copy, functions):
        """Displacement and its gradient, as this copy has them, of trial or test functions."""
        return functions[copy], ng.Grad(functions[copy])

    def regions(self):
        """Yield the number of a copy, and what is integrated over for it."""
        body = self.body
        for copy, side in enumerate((-1, 1, 0)):
            where = bits(~body.cut & (body.side == side))
            yield copy, ng.dx(definedonelements=where)
        if body.cut.any():
            for copy, (domain, _) in enumerate(SIDES):
                yield copy, dCut(self.level, domain, definedonelements=self.cut)

    def energy(self, *gradients):
        """Work of the stresses of one displacement in the strains of another."""
        strain = [0.5 * (one + one.trans) for one in gradients]
        identity = ng.Id(self.case.dimension)
        stress = 2 * self.shear * strain[0] + self.lame * ng.Trace(strain[0]) * identity
        return ng.InnerProduct(stress, strain[1])

    def matrix(self, stiffness, density, ghost):
        """Matrix of shares of the stiffness, with a ghost penalty, and of the mass."""
        form, (trial, test) = ng.BilinearForm(self.product), self.product.TnT()
        for copy, dx in self.regions():
            values, gradients = zip(*(self.fields(copy, one) for one in (trial, test)), strict=True)
            if stiffness:
                form += stiffness * self.energy(*gradients) * dx
            if density:
                form += density * ng.InnerProduct(*values) * dx
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
            form += ng.CF(tuple(weight)) * self.fields(copy, test)[0] * dx
        form.Assemble()
        return form.vec

    def joined(self, group, count):
        """Matrix that gives the unknowns of the space the values of the groups (3, n)."""
        return _joining([(row, None) for row in group], count, self.case.dimension)


class EnrichedForms(Forms):
    """Integrals over nodal values and those of ngsxfem's XFESpace: hat functions of one side."""

    def _space(self):
        scalar = ng.H1(self.mesh, order=1)
        self.extra = XFESpace(scalar, CutInfo(self.mesh, self.level))
        d = self.case.dimension
        return ng.FESpace([scalar] * d + [self.extra] * d)

    def fields(self, copy, functions):
        """Displacement and its gradient, of trial or test functions, on a side or beyond."""
        d = self.case.dimension
        values, rows = list(functions[:d]), [ng.grad(one) for one in functions[:d]]
        if copy < len(SIDES):
            value, gradient = ((neg, neg_grad), (pos, pos_grad))[copy]
            values = [one + value(more) for one, more in zip(values, functions[d:], strict=True)]
            rows = [one + gradient(more) for one, more in zip(rows, functions[d:], strict=True)]
        return ng.CF(tuple(values)), ng.CF(tuple(rows), dims=(d, d))

    def joined(self, group, count):
        """Matrix that gives the unknowns of the space the values of the groups (3, n)."""
        above = (np.array(self.level.vec.FV()) > 0.0).astype(int)
        node = np.array([self.extra.BaseDofOfXDof(k) for k in range(self.extra.ndof)], dtype=int)
        own = group[above, np.arange(len(above))]
        other = group[1 - above[node], node]
        return _joining([(own, None), (other, own[node])], count, self.case.dimension)


def _joining(blocks, count, d):
    """Matrix whose rows have the value of a group, or what it is more than that of another one.

    Blocks are pairs of such numbers, each for all `d` components, whose columns come in turn.
    """
    rows, columns, entries, size = [], [], [], 0
    for plus, minus in blocks:
        for c in range(d):
            for one, sign in ((plus, 1.0), (minus, -1.0)):
                if one is not None:
                    rows += range(size, size + len(one))
                    columns += (one + c * count).tolist()
                    entries += [sign] * len(one)
            size += len(plus)
    return SparseMatrixd.CreateFromCOO(rows, columns, entries, size, d * count)
