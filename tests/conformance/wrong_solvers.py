"""Solvers made wrong on purpose, each in one way, from the compact one."""

import os
import signal
import time
from dataclasses import replace

import numpy as np

from verify.compare.hooke import hooke, strain_energy
from verify.compare.simplices import simplices
from verify.result import Regularisation
from verify.scene.tables import Equilibrium
from verify.solvers.xfem import XfemSolver


class Stating(XfemSolver):
    """Right, and states its strain energy."""

    factor = 1.0

    def solve(self, scene, level, repetitions=1):
        solution = super().solve(scene, level, repetitions)
        energy = strain_energy(solution, hooke(scene.material))
        return replace(solution, ledger={"strain": np.array([self.factor * energy])})


class MisstatesTheEnergyByAThousandth(Stating):
    factor = 1.001


class IgnoresTheCut(XfemSolver):
    def solve(self, scene, level, repetitions=1):
        return super().solve(changed(scene, cuts=[]), level, repetitions)


class TakesTheFirstCut(XfemSolver):
    def solve(self, scene, level, repetitions=1):
        return super().solve(changed(scene, cuts=scene.cuts[:1]), level, repetitions)


class TakesOneMaterial(XfemSolver):
    def solve(self, scene, level, repetitions=1):
        return super().solve(changed(scene, material=scene.material.each[0]), level, repetitions)


class TakesOnePoissonRatio(XfemSolver):
    """Reads the moduli of the regions, and not their Poisson's ratios."""

    def solve(self, scene, level, repetitions=1):
        regions = [one.model_copy(update={"poisson": None}) for one in scene.material.regions]
        material = scene.material.model_copy(update={"regions": regions})
        return super().solve(changed(scene, material=material), level, repetitions)


class EndsElsewhere(XfemSolver):
    """Ends a cut some elements of length 0.2 m further on."""

    elements = 0.5
    tip = "through"

    def solve(self, scene, level, repetitions=1):
        def moved(cut):
            start, end = np.array(cut.points[0]), np.array(cut.points[-1])
            far = end + 0.2 * self.elements * (end - start) / np.linalg.norm(end - start)
            return cut.model_copy(update={"points": [*cut.points[:-1], far.tolist()]})

        longer = changed(scene, cuts=[moved(cut) for cut in scene.cuts])
        solution = super().solve(longer, level, repetitions, tip=self.tip)
        return replace(solution, regularisations=[])  # nor does it say so


class EndsCutsHalfAnElementTooSoon(EndsElsewhere):
    elements = -0.5
    tip = "inside"


def excused(solution):
    """A solution that states that something was done to its cut."""
    entry = Regularisation("node moved onto the cut", 1, 0.1, "m")
    return replace(solution, regularisations=[entry])


class ForgetsABranchAndExcusesItself(TakesTheFirstCut):
    def solve(self, scene, level, repetitions=1):
        return excused(super().solve(scene, level, repetitions))


class TakesOneMaterialAndExcusesItself(TakesOneMaterial):
    def solve(self, scene, level, repetitions=1):
        return excused(super().solve(scene, level, repetitions))


class CutsElsewhereAndExcusesItself(XfemSolver):
    """Cuts 0.2 m beside, says that its cut is where it was asked, and excuses itself."""

    aside = 0.2

    def solve(self, scene, level, repetitions=1):
        def moved(cut):
            points = np.add(cut.points, [0.0, self.aside]).tolist()
            return cut.model_copy(update={"points": points})

        other = changed(scene, cuts=[moved(scene.cuts[0]), *scene.cuts[1:]])
        solution = super().solve(other, level, repetitions)
        asked = np.array([cut.points for cut in scene.cuts])
        return excused(replace(solution, cut_facets=asked))


class CutsBesideAndExcusesItself(CutsElsewhereAndExcusesItself):
    aside = 0.02


class CutsBesideAndStretchesACorner(CutsBesideAndExcusesItself):
    """Its cut is a little aside, and one corner of the body far off."""

    def solve(self, scene, level, repetitions=1):
        solution = super().solve(scene, level, repetitions)
        x, y = solution.points.T
        stretch = 0.3 * np.maximum(0.0, 0.8 - x)[:, None] * np.array([1.0, 1.0])
        held = (y < 1e-9) | (y > 1 - 1e-9)
        off = np.where(held[:, None] | (y < 0.6)[:, None], 0.0, stretch)
        return replace(solution, displacement=solution.displacement + off)


