"""Akantu: linear elements on the conforming mesh; trapezoidal rule in time.

python program.py FOLDER LEVEL
"""

import tempfile

import akantu as aka
from exchange_files import RefusedError, run
from motion import run_engine

CELLS = {2: aka._triangle_3, 3: aka._tetrahedron_4}
MATERIAL = """material elastic [
  name = body
  rho = {density}
  E = {young}
  nu = {poisson}
  {plane}
]
"""


class Body:
    """A solid mechanics model of Akantu; the engine of `motion`."""

    def __init__(self, case, stage):
        self.stage, self.steps, self.dt, d = stage, 0, None, case.dimension
        with tempfile.NamedTemporaryFile("w", suffix=".dat") as file:
            file.write(material_of(case))
            file.flush()
            aka.parseInput(file.name)
        self.mesh = aka.Mesh(d)
        made = aka.MeshAccessor(self.mesh)
        made.resizeNodes(len(stage.points))
        self.mesh.getNodes()[:] = stage.points
        self.mesh.addConnectivityType(CELLS[d])
        made.resizeConnectivity(len(stage.cells), CELLS[d])
        self.mesh.getConnectivity(CELLS[d])[:] = stage.cells
        made.makeReady()
        self.model = aka.SolidMechanicsModel(self.mesh)
        self.model.initFull(_analysis_method=aka._static)
        self.model.getBlockedDOFs()[:] = stage.held
        self.solver(
            "equilibrium", aka.TimeStepSolverType.static, aka.IntegrationSchemeType.pseudo_time
        )

    def solver(self, name, kind, scheme):
        """Enter a solver that solves once: everything is linear."""
        self.model.getNewSolver(name, kind, aka.NonLinearSolverType.linear)
        unknown = aka.IntegrationScheme.SolutionType._displacement
        self.model.setIntegrationScheme(name, "displacement", scheme, unknown)

    def equilibrium(self, values, force):
        """Return the displacement at rest, given forces and the values of held components."""
        self.model.getDisplacement()[:] = values
        self.model.getExternalForce()[:] = force
        self.model.solveStep("equilibrium")
        return self.model.getDisplacement().copy()

    def begin(self, u, v, force, dt):
        """Take the acceleration of a very short step that ends at u: it balances the forces."""
        short, model = 1e-4 * dt, self.model
        self.choose(short)
        fields = model.getDisplacement(), model.getVelocity(), model.getAcceleration()
        fields[0][:], fields[1][:], fields[2][:] = u - short * v, v, 0.0
        self.step(short, u, force)
        fields[0][:], fields[1][:] = u, v

    def choose(self, dt):
        """Make a solver for steps of a length; one keeps the matrix of its first step."""
        self.dt, self.steps = dt, self.steps + 1
        self.name = f"motion {self.steps}"
        scheme = aka.IntegrationSchemeType.trapezoidal_rule_2
        self.solver(self.name, aka.TimeStepSolverType.dynamic, scheme)
        self.model.setTimeStep(dt, self.name)

    def step(self, dt, values, force):
        """Step by dt, to values and forces of its end."""
        if dt != self.dt:
            self.choose(dt)
        self.model.getExternalForce()[:] = force
        self.model.solveStep(self.name)

    def state(self):
        """Displacement, velocity, and acceleration if there is one."""
        model = self.model
        fields = (model.getDisplacement(), model.getVelocity(), model.getAcceleration())
        return [field.copy() for field in fields]


def material_of(case):
    """Write the material as a file of Akantu has it."""
    material = case.content["material"]
    plane = f"Plane_Stress = {int(material['plane'] == 'stress')}" if case.dimension == 2 else ""
    return MATERIAL.format(**{**material, "density": material["density"] or 0.0, "plane": plane})


def solve(case):
    """Solve the case."""
    if any(support.get("history") for support in case.problem["held"]):
        raise RefusedError("supports that move in time")
    said = {"version": aka.__version__, "scheme": "trapezoidal rule", "mass": "consistent"}
    run_engine(case, Body, said["mass"], notes={**said, "linear solver": "MUMPS"})


if __name__ == "__main__":
    run(solve, conforming=True)
