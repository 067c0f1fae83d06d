"""The same solver with the hook for studies: stiffness, mass and what the supports hold."""

import skfem
from skfem.helpers import dot
from skfem.models.elasticity import linear_elasticity
from skfem_solver import SkfemSolver

from verify.exchange import problem_of
from verify.system import System


@skfem.BilinearForm
def inertia(u, v, w):
    return w.density * dot(u, v)


class SkfemWithSystem(SkfemSolver):
    def system(self, scene, level):
        problem = problem_of(scene, level, conforming=True)
        mesh = skfem.MeshTri(problem.points.T, problem.cells.T)
        basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP1()))
        stiffness, mass = linear_elasticity(*problem.lame()).assemble(basis), None
        if scene.material.density is not None:
            mass = inertia.assemble(basis, density=problem.density())
        return System(stiffness, mass, problem.prescribed()[0].ravel())