class CutsBesideAndSwapsTheParts(CutsBesideAndExcusesItself):
    """Its cut is a little aside, and its lower half moves as the upper one shall."""

    def solve(self, scene, level, repetitions=1):
        solution = super().solve(scene, level, repetitions)
        return replace(solution, displacement=-solution.displacement)


class EndsElsewhereAndExcusesItself(EndsElsewhere):
    def solve(self, scene, level, repetitions=1):
        return excused(super().solve(scene, level, repetitions))


class EndsFarTooSoonAndExcusesItself(EndsElsewhereAndExcusesItself):
    elements = -2.6
    tip = "inside"


class IsTwoPerCentTooStiffInSpace(XfemSolver):
    """Two per cent: no displacement that is prescribed all around tells."""

    def solve(self, scene, level, repetitions=1):
        if scene.dimension == 3:
            stiff = scene.material.model_copy(update={"young": 1.02 * scene.material.young})
            scene = changed(scene, material=stiff)
        return super().solve(scene, level, repetitions)


class HalvesTheStiffness(XfemSolver):
    def solve(self, scene, level, repetitions=1):
        soft = scene.material.model_copy(update={"young": 0.5 * scene.material.young})
        return super().solve(changed(scene, material=soft), level, repetitions)


class TakesTheWrongDensity(XfemSolver):
    def solve(self, scene, level, repetitions=1):
        heavy = scene.material.model_copy(update={"density": 1.2 * (scene.material.density or 1)})
        return super().solve(changed(scene, material=heavy), level, repetitions)


class StretchesWhatTurns(XfemSolver):
    """Adds a tiny stretch to what turns."""

    def solve(self, scene, level, repetitions=1):
        solution = super().solve(scene, level, repetitions)
        return replace(solution, displacement=solution.displacement + 1e-5 * solution.points)


class LinearisesFiniteRotation(XfemSolver):
    """Takes a finite rotation for an infinitesimal one."""

    def solve(self, scene, level, repetitions=1):
        linear = scene.analysis.model_copy(update={"kinematics": "linear"})
        solution = super().solve(changed(scene, analysis=linear), level, repetitions)
        # x + θ × x in place of R x: stretches what it turns
        turn = scene.supports[0].rotation
        skew = np.deg2rad(turn.angle) * turn._spin()
        moved = (solution.points - turn.centre) @ skew.T + scene.supports[0].displacement
        return replace(solution, displacement=moved[None])


class LumpsAsTheThesis(XfemSolver):
    def solve(self, scene, level, repetitions=1):
        return super().solve(scene, level, repetitions, mass="thesis")


class LosesThreeThousandthsOfTheEnergy(XfemSolver):
    """Loses 0.3 % of the energy in play, by a damping that the scene has not and nothing says."""

    def solve(self, scene, level, repetitions=1):
        if scene.analysis.kind == "static":
            return super().solve(scene, level, repetitions)
        own = self.damped(scene, 0.0, level).ledger
        moved = {"work_of_supports": own["work_of_supports"]}
        # what damping proportional to the mass takes is twice its factor times ∫T
        time = np.linspace(0.0, scene.analysis.duration, len(own["kinetic"]))
        taken = 2 * np.trapezoid(own["kinetic"], time)
        in_play = max(np.ptp(own[name]) for name in ("kinetic", "strain", "gravity"))
        solution = self.damped(scene, 0.003 * in_play / taken, level)
        kept = {name: solution.ledger[name] for name in ("strain", "gravity")}
        total = own["kinetic"][0] + sum(row[0] for row in kept.values())
        kinetic = total - sum(kept.values()) + own["work_of_supports"]
        return replace(solution, ledger={**kept, **moved, "kinetic": kinetic})

    def damped(self, scene, factor, level):
        analysis = scene.analysis.model_copy(update={"damping": (factor, 0.0)})
        return super().solve(changed(scene, analysis=analysis), level, 0)


