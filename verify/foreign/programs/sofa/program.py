"""SOFA: corotational tetrahedra, lumped mass, one linearisation per step of implicit Euler.

python program.py FOLDER LEVEL

``method`` is how rotations are found: polar, which is the scene's law; qr, large and the others
of SOFA are other laws, which differ by up to a quarter in motion.
"""

import numpy as np
import Sofa
import SofaRuntime
from exchange_files import RefusedError, run
from motion import run_engine

PLUGINS = (
    "Constraint.Projective", "LinearSolver.Direct", "Mass", "MechanicalLoad", "ODESolver.Backward",
    "SolidMechanics.FEM.Elastic", "StateContainer", "Topology.Container.Dynamic",
)  # fmt: skip


class Body:
    """A node of SOFA's scene graph; the engine of `motion`."""

    def __init__(self, case, stage):
        self.case, self.stage, self.root = case, stage, None
        self.held = stage.held.all(axis=1)
        if (stage.held.any(axis=1) != self.held).any():
            raise RefusedError("supports that hold some components of a point only")
        if any(support.get("history") for support in case.problem["held"]):
            raise RefusedError("supports that move in time")
        self.cells = stage.cells.copy()
        edges = stage.points[stage.cells[:, 1:]] - stage.points[stage.cells[:, :1]]
        turned = np.linalg.det(edges) < 0.0
        self.cells[turned] = self.cells[turned][:, [0, 1, 3, 2]]

    def begin(self, u, v, force, dt):
        """Build the graph anew in this state."""
        material, points = self.case.content["material"], self.stage.points
        if self.root is not None:
            Sofa.Simulation.unload(self.root)
        self.root = root = Sofa.Core.Node("root")
        root.gravity = [0.0, 0.0, 0.0]  # all loads are forces
        for plugin in PLUGINS:
            root.addObject("RequiredPlugin", name=f"Sofa.Component.{plugin}")
        root.addObject("DefaultAnimationLoop")
        body = root.addChild("body")
        body.addObject("EulerImplicitSolver", rayleighStiffness=0.0, rayleighMass=0.0)
        body.addObject("SparseLDLSolver", template="CompressedRowSparseMatrixMat3x3d")
        body.addObject(
            "TetrahedronSetTopologyContainer",
            position=points.tolist(), tetrahedra=self.cells.tolist(),
        )  # fmt: skip
        body.addObject("TetrahedronSetGeometryAlgorithms", template="Vec3d")
        self.state_of = body.addObject(
            "MechanicalObject", template="Vec3d", rest_position=points.tolist(),
            position=(points + u).tolist(), velocity=v.tolist(),
        )  # fmt: skip
        body.addObject("DiagonalMass", massDensity=material["density"])
        body.addObject(
            "FastTetrahedralCorotationalForceField", youngModulus=material["young"],
            poissonRatio=material["poisson"], method=self.case.parameters["method"],
        )  # fmt: skip
        body.addObject("FixedProjectiveConstraint", indices=np.flatnonzero(self.held).tolist())
        self.load = body.addObject(
            "ConstantForceField", indices=list(range(len(points))), forces=force.tolist()
        )
        Sofa.Simulation.initRoot(root)

    def step(self, dt, values, force):
        """Step by dt, to the forces of its end."""
        self.load.forces.value = force.tolist()
        self.root.dt.value = dt
        Sofa.Simulation.animate(self.root, dt)

    def state(self):
        """Displacement and velocity."""
        position = np.array(self.state_of.position.value, dtype=float)
        velocity = np.array(self.state_of.velocity.value, dtype=float)
        return position - self.stage.points, velocity


def solve(case):
    """Solve the case."""
    SofaRuntime.importPlugin("Sofa.Component")
    run_engine(case, Body, "lumped", notes={
        "version": str(Sofa.__version__), "scheme": "implicit Euler, one linearisation",
        "mass": "lumped", "method": case.parameters["method"], "linear solver": "SparseLDL",
    })  # fmt: skip


if __name__ == "__main__":
    run(solve, conforming=True)
