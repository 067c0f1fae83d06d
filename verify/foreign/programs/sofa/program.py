"""SOFA: linear elements on the conforming mesh, lumped mass, one linearisation per step.

python program.py FOLDER LEVEL

``scheme`` is implicit Euler or Newmark's method of average acceleration. SOFA's
``trapezoidalScheme`` (v26.12) is unstable: positions move by the velocity of the end, not by the
mean. A tetrahedron turns as the polar decomposition of its deformation gradient says, which is the
scene's law. SOFA's triangles turn as their corners do about the centroid: another law, which
differs by a share of the strain. Equilibria are found by Newton's method with SOFA's own tangent,
which holds rotations.
"""

import numpy as np
import Sofa
import SofaRuntime
from exchange_files import RefusedError, run
from motion import lumped_mass, run_engine

MODULES = (
    "Constraint.Projective", "LinearSolver.Direct", "Mass", "MechanicalLoad", "ODESolver.Backward",
    "SolidMechanics.FEM.Elastic", "StateContainer", "Topology.Container.Dynamic",
)  # fmt: skip
CELLS = {2: ("Triangle", "triangles"), 3: ("Tetrahedron", "tetrahedra")}
MATRICES = {2: "CompressedRowSparseMatrixd", 3: "CompressedRowSparseMatrixMat3x3d"}
SMALL = "LinearSmallStrainFEMForceField", {}
TURNING = {
    2: ("CorotationalFEMForceField", {"rotationMethod": "polar"}),
    3: ("FastTetrahedralCorotationalForceField", {"method": "polar"}),
}
TURNS = {2: "of the corners about their centroid", 3: "of the deformation gradient"}
SCHEMES = {
    "euler": ("EulerImplicitSolver", "implicit Euler, one linearisation"),
    "newmark": ("NewmarkImplicitSolver", "newmark, one linearisation"),
}
LOAD_STEPS, ITERATIONS, HALVINGS = 10, 500, 8  # of finite rotation, where convergence is linear
ROUGH, RESIDUAL = 1e-3, 1e-9  # of the first residual, on the way and at the end


class Body:
    """A node of SOFA's scene graph; the engine of `motion`."""

    def __init__(self, case, stage):
        self.case, self.stage, self.root = case, stage, None
        self.linear = case.content["analysis"]["kinematics"] == "linear"
        if any(support.get("history") for support in case.problem["held"]):
            raise RefusedError("supports that move in time")

    def graph(self, u, v, force, solver, **settings):
        """Build the graph anew in a state, with a solver."""
        case, stage, d = self.case, self.stage, self.case.dimension
        (element, cells), vector = CELLS[d], f"Vec{d}d"
        if self.root is not None:
            Sofa.Simulation.unload(self.root)
        self.root = root = Sofa.Core.Node("root")
        root.gravity = [0.0, 0.0, 0.0]  # all loads are forces
        root.addObject("DefaultAnimationLoop")
        body = root.addChild("body")
        if solver == "StaticSolver":
            self.newton = body.addObject(
                "NewtonRaphsonSolver", maxNbIterationsNewton=1 if self.linear else ITERATIONS,
                relativeSuccessiveStoppingThreshold=0.0, absoluteResidualStoppingThreshold=0.0,
                maxNbIterationsLineSearch=1 if self.linear else HALVINGS,
                warnWhenLineSearchFails=False, warnWhenDiverge=False,
            )  # fmt: skip
        body.addObject(solver, **settings)
        body.addObject("SparseLDLSolver", template=MATRICES[d])
        body.addObject(f"{element}SetTopologyContainer", **{cells: stage.cells})
        self.state_of = body.addObject(
            "MechanicalObject", template=vector, rest_position=stage.points,
            position=stage.points + u, velocity=v,
        )  # fmt: skip
        if solver != "StaticSolver":
            mass = np.bincount(stage.node, lumped_mass(case))
            body.addObject("DiagonalMass", vertexMass=mass.tolist())
        lame, shear = case.constant("lame"), case.constant("shear")
        ratio = lame / (2.0 * shear)  # SOFA's own Lamé constants in the plane are of plane stress
        poisson = ratio / (1.0 + (d - 1) * ratio)
        law, turning = SMALL if self.linear else TURNING[d]
        body.addObject(
            law, template=vector if law.startswith("Fast") else f"{vector},{element}",
            youngModulus=2.0 * shear * (1.0 + poisson), poissonRatio=poisson, **turning,
        )  # fmt: skip
        for directions in np.unique(stage.held[stage.held.any(axis=1)], axis=0):
            nodes = np.flatnonzero((stage.held == directions).all(axis=1))
            body.addObject(
                "PartialFixedProjectiveConstraint", template=vector, indices=nodes,
                fixedDirections=directions.astype(int), projectVelocity=True,
            )  # fmt: skip
        self.load = body.addObject(
            "ConstantForceField", template=vector, indices=np.arange(len(force)), forces=force
        )
        Sofa.Simulation.initRoot(root)

    def equilibrium(self, values, force):
        """Return the displacement at rest, given forces and the values of held components."""
        count, held = 1 if self.linear else LOAD_STEPS, self.stage.held
        self.graph(0.0 * values, 0.0 * values, force / count, "StaticSolver")
        for n in range(1, count + 1):
            self.newton.relativeInitialStoppingThreshold.value = ROUGH if n < count else RESIDUAL
            self.load.forces.value = n / count * force
            with self.state_of.position.writeable() as position:
                position[held] = (self.stage.points + n / count * values)[held]
            Sofa.Simulation.animate(self.root, 1.0)
            status = str(self.newton.status.value)
            if not self.linear and not status.startswith("Converged"):
                raise RuntimeError(f"load step {n} of {count}: Newton's method of SOFA: {status}")
        return self.state()[0]

    def begin(self, u, v, force, dt):
        """Build the graph anew in this state."""
        damping = self.case.content["analysis"]["damping"]
        self.graph(
            u, v, force, SCHEMES[self.case.parameters["scheme"]][0], rayleighMass=damping[0],
            rayleighStiffness=damping[1],
        )  # fmt: skip

    def step(self, dt, values, force):
        """Step by dt, to the forces of its end."""
        self.load.forces.value = force
        self.root.dt.value = dt
        Sofa.Simulation.animate(self.root, dt)

    def state(self):
        """Displacement and velocity."""
        position = np.array(self.state_of.position.value, dtype=float)
        velocity = np.array(self.state_of.velocity.value, dtype=float)
        return position - self.stage.points, velocity


def solve(case):
    """Solve the case."""
    for module in MODULES:
        if not SofaRuntime.importPlugin(f"Sofa.Component.{module}"):
            raise RuntimeError(f"SOFA has no Sofa.Component.{module}: set SOFA_ROOT, or build it")
    turns = {"rotation": f"polar decomposition {TURNS[case.dimension]}"}
    linear = case.content["analysis"]["kinematics"] == "linear"
    run_engine(case, Body, "lumped", notes={
        "version": str(Sofa.GetVersion()), "mass": "lumped", "linear solver": "SparseLDL",
        "scheme": SCHEMES[case.parameters["scheme"]][1],
        **({} if linear else turns),
    })  # fmt: skip


if __name__ == "__main__":
    run(solve, conforming=True)