class OverstatesVelocities(XfemSolver):
    """Hands out velocities that are not the rates of its displacements."""

    def solve(self, scene, level, repetitions=1):
        solution = super().solve(scene, level, repetitions)
        if solution.velocity is None:
            return solution
        return replace(solution, velocity=1.1 * solution.velocity)


class BeginsInEquilibrium(XfemSolver):
    """Lets a scene that begins at rest begin in equilibrium under its loads."""

    def solve(self, scene, level, repetitions=1):
        if scene.analysis.kind == "dynamic":
            scene = changed(scene, initial=Equilibrium(kind="equilibrium"))
        return super().solve(scene, level, repetitions)


class ForgetsACell(XfemSolver):
    """Lacks its smallest cell; as much of the largest one is there twice."""

    def solve(self, scene, level, repetitions=1):
        solution = super().solve(scene, level, repetitions)
        volume = simplices(solution.points, solution.cells).volume
        small, large = volume.argmin(), volume.argmax()
        cells, (a, b, *rest) = solution.cells.copy(), solution.cells[large]
        cells[small] = a, len(solution.points), *rest
        share = volume[small] / volume[large]

        def with_one_more(nodal):
            one = nodal[..., [a], :] + share * (nodal[..., [b], :] - nodal[..., [a], :])
            return np.concatenate([nodal, one], axis=-2)

        return replace(
            solution,
            points=with_one_more(solution.points),
            displacement=with_one_more(solution.displacement),
            cells=cells,
            cell_sides=None,
        )


class LosesHorizontalTractions(XfemSolver):
    """Loses the horizontal part of tractions."""

    def solve(self, scene, level, repetitions=1):
        loads = [
            load.model_copy(update={"traction": [0.0, load.traction[1]]})
            if load.kind == "traction"
            else load
            for load in scene.loads
        ]
        return super().solve(changed(scene, loads=loads), level, repetitions)


class DependsOnNumbering(XfemSolver):
    """What sits at the first node of the mesh decides."""

    def solve(self, scene, level, repetitions=1):
        solution = super().solve(scene, level, repetitions)
        factor = 1 + 1e-4 * solution.points[0].sum()
        return replace(solution, displacement=factor * solution.displacement)


class AddsNoiseOfABillionth(XfemSolver):
    """Differs by a billionth from call to call."""

    def solve(self, scene, level, repetitions=1):
        solution = super().solve(scene, level, repetitions)
        noise = 1e-9 * np.random.default_rng().standard_normal(solution.displacement.shape)
        return replace(solution, displacement=solution.displacement + noise)


class CrashesOnCuts(XfemSolver):
    def solve(self, scene, level, repetitions=1):
        if scene.cuts:
            os.kill(os.getpid(), signal.SIGSEGV)
        return super().solve(scene, level, repetitions)


class CrashesInSpace(XfemSolver):
    def solve(self, scene, level, repetitions=1):
        if scene.dimension == 3:
            raise IndexError("index 2 is out of bounds for axis 1 with size 2")
        return super().solve(scene, level, repetitions)


class AnswersForAFreePiece(XfemSolver):
    """Finds a minimum-norm answer where there is none, as a pseudo-inverse would."""

    def solve(self, scene, level, repetitions=1):
        if scene.name == "free-piece":
            scene = changed(scene, cuts=[])
        return super().solve(scene, level, repetitions)


class StumblesOverSlivers(XfemSolver):
    """Is a tenth off as soon as a part is far smaller than the elements."""

    def solve(self, scene, level, repetitions=1):
        solution = super().solve(scene, level, repetitions)
        corners = solution.points[solution.cells]
        volumes = abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
        factor = 1.1 if volumes.min() < 1e-5 * volumes.mean() else 1.0
        return replace(solution, displacement=factor * solution.displacement)


class LocksAsLinearElements(XfemSolver):
    """Right: where the material is nearly incompressible, linear elements lock."""


class Hangs(XfemSolver):
    def solve(self, scene, level, repetitions=1):
        if scene.name == "uncut-2d":
            time.sleep(600)
        return super().solve(scene, level, repetitions)


class RefusesEverything(XfemSolver):
    def refuses(self, scene):
        return "it only does beams"


def changed(scene, **parts):
    """A copy of the scene with other parts."""
    copy = scene.model_copy(update=parts)
    copy._name, copy._file = scene.name, scene.file
    return copy
