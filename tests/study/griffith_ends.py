"""Griffith cracks whose ends fall anywhere in elements, and what their answers are off by."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tip_advance import tip_advances

from reference.exact import exact_solution
from verify.compare.body import body_of
from verify.compare.body_rule import rules
from verify.compare.hooke import law_of
from verify.compare.realised import field_of
from verify.judge.quantities import Measured
from verify.scene import Scene, load_scene
from verify.solvers import find_solver
from verify.solvers.body_of_scene import background_mesh


def crack_scene(ends, angle, mesh):
    """`statics/griffith_inside` with a crack of `angle` degrees from ends[0] to ends[1], m."""
    first, last = np.asarray(ends, dtype=float)
    content = load_scene("statics/griffith_inside").model_dump(mode="json", by_alias=True)
    exact = {
        "centre": (0.5 * (first + last)).tolist(),
        "a": float(0.5 * np.linalg.norm(last - first)),
        "angle": angle,
        "stress": [0.0, 1.0, 0.0],
    }
    content |= {
        "mesh": mesh,
        "exact": {"solution": "griffith", "parameters": exact},
        "cuts": [{"kind": "polyline", "points": [first.tolist(), last.tolist()]}],
        "quantities": [{"kind": "strain_energy"}],
        "acceptance": [],
    }
    scene = Scene.model_validate(content)
    scene._name, scene._file = "crack", Path("crack.toml")
    return scene


@dataclass(frozen=True)
class Off:
    """Errors of an answer.

    `error` is relative, of the displacement in L2. The answer belongs to a crack with other ends:
    `ends` (2, 2) is their shift in elements, by modes, fitted in L2, and `rest` the error that is
    left. `released` is the shift from the energy alone, the sum of both ends: with the outline
    held, dU/da = −G.
    """

    error: float
    ends: np.ndarray
    rest: float
    released: float


class Crack:
    """A crack, its exact solution, and the derivatives of that by the places of the ends."""

    def __init__(self, scene):
        self.scene = scene
        self.mesh, self.size = background_mesh(scene, 0)
        self.exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
        self.body = body_of(scene, np.asarray(self.exact.singular_points))
        self._rule = rules(self.body, self.size, 1)[0]
        points = self._rule.points
        self._true = self.exact.displacement(points, points)
        advances = tip_advances(self.exact, self.body.loops[0])
        self._advances = np.array([one.displacement(points, points) for one in advances])
        self.gram = (
            np.einsum("iqd,jqd,q->ij", self._advances, self._advances, self._rule.weights)
            * (self.size / self._norm(self._true)) ** 2
        )
        self._energy = self.exact.strain_energy(scene)
        k = np.array(self.exact.stress_intensity)
        self.modes = k**2 / (k @ k)  # shares of both modes in the release
        self._release = (1 - scene.material.poisson**2) / scene.material.young * (k @ k)

    def _norm(self, field):
        return float(np.sqrt(self._rule.weights @ np.sum(field**2, axis=1)))

    def solve(self, solver, **parameters):
        """Solve by a solver and say what the answer is off by."""
        solution = find_solver(solver).solve(self.scene, 0, 1, **parameters)
        points, weights = self._rule.points, self._rule.weights
        error = field_of(solution, self.body).displacement(points, points) - self._true
        norm = self._norm(self._true)
        against = np.einsum("iqd,qd,q->i", self._advances, error, weights) * self.size / norm**2
        live = np.diag(self.gram) > 1e-15  # mode II of a crack that is pulled straight has none
        shift = np.zeros(4)
        shift[live] = np.linalg.solve(self.gram[np.ix_(live, live)], against[live])
        rest = error - self.size * np.einsum("i,iqd->qd", shift, self._advances)
        one = Measured(solution, self.body, law_of(self.scene), self.scene)
        excess = one.quantity(self.scene.quantities[0]) - self._energy
        return Off(
            self._norm(error) / norm,
            shift.reshape(2, 2),
            self._norm(rest) / norm,
            -excess / self._release / self.size,
        )
