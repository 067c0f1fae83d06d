"""SOFA: linear elements on the conforming mesh, lumped mass, one linearisation per step.

python program.py FOLDER LEVEL

``scheme`` is implicit Euler or the trapezoidal rule. Rotations of corotational elements are those
of the polar decomposition, which is the scene's law; SOFA's others, by edges of the element, are
other laws. Equilibria are found by Newton's method with SOFA's own tangent, which holds rotations.
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
LAWS = {"linear": "LinearSmallStrainFEMForceField", "corotational": "CorotationalFEMForceField"}
LOAD_STEPS, ITERATIONS = 10, 200  # of finite rotation
RESIDUAL, CHANGE = 1e-10, 1e-13  # of the first residual; of the positions


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
                relativeInitialStoppingThreshold=RESIDUAL, relativeSuccessiveStoppingThreshold=0.0,
                relativeEstimateDifferenceThreshold=CHANGE, absoluteResidualStoppingThreshold=0.0,
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
        turning = {} if self.linear else {"rotationMethod": case.parameters["rotation"]}
        body.addObject(
            LAWS["linear" if self.linear else "corotational"], template=f"{vector},{element}",
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
        """Displacement at rest under forces and values of what is held."""
        count, held = 1 if self.linear else LOAD_STEPS, self.stage.held
        self.graph(0.0 * values, 0.0 * values, force / count, "StaticSolver")
        for n in range(1, count + 1):
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
            u, v, force, "EulerImplicitSolver", rayleighMass=damping[0],
            rayleighStiffness=damping[1],
            trapezoidalScheme=self.case.parameters["scheme"] == "trapezoidal",
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
    schemes = {"euler": "implicit Euler", "trapezoidal": "trapezoidal rule"}
    run_engine(case, Body, "lumped", notes={
        "version": str(Sofa.GetVersion()), "mass": "lumped", "linear solver": "SparseLDL",
        "scheme": f"{schemes[case.parameters['scheme']]}, one linearisation",
        "rotation": case.parameters["rotation"],
    })  # fmt: skip


if __name__ == "__main__":
    run(solve, conforming=True)
