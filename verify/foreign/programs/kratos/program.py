"""Kratos Multiphysics on the conforming mesh: small displacements, Newmark's method in time.

python kratos.py FOLDER LEVEL

At rest also its total Lagrangian elements of neo-Hookean material, whose stress is that of
``model = "neo_hookean"``: S = λ ln J C⁻¹ + μ (I − C⁻¹). Newton's method in load steps.
"""

import KratosMultiphysics as KM  # noqa: N817
import KratosMultiphysics.ConstitutiveLawsApplication as CLA  # noqa: N817
import KratosMultiphysics.LinearSolversApplication as LSA  # noqa: N817
import KratosMultiphysics.StructuralMechanicsApplication as SMA  # noqa: N817
import numpy as np
from exchange_files import RefusedError, run
from motion import run_engine

LAWS = {
    "strain": SMA.LinearElasticPlaneStrain2DLaw,
    "stress": SMA.LinearElasticPlaneStress2DLaw,
    None: SMA.LinearElastic3DLaw,
}
NEO_HOOKEAN = {"strain": CLA.HyperElasticPlaneStrain2DLaw, None: CLA.HyperElastic3DLaw}
LOAD_STEPS, TOLERANCE = 20, 1e-10
FIELDS = (KM.DISPLACEMENT, KM.VELOCITY, KM.ACCELERATION)
OTHERS = (KM.REACTION, KM.VOLUME_ACCELERATION, SMA.POINT_LOAD)
AXES = "XYZ"


