"""Conforming P1 elements with scikit-fem, on the scene's own mesh with its cuts opened."""

from time import perf_counter

import numpy as np
import skfem
from skfem.models.elasticity import linear_elasticity

from verify.errors import InputError, UnsupportedSceneError
from verify.exchange import problem_of
from verify.solution import Solution


class SkfemSolver:
    name = "skfem"

    def refuses(self, scene):
        if scene.dimension != 2 or any(cut.kind != "polyline" for cut in scene.cuts):
            return "only plane bodies with polyline cuts"
        still = scene.analysis.kind == "static" and scene.analysis.kinematics == "linear"
        return None if still else "only linear statics"

    def levels(self, scene):
        return scene.mesh.count

    def solve(self, scene, level, repetitions=1):
        if refusal := self.refuses(scene):
            raise UnsupportedSceneError(refusal)
        problem, seconds = problem_of(scene, level, conforming=True), []
        if len(problem.free_pieces()):
            raise InputError(f"nothing holds the piece around {problem.free_pieces()[0]}")
        held, values = (array.ravel() for array in problem.prescribed())
        for _ in range(repetitions):
            start = perf_counter()
            mesh = skfem.MeshTri(problem.points.T, problem.cells.T)
            basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP1()))
            stiffness = linear_elasticity(*problem.lame()).assemble(basis)
            force = problem.nodal_forces().ravel()
            u = skfem.solve(*skfem.condense(stiffness, force, x=values, D=np.flatnonzero(held)))
            seconds.append(perf_counter() - start)
        displacement = u.reshape(1, -1, 2)
        return Solution(problem.points, problem.cells, displacement, cut_facets=problem.cut_facets,
                        unknowns=u.size, size=problem.size, timings={"solve": seconds})  # fmt: skip
