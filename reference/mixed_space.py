"""Displacement and pressure as unknowns of their own: quadratic and linear (Taylor–Hood)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.space import ConformingSpace, SharedUnknowns

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MixedSpace(SharedUnknowns):
    """Quadratic displacements and continuous linear pressures on a conforming mesh.

    Both jump across the cut, whose nodes are doubled.

    Attributes
    ----------
    space : ConformingSpace
        Of the displacements alone; nodes are numbered as there.
    function_space : dolfinx.fem.FunctionSpace
        Of both together.
    displacement_dofs : (l, d) int array
        Unknown of both, on this rank, of each (vector) unknown of `space`.
    pressure_dofs : (q,) int array
        Unknowns of the pressure that this rank owns.
    """

    space: ConformingSpace
    function_space: Any
    displacement_dofs: NDArray[np.int64]
    pressure_dofs: NDArray[np.int64]

    def own_unknowns(
        self, unknowns: NDArray[np.int32]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Find which of some scalar displacements are this rank's own; see the base class."""
        own, at = self.space.own_unknowns(unknowns)
        return self.displacement_dofs.ravel()[own], at

    def own_part(self, values: Array) -> Array:
        """Give the unknowns that this rank owns of displacements, with pressures of zero."""
        own = np.zeros(self.own_size)
        own[self._own_displacements] = self.space.own_part(values)
        return own

    def everywhere(self, local: Array) -> Array:
        """Gather nodal displacements on all ranks; see the base class."""
        return self.space.everywhere(local[self._own_displacements])

    def indices(self, own: NDArray[np.int64]) -> Any:
        """Give some unknowns of this rank as PETSc's index set."""
        from petsc4py import PETSc

        numbers = (own + self.first).astype(PETSc.IntType)
        found: Any = PETSc.IS()
        return found.createGeneral(numbers, comm=self.function_space.mesh.comm)

    def pressure_indices(self) -> Any:
        """Give the pressures of this rank as PETSc's index set."""
        return self.indices(self.pressure_dofs)

    @property
    def _own_displacements(self) -> NDArray[np.int64]:
        return self.displacement_dofs[: self.space.owned].ravel()


class MixedDeformation:
    """Deformation gradient and pressure of an unknown of both, for forms.

    Parameters
    ----------
    solution : dolfinx.fem.Function
        Of the function space of a `MixedSpace`.
    degree : int
        Of the quadrature.

    Attributes
    ----------
    F : ufl expression (d, d)
    J : ufl expression
        det F.
    p : ufl expression
        Pa; positive in tension.
    measure : ufl.Measure
    """

    def __init__(self, solution: Any, degree: int) -> None:
        import ufl

        mesh = solution.function_space.mesh
        self._solution = solution
        displacement, self.p = ufl.split(solution)
        self.F = ufl.Identity(mesh.geometry.dim) + ufl.grad(displacement)
        self.J = ufl.det(self.F)
        self.measure = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": degree})

    def update(self) -> None:
        """Do nothing: forms know the solution."""

    def derivative(self, form: Any, direction: Any) -> Any:
        """Differentiate a form by displacement and pressure."""
        import ufl

        return ufl.derivative(form, self._solution, direction)


def mixed_space(space: ConformingSpace) -> MixedSpace:
    """Add pressures to quadratic displacements."""
    import basix.ufl
    from dolfinx import fem

    V, d = space.function_space, space.dimension
    domain = V.mesh
    cell = "triangle" if d == 2 else "tetrahedron"
    pair = [
        basix.ufl.element("Lagrange", cell, 2, shape=(d,)),
        basix.ufl.element("Lagrange", cell, 1),
    ]
    both = fem.functionspace(domain, basix.ufl.mixed_element(pair))
    vectors = np.asarray(V.dofmap.list, dtype=np.int64)
    dofs = np.full((int(vectors.max()) + 1, d), -1, dtype=np.int64)
    for k in range(d):
        dofs[vectors, k] = both.sub(0).sub(k).dofmap.list
    pressures = np.unique(np.asarray(both.sub(1).dofmap.list, dtype=np.int64))
    found = MixedSpace(space, both, dofs, pressures)
    return MixedSpace(space, both, dofs, pressures[pressures < found.own_size])