class Body:
    """A model part of Kratos; the engine of `motion`."""

    def __init__(self, case, stage):
        self.held, self.d, self.time = stage.held, case.dimension, 0.0
        self.turns = case.content["analysis"]["kinematics"] != "linear"
        self.model, self.strategies, self.begun = KM.Model(), {}, None
        self.part = self.model.CreateModelPart("body", 2)
        self.part.ProcessInfo[KM.DOMAIN_SIZE] = self.d
        for variable in FIELDS + OTHERS:
            self.part.AddNodalSolutionStepVariable(variable)
        for i, point in enumerate(self.padded(stage.points).tolist(), 1):
            self.part.CreateNewNode(i, *point)
        materials = case.content["material"].get("each", [case.content["material"]])
        laid = [
            self.properties(number, material, case.content["analysis"]["damping"])
            for number, material in enumerate(materials)
        ]
        name = "TotalLagrangianElement" if self.turns else "SmallDisplacementElement"
        element = f"{name}{self.d}D{self.d + 1}N"
        for i, (cell, number) in enumerate(
            zip((stage.cells + 1).tolist(), case.material, strict=True), 1
        ):
            self.part.CreateNewElement(element, i, cell, laid[number])
        for i in range(1, len(stage.points) + 1):
            self.part.CreateNewCondition(f"PointLoadCondition{self.d}D1N", i, [i], laid[0])
        at, fixed = KM.KratosGlobals.GetVariable, KM.VariableUtils()
        for axis in AXES:
            fixed.AddDof(at(f"DISPLACEMENT_{axis}"), at(f"REACTION_{axis}"), self.part)
        for i, axis in np.argwhere(stage.held).tolist():
            self.part.Nodes[i + 1].Fix(at(f"DISPLACEMENT_{AXES[axis]}"))

    def properties(self, number, material, damping):
        """Enter a material."""
        found = self.part.CreateNewProperties(number)
        found[KM.YOUNG_MODULUS], found[KM.POISSON_RATIO] = material["young"], material["poisson"]
        found[KM.DENSITY], found[KM.THICKNESS] = material["density"] or 0.0, 1.0
        found[KM.CONSTITUTIVE_LAW] = (NEO_HOOKEAN if self.turns else LAWS)[material["plane"]]()
        found[SMA.RAYLEIGH_ALPHA], found[SMA.RAYLEIGH_BETA] = damping
        return found

    def padded(self, values):
        """Vectors in space."""
        return np.pad(values, ((0, 0), (0, 3 - self.d)))

    def put(self, variable, values):
        """Write nodal values."""
        flat = KM.Vector(self.padded(values).ravel())
        KM.VariableUtils().SetSolutionStepValuesVector(self.part.Nodes, variable, flat, 0)

    def get(self, variable):
        """Read nodal values."""
        flat = KM.VariableUtils().GetSolutionStepValuesVector(self.part.Nodes, variable, 0, self.d)
        return np.array(flat).reshape(-1, self.d)

    def strategy(self, key, scheme):
        """Return the strategy of a key, which solves once."""
        if key not in self.strategies:
            builder = KM.ResidualBasedBlockBuilderAndSolver(LSA.SparseLUSolver())
            if self.turns:
                small = KM.DisplacementCriteria(TOLERANCE, 1e-14)
                found = KM.ResidualBasedNewtonRaphsonStrategy(
                    self.part, scheme, small, builder, 40, False, False, True
                )  # no reactions, one pattern, the mesh moves
            else:
                found = KM.ResidualBasedLinearStrategy(
                    self.part, scheme, builder, False, False, False, False
                )  # nothing computed beside, one pattern, the mesh stays
            found.SetEchoLevel(0)
            found.Check()
            self.strategies[key] = found
        return self.strategies[key]

    def equilibrium(self, values, force):
        """Return the displacement at rest, given forces and the values of held components."""
        count, u = LOAD_STEPS if self.turns else 1, np.zeros_like(values)
        for n in range(1, count + 1):
            self.put(KM.DISPLACEMENT, np.where(self.held, n / count * values, u))
            self.put(SMA.POINT_LOAD, n / count * force)
            strategy = self.strategy("static", KM.ResidualBasedIncrementalUpdateStaticScheme())
            if self.turns:
                KM.VariableUtils().UpdateCurrentPosition(self.part.Nodes, KM.DISPLACEMENT)
            strategy.Initialize()
            strategy.InitializeSolutionStep()
            strategy.Predict()
            solved = strategy.SolveSolutionStep()
            strategy.FinalizeSolutionStep()
            if self.turns and not solved:
                raise RuntimeError(f"load step {n} of {count} does not converge")
            u = self.get(KM.DISPLACEMENT)
        return u

    def begin(self, u, v, force, dt):
        """Take the acceleration of a very short step that ends at u: it balances the forces."""
        short = 1e-4 * dt
        for variable, values in zip(FIELDS, (u - short * v, v, 0.0 * u), strict=True):
            self.put(variable, values)
        self.step(short, u, force)
        for variable, values in zip(FIELDS[:2], (u, v), strict=True):
            self.put(variable, values)

    def step(self, dt, values, force):
        """Step by dt, to values and forces of its end."""
        strategy = self.strategy(dt, KM.ResidualBasedBossakDisplacementScheme(0.0))  # Newmark
        self.time += dt
        self.part.CloneTimeStep(self.time)
        self.part.ProcessInfo[KM.DELTA_TIME] = dt
        self.put(SMA.POINT_LOAD, force)
        self.put(KM.DISPLACEMENT, np.where(self.held, values, self.get(KM.DISPLACEMENT)))
        strategy.Solve()

    def state(self):
        """Displacement, velocity, and acceleration if there is one."""
        return [self.get(variable) for variable in FIELDS]


def solve(case):
    """Refuse what the model does not hold; solve the rest."""
    if case.content["analysis"]["kinematics"] != "linear":
        material = case.content["material"]
        if material.get("each", [material])[0]["model"] != "neo_hookean":
            raise RefusedError(
                "Hooke's law at finite rotation: Kratos' total Lagrangian elements have that of "
                "St. Venant and Kirchhoff or a neo-Hookean one, not that of the corotation"
            )
        if case.content["analysis"]["kind"] == "dynamic":
            raise RefusedError("motion at finite rotation")
    KM.ParallelUtilities.SetNumThreads(1)
    KM.Logger.GetDefaultOutput().SetSeverity(KM.Logger.Severity.WARNING)
    said = {"version": KM.KratosGlobals.Kernel.Version(), "scheme": "newmark", "mass": "consistent"}
    run_engine(case, Body, said["mass"], notes={**said, "linear solver": "Eigen SparseLU"})


if __name__ == "__main__":
    run(solve, conforming=True)
